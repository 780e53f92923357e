"""Input of the processor for n epochs of m satellites; one snapshot is a block of one epoch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Complex128, Float, Int8, Int64

from vestige.records import Band, E1Observation, Handover, Snapshot
from vestige.records.time_uncertainty import TimeUncertainty
from vestige.records.times import GalileoTimes

OBSERVED = tuple(one.name for one in fields(E1Observation) if one.name != "svid")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class E1Block:
    """E1 measurements; arrays [epoch, satellite], NaN where a satellite is not tracked."""

    # as in `E1Observation`; the C/N0 is the receiver's estimate
    pseudorange_m: Float[np.ndarray, "n m"]
    carrier_phase_cycles: Float[np.ndarray, "n m"]
    doppler_hz: Float[np.ndarray, "n m"]
    doppler_rate_hz_per_s: Float[np.ndarray, "n m"]
    cn0_dbhz: Float[np.ndarray, "n m"]
    # E1 correlators around the prompt, in standard deviations of the noise per dimension without
    # interference, behind the gain control; None if E1 is not tracked between two RECS.
    taps: Complex128[np.ndarray, "n m k"] | None = None
    tap_chips: tuple[float, ...] = ()  # their offsets from the prompt in chips

    @property
    def seen(self) -> Bool[np.ndarray, "n m"]:
        """Whether E1 shows a satellite."""
        return np.isfinite(self.pseudorange_m)

    def observation(self, svid: int, epoch: int, satellite: int) -> E1Observation:
        """Return the observation of one satellite at one epoch."""
        here = (epoch, satellite)
        return E1Observation(svid=svid, **{name: float(getattr(self, name)[here]) for name in OBSERVED})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrontEndBlock:
    """Status of one front end; arrays [epoch], powers in dB relative to its own reference, NaN if unknown."""

    agc_gain_db: Float[np.ndarray, " n"]
    total_power_db: Float[np.ndarray, " n"]
    saturated: Bool[np.ndarray, " n"]

    @property
    def power_db(self) -> Float[np.ndarray, " n"]:
        """Power of the band, or the negative of the gain where only that is known."""
        return np.where(np.isfinite(self.total_power_db), self.total_power_db, -self.agc_gain_db)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OsnmaBlock:
    """OSNMA as received beside what a second channel has, in pieces of k subframes that ended up to an epoch.

    A subframe may come in several pieces, epoch by epoch. Each piece has a bit for every page of the subframe (bit 0:
    the first page) and one, `KEY_BIT`, for a key that is compared as a whole because its pages are not known.
    """

    epoch: Int64[np.ndarray, " k"]  # row of the block in which the piece is known
    subframe: Int64[np.ndarray, " k"]  # start of the subframe in s since the GST epoch
    due: Int64[np.ndarray, "k m"]  # pages that the second channel knows to have been sent
    # those of them that were demodulated, and those that are not what the second channel has
    received: Int64[np.ndarray, "k m"]
    differs: Int64[np.ndarray, "k m"]
    last: Bool[np.ndarray, " k"]  # whether the piece ends its subframe, and all of the subframe was looked at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VelocityIncrements:
    """Velocity increments of inertial sensors: kinematic, against the Earth, without gravity."""

    epoch: Int64[np.ndarray, " k"]  # row of the block up to which the increment counts
    time: GalileoTimes  # end of each increment on the receiver's clock
    # east, north, up where the receiver is at that time, since the increment before
    delta_velocity_mps: Float[np.ndarray, "k 3"]
    covered: Bool[np.ndarray, " n"]  # whether the increments up to an epoch leave no gap since the epoch before


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BankBlock:
    """Correlator banks of n epochs and m satellites."""

    # offset of each tap from the hand-over's prediction in m; positive is later
    offsets_m: Float[np.ndarray, " n_taps"]
    taps: Complex128[np.ndarray, "n m n_taps"]  # complex128[n, m, n_taps]; NaN where nothing was correlated
    noise_power: Float[np.ndarray, "n m"]  # as in `CorrelatorBank`; NaN where nothing was correlated
    integration_s: Float[np.ndarray, "n m"]  # coherent integration time in s; NaN where nothing was correlated


@runtime_checkable
class Handovers(Protocol):
    """The hand-overs of a block, made one by one because each decrypts its chips when it is asked for."""

    def at(self, epoch: int, satellite: int) -> Handover | None:
        """Return the hand-over of one satellite at one epoch; None if its window is too late to prove anything."""


@runtime_checkable
class E6(Protocol):
    """E6 of a block as the processor knows it: samples, or a model that draws what they would give."""

    def correlate(
        self, asked: Bool[np.ndarray, "n m"], handovers: Handovers, offsets_m: Float[np.ndarray, " n_taps"]
    ) -> BankBlock:
        """Return the banks at `offsets_m` around the hand-overs that are asked for, NaN where E6 does not hold them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchBlock:
    """Results of a search in k epochs for m satellites."""

    signals: Float[np.ndarray, "k m"]  # number of signals of a satellite; NaN where the search was not run
    carrying: Float[np.ndarray, "k m"]  # number of those that carry the encrypted chips
    # how much later than E1 puts it the earliest of several signals is, in m; NaN if there is one only or its chips may
    # have been known by then.
    earliest_m: Float[np.ndarray, "k m"]
    not_run: Int8[np.ndarray, "k m"]  # 0 where it was run, else 1 + the place in `SEARCH_NOT_RUN`


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchRequest:
    """Request for a search: the epochs, and what is known of the clock in each."""

    epoch: Int64[np.ndarray, " k"]  # rows of the block
    uncertainty: tuple[TimeUncertainty, ...]  # what is known of the clock before each epoch
    p_fa: float  # false-alarm probability of one search
    # when E1 expects each RECS, in s after the time of the snapshot; NaN where it does not
    expected_s: Float[np.ndarray, "k m"]
    in_samples: SampleSearches | None = None  # how samples are searched; a model needs no such thing


class SampleSearches(Protocol):
    """Both searches in the samples of one snapshot, with the settings and the assistance of the processor that asks."""

    def e1(self, snapshot: Snapshot, svids: tuple[int, ...], request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6 for some satellites."""

    def exhaustive(self, snapshot: Snapshot, svids: tuple[int, ...], request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6 for some satellites."""


@runtime_checkable
class Searches(Protocol):
    """The searches of a block: made in samples, or drawn by a model of their detection."""

    def e1(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6 [WFO, Sec. IV-B, step 4]."""

    def exhaustive(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6 [WFO, Sec. IV-C, step 5]."""


SEARCH_NOT_RUN = (
    "no E1 samples",
    "no signal of this satellite on E1",
    "no E6 samples",
    "no RECS of this satellite, or no key that proves anything",
    "the E6 samples do not hold the RECS anywhere in the time uncertainty",
    "the RECS was not found in E6",
    "the RECS was found when its key may have been known",
    "the RECS holds the open E6-C code, which repeats each ms, so a search cannot tell a replay from the code itself",
    "not due",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SnapshotBlock:
    """Data that a receiver hands to the processor for n epochs of m satellites.

    Attributes
    ----------
    index
        Running number of each epoch in its source.
    time
        Receiver-clock times to which the observations refer.
    received_at
        [n, m], receiver-clock times of the last E6 sample that a satellite is looked for in; the disclosure rule looks
        at these.
    time_uncertainty_s
        Upper limit of the error of the receiver's clock against Galileo System Time, in s.
    svids
        The satellites, in ascending order: the second axis.
    asked
        bool[n, m]: satellites whose verdict is due, whether E1 shows them or not.
    recs
        bool[n]: epochs with RECS.
    e1
        Measurements of E1 tracking.
    front_end
        Power and gain of the front ends, by band.
    e6
        Object that answers `correlate`; None without E6.
    searches
        Object that answers both searches; None where nothing can be searched.
    osnma
        OSNMA beside that of a second channel; None without one.
    increments
        Increments of the inertial sensors; None without such sensors.
    data_authenticated
        bool[n, m], whether OSNMA authenticates the navigation data of a satellite; None if nobody looked.
    """

    index: Int64[np.ndarray, " n"]
    time: GalileoTimes
    received_at: GalileoTimes
    time_uncertainty_s: Float[np.ndarray, " n"]
    svids: tuple[int, ...]
    asked: Bool[np.ndarray, "n m"]
    recs: Bool[np.ndarray, " n"]
    e1: E1Block
    front_end: Mapping[Band, FrontEndBlock] = field(default_factory=dict)
    e6: E6 | None = None
    searches: Searches | None = None
    osnma: OsnmaBlock | None = None
    increments: VelocityIncrements | None = None
    data_authenticated: Bool[np.ndarray, "n m"] | None = None
