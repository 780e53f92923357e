"""Model the reception of OSNMA under a sky: which pages are received, and whether the key of a RECS is received.

The C/N0 of the signal that E1 tracks at the epoch gives the probability that a page is lost. The key of a RECS is sent
up to a minute after the epoch. So the C/N0 of the epoch is corrected for the noise of an attack at the time of the
page. An attack that withholds OSNMA destroys every page that is on air during the attack.

An E1 loop on a spoofing signal with the attacker's own navigation data demodulates these data with valid checksums. The
attacker's data contain no valid key, and no tag covers the attacker's data. A spoofing signal that repeats the
satellite's data has the true data. The signal that the loop follows at the epoch also decides whether a later key is
received.

If E1 acquires a satellite at an epoch, the processor gets none of the satellite's pages that ended since the previous
epoch.

Data count as authenticated if the key that decrypts the RECS authenticates these data. A receiver may still use data
that were authenticated half an hour ago, but the model neglects such older data. So a satellite whose pages are lost is
left out of the authenticated fix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int64

from vestige.constants import PAGES_A_SUBFRAME, SUBFRAME_S
from vestige.crypto.recs.recs_segment import key_time
from vestige.navigation.inav.page import PAGE_S
from vestige.receiver.osnma_reception import (
    data_pages,
    demodulated,
    key_pages,
    page_end_s,
    page_loss,
    pages_due,
)
from vestige.receiver.simulation import Simulation
from vestige.receiver.snapshots.e1 import tracked_cn0_dbhz
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.records.snapshot_block import OsnmaBlock
from vestige.time import GalileoTime


@dataclass(frozen=True, kw_only=True)
class OsnmaReception:
    """Reception of OSNMA in a block of epochs of a sky."""

    of: ReceiverTruth

    @property
    def week_s(self) -> Float[np.ndarray, " n"]:
        """Times of the epochs in s after the start of the week in which the scenario starts."""
        return self.of.simulations[0].start.second + self.of.truth[0].time_s

    @cached_property
    def key_received(self) -> Bool[np.ndarray, " n"]:
        """Whether the key of each epoch's RECS is received completely, from at least one satellite."""
        pages = key_pages(self.week_s, self.of.simulations[0].key_delay)
        return np.any(self._whole(pages), axis=0) & ~self._withheld_by_operator

    @property
    def data_authenticated(self) -> Bool[np.ndarray, "n m"]:
        """Whether each satellite's data are received, and also the tag of these data that the epoch's key verifies."""
        pages = data_pages(self.week_s, self.of.simulations[0].key_delay)
        return np.stack(self._whole(pages), axis=1) & ~self._withheld_by_operator[:, None]

    @cached_property
    def _withheld_by_operator(self) -> Bool[np.ndarray, " n"]:
        """Whether an event of the operator withholds the key of each epoch's RECS from all receivers."""
        simulation, svids = self.of.simulations[0], [one.svid for one in self.of.simulations]
        if not simulation.osnma.events:
            return np.zeros(self.week_s.size, np.bool_)
        sent_s, place = np.unique(self.of.truth[0].time_s, return_inverse=True)
        times = [key_time(simulation.start + float(one), simulation.key_delay) for one in sent_s]
        return np.array([simulation.osnma.withholds(svids, time) for time in times], np.bool_)[place]

    def pages(self, interval_s: float) -> PagesReceived:
        """Return the received pages, and the pages of a second channel, which receives every satellite in view."""
        start = self.of.simulations[0].start
        page = pages_due(self.week_s, interval_s)
        return PagesReceived(
            start=start,
            interval_s=interval_s,
            page=page,
            in_view=self.of.in_view,
            received=np.stack(self._received(page), axis=1) & ~self.of.acquiring[..., None],
            forged=~np.stack(self._true, axis=1),
        )

    def _whole(self, pages: Int64[np.ndarray, "n k"]) -> list[Bool[np.ndarray, " n"]]:
        """Return for each satellite whether all given pages of an epoch are received with the satellite's own data."""
        return [came.all(axis=1) & true for came, true in zip(self._received(pages), self._true, strict=True)]

    @property
    def _true(self) -> list[Bool[np.ndarray, " n"]]:
        """Whether the data that E1 demodulates for each satellite are true, and not an attacker's own."""
        return [~one.e1.forged_nav_data for one in self.of.truth]

    def _received(self, pages: Int64[np.ndarray, "n k"]) -> list[Bool[np.ndarray, "n k"]]:
        """Return for each satellite which pages are received."""
        simulation, due = self.of.simulations[0], pages >= 0
        row, page = np.nonzero(due)[0], pages[due]
        # several epochs need the same page, so each page is computed once
        end_s, place = np.unique(page_end_s(page) - simulation.start.second, return_inverse=True)
        jammed = _withheld(simulation, end_s)[place]
        received = []
        for one, truth in zip(self.of.simulations, self.of.truth, strict=True):
            came = np.zeros(pages.shape, np.bool_)
            loss = _page_loss(one, truth, row, end_s - PAGE_S / 2, place)
            came[due] = demodulated(page, loss, seed=self.of.seed, svid=one.svid) & ~jammed
            received.append(came)
        return received


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PagesReceived:
    """Pages of n epochs and m satellites: all pages that were sent, and the received pages."""

    start: GalileoTime  # start of the scenario
    interval_s: float  # time in s between epochs
    page: Int64[np.ndarray, "n 15"]  # numbers of the pages, as returned by `pages_due`
    in_view: Bool[np.ndarray, "n m"]  # whether a second channel receives the satellite
    received: Bool[np.ndarray, "n m 15"]  # whether each page was received
    forged: Bool[np.ndarray, "n m"]  # whether the demodulated data of a satellite are the attacker's own

    @property
    def block(self) -> OsnmaBlock:
        """Pages, grouped by epoch and subframe, in the form that the processor reads."""
        row, place = np.nonzero(self.page >= 0)
        number = self.page[row, place] // PAGES_A_SUBFRAME
        pieces, piece = np.unique(np.stack([row, number], axis=1), axis=0, return_inverse=True)
        epoch, subframe = pieces.T
        due, came = np.zeros((2, epoch.size, self.in_view.shape[1]), np.int64)
        bit = (np.int64(1) << place)[:, None]
        np.bitwise_or.at(due, piece.ravel(), np.where(self.in_view[row], bit, 0))
        np.bitwise_or.at(came, piece.ravel(), np.where(self.received[row, :, place], bit, 0))
        begun_s = self.start.second - self.interval_s
        return OsnmaBlock(
            epoch=epoch,
            subframe=self.start.gst_seconds - self.start.second + SUBFRAME_S * subframe,
            due=due,
            received=came & due,
            differs=np.where(self.forged[epoch], came & due, 0),
            last=_ends(self.page[epoch], subframe, begun_s=begun_s, interval_s=self.interval_s),
        )


def _ends(
    page: Int64[np.ndarray, "k 15"], subframe: Int64[np.ndarray, " k"], *, begun_s: float, interval_s: float
) -> Bool[np.ndarray, " k"]:
    """Return which pieces (one epoch and one subframe) have the last page of a subframe with all its pages in the run.

    The pages of the run end more than `begun_s` seconds after the start of the week. Each epoch has the pages that
    ended in the last `interval_s` seconds. If `interval_s` is 30 s or more, each epoch has the pages of the last
    subframe that has ended, which are all in the run.
    """
    looks_at_all = interval_s >= SUBFRAME_S
    whole = looks_at_all | (page_end_s(subframe * PAGES_A_SUBFRAME) > begun_s)
    return whole & np.any(page == (subframe * PAGES_A_SUBFRAME + PAGES_A_SUBFRAME - 1)[:, None], axis=1)


def _page_loss(
    simulation: Simulation,
    truth: TruthBlock,
    row: Int64[np.ndarray, " p"],
    middle_s: Float[np.ndarray, " q"],
    place: Int64[np.ndarray, " p"],
) -> Float[np.ndarray, " p"]:
    """Return the probability that each of p pages is lost.

    Parameters
    ----------
    simulation, truth
        Simulation and truth of the satellite; every page is lost while the satellite is out of view.
    row
        Row of each page's epoch in `truth`.
    middle_s, place
        Middle of q different pages in s after the scenario's start, and the index of each of the p pages in `middle_s`.
    """
    at_epoch = tracked_cn0_dbhz(simulation, truth) + 10 * np.log10(1 + truth.e1_attack.rise(Band.E1))
    seen, tracking = np.where(truth.geometry.in_view, at_epoch, -np.inf), simulation.models.e1_tracking
    if not simulation.spoofer.attacks:
        return page_loss(seen, tracking)[row]
    effects = simulation.spoofer.effects(Band.E1, simulation.svid, np.maximum(middle_s, 0.0))
    return page_loss(seen[row] - 10 * np.log10(1 + effects.rise(Band.E1))[place], tracking)


def _withheld(simulation: Simulation, end_s: Float[np.ndarray, " q"]) -> Bool[np.ndarray, " q"]:
    """Return for each time whether an attack destroys the page that ends at this time, whatever the C/N0 is."""
    if not simulation.spoofer.attacks:
        return np.zeros(end_s.size, np.bool_)
    return np.array([simulation.spoofer.withholds_osnma(one - PAGE_S, one) for one in end_s.tolist()], np.bool_)
