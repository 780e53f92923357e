"""OSNMA under a sky: which pages of each satellite are received, and whether the key of a RECS is.

A page is lost with the probability that belongs to the C/N0 that E1 tracking reports at the epoch, changed by what the
noise of an attack is at the page's time: the key of a RECS comes up to a minute later. An attack that withholds OSNMA
breaks every page that is on air with it.

An E1 loop on a counterfeit with data of the attacker's own demodulates those, with good checksums: no key among them
validates, and no tag is over them. On a counterfeit that repeats the satellite's data it has the true ones. Of a key
that comes later the loop of the epoch is asked, as it is for the C/N0.

Data count as authenticated by the key that opens the RECS. That a receiver may still have those of half an hour ago is
left out: a satellite whose pages are lost is left out of the authenticated fix.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int64

from vestige.campaign.attack_columns import e1_cn0_dbhz
from vestige.crypto.inav import PAGE_S
from vestige.receiver.osnma_reception import (
    as_mask,
    data_pages,
    demodulated,
    key_pages,
    page_end_s,
    page_loss,
    pages_due,
)
from vestige.receiver.simulation import Simulation
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario


def osnma_columns(scenario: CampaignScenario, truth: Sequence[TruthBlock]) -> dict[str, np.ndarray]:
    """Return which pages were due since the epoch before, which of them each satellite brought, and whose data count.

    `osnma_differs` says whether what was brought is not what the satellite sent, `osnma_data` whether data and tag were
    received that the key of a RECS of the epoch authenticates.
    """
    week_s = _week_s(scenario, truth[0].time_s)
    pages = pages_due(week_s, scenario.interval_s)
    data = _received(scenario, truth, data_pages(week_s, scenario.recs.key_delay))
    return {
        "osnma_due": as_mask(pages >= 0),
        "osnma_pages": np.stack([as_mask(one) for one in _received(scenario, truth, pages)], axis=1),
        "osnma_differs": np.stack([one.e1.own_data for one in truth], axis=1),
        "osnma_data": np.stack(
            [pages.all(axis=1) & ~one.e1.own_data for pages, one in zip(data, truth, strict=True)], axis=1
        ),
    }


def keys_received(scenario: CampaignScenario, truth: Sequence[TruthBlock]) -> Bool[np.ndarray, " n"]:
    """Return whether the key of a RECS that is sent at each epoch is received: whole, from one satellite at least."""
    pages = key_pages(_week_s(scenario, truth[0].time_s), scenario.recs.key_delay)
    received = _received(scenario, truth, pages)
    return np.any([pages.all(axis=1) & ~one.e1.own_data for pages, one in zip(received, truth, strict=True)], axis=0)


def _received(
    scenario: CampaignScenario, truth: Sequence[TruthBlock], pages: Int64[np.ndarray, "n k"]
) -> list[Bool[np.ndarray, "n k"]]:
    """Return for each satellite which pages are received."""
    end_s = page_end_s(pages) - _week_s(scenario, np.zeros(1))[0]
    jammed = _withheld(scenario.simulations[0], end_s)
    return [
        demodulated(
            pages,
            page_loss(_cn0_of_pages(simulation, one, end_s - PAGE_S / 2), scenario.receiver.e1_tracking),
            seed=scenario.seed,
            svid=simulation.svid,
        )
        & ~jammed
        for simulation, one in zip(scenario.simulations, truth, strict=True)
    ]


def _cn0_of_pages(
    simulation: Simulation, truth: TruthBlock, middle_s: Float[np.ndarray, "n k"]
) -> Float[np.ndarray, "n k"]:
    """Return the C/N0 while pages are on air, −∞ while the satellite is not in view."""
    at_epoch = e1_cn0_dbhz(simulation, truth) + 10 * np.log10(1 + truth.e1_attack.rise(Band.E1))
    seen = np.where(truth.view.in_view, at_epoch, -np.inf)[:, None]
    if not simulation.spoofer.attacks:
        return np.broadcast_to(seen, middle_s.shape)
    effects = simulation.spoofer.effects(Band.E1, simulation.svid, np.maximum(middle_s, 0.0).ravel())
    return seen - 10 * np.log10(1 + effects.rise(Band.E1)).reshape(middle_s.shape)


def _withheld(simulation: Simulation, end_s: Float[np.ndarray, "n k"]) -> Bool[np.ndarray, "n k"]:
    """Return whether an attack breaks pages, whatever the C/N0."""
    if not simulation.spoofer.attacks:
        return np.zeros(end_s.shape, bool)
    ends_s, place = np.unique(end_s, return_inverse=True)
    broken = [simulation.spoofer.withholds_osnma(float(one) - PAGE_S, float(one)) for one in ends_s]
    return np.array(broken)[place].reshape(end_s.shape)


def _week_s(scenario: CampaignScenario, time_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return times after the start as times after the start of its week."""
    return scenario.start_time.second + time_s
