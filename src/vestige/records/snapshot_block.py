"""Define the input of the processor for n epochs and m satellites; a single snapshot is a block of one epoch."""

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
    """E1 measurements as arrays [epoch, satellite], NaN where a satellite is not tracked."""

    # attributes of `E1Observation` as arrays; the C/N0 is the receiver's estimate
    pseudorange_m: Float[np.ndarray, "n m"]
    carrier_phase_cycles: Float[np.ndarray, "n m"]
    doppler_hz: Float[np.ndarray, "n m"]
    doppler_rate_hz_per_s: Float[np.ndarray, "n m"]
    cn0_dbhz: Float[np.ndarray, "n m"]
    # E1 correlators around the prompt, measured behind the gain control. The unit is the standard deviation per
    # dimension of the noise without interference. `taps` is None if E1 is not tracked between two RECS.
    taps: Complex128[np.ndarray, "n m k"] | None = None
    tap_chips: tuple[float, ...] = ()  # offsets of the correlators from the prompt in chips

    @property
    def seen(self) -> Bool[np.ndarray, "n m"]:
        """Whether E1 of a satellite is tracked at an epoch."""
        return np.isfinite(self.pseudorange_m)

    def observation(self, svid: int, epoch: int, satellite: int) -> E1Observation:
        """Return the observation of one satellite at one epoch."""
        here = (epoch, satellite)
        return E1Observation(svid=svid, **{name: float(getattr(self, name)[here]) for name in OBSERVED})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrontEndBlock:
    """Status of one front end as arrays [epoch].

    The power is in dB relative to a fixed reference of the front end. An unknown power or gain is NaN.
    """

    agc_gain_db: Float[np.ndarray, " n"]
    total_power_db: Float[np.ndarray, " n"]
    saturated: Bool[np.ndarray, " n"]

    @property
    def power_db(self) -> Float[np.ndarray, " n"]:
        """Power of the band in dB, or minus the gain in dB where only the gain is known."""
        return np.where(np.isfinite(self.total_power_db), self.total_power_db, -self.agc_gain_db)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OsnmaBlock:
    """Comparison of received OSNMA with a second channel, for k pieces of subframes.

    A subframe may come in several pieces, one for each epoch. Each piece ends at or before its epoch. Each number in
    `due`, `received` and `differs` has a bit for every page of the subframe (bit 0 is the first page). The bit
    `KEY_BIT` is for a key that is compared as a whole, because the pages of the key are unknown.
    """

    epoch: Int64[np.ndarray, " k"]  # first row of the block at whose time the piece is known
    subframe: Int64[np.ndarray, " k"]  # start of the subframe in s since the GST epoch
    due: Int64[np.ndarray, "k m"]  # pages that were sent, according to the second channel
    received: Int64[np.ndarray, "k m"]  # demodulated pages
    differs: Int64[np.ndarray, "k m"]  # demodulated pages that differ from the same page of the second channel
    last: Bool[np.ndarray, " k"]  # whether the subframe ends with the piece and was compared completely


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VelocityIncrements:
    """Kinematic velocity increments of inertial sensors, relative to the Earth and without gravity."""

    epoch: Int64[np.ndarray, " k"]  # row of the block; the increment lies between the previous row and this row
    time: GalileoTimes  # end of each increment on the receiver's clock
    # change of the velocity to the east, north and up since the previous increment
    delta_velocity_mps: Float[np.ndarray, "k 3"]
    covered: Bool[np.ndarray, " n"]  # whether the increments up to an epoch have no gap since the previous epoch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BankBlock:
    """Banks of correlators of n epochs and m satellites."""

    # offset of each tap from the hand-over's prediction in m; positive is later
    offsets_m: Float[np.ndarray, " n_taps"]
    taps: Complex128[np.ndarray, "n m n_taps"]  # complex128[n, m, n_taps]; NaN where nothing was correlated
    noise_power: Float[np.ndarray, "n m"]  # noise power, see `CorrelatorBank`; NaN where nothing was correlated
    integration_s: Float[np.ndarray, "n m"]  # coherent integration time in s; NaN where nothing was correlated


@runtime_checkable
class Handovers(Protocol):
    """Source of the hand-overs of a block; the chips of a hand-over are decrypted when the hand-over is requested."""

    def at(self, epoch: int, satellite: int) -> Handover | None:
        """Return the hand-over of one satellite at one epoch; None if its samples may end after the disclosure."""


@runtime_checkable
class E6(Protocol):
    """E6 data of a block that the processor can correlate: samples, or a model that draws the correlators."""

    def correlate(
        self, asked: Bool[np.ndarray, "n m"], handovers: Handovers, offsets_m: Float[np.ndarray, " n_taps"]
    ) -> BankBlock:
        """Return the banks at `offsets_m` around the hand-overs in `asked`; NaN where nothing was correlated."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchBlock:
    """Results of a search in k epochs for m satellites."""

    signals: Float[np.ndarray, "k m"]  # number of signals of a satellite; NaN where the search was not run
    carrying: Float[np.ndarray, "k m"]  # number of signals that carry the encrypted chips
    # Offset of the earliest of several signals from the E1 prediction in m, positive if later. The offset is NaN for a
    # single signal, or if the chips may have been public when the earliest signal arrived.
    earliest_m: Float[np.ndarray, "k m"]
    not_run: Int8[np.ndarray, "k m"]  # 0 where the search was run, else 1 + the index in `SEARCH_NOT_RUN`


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchRequest:
    """Request for a search: the epochs, and the time uncertainty of each epoch."""

    epoch: Int64[np.ndarray, " k"]  # rows of the block in which the search runs
    uncertainty: tuple[TimeUncertainty, ...]  # upper limit of the clock error before each epoch
    p_fa: float  # false-alarm probability of one search
    # predicted arrival of each RECS from E1, in s after the time of the snapshot; NaN if unknown
    expected_s: Float[np.ndarray, "k m"]
    in_samples: SampleSearches | None = None  # searches in samples; None for a model


class SampleSearches(Protocol):
    """The search of E1 and the exhaustive search in the samples of one snapshot, with the processor's settings."""

    def e1(self, snapshot: Snapshot, svids: tuple[int, ...], request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6 for some satellites."""

    def exhaustive(self, snapshot: Snapshot, svids: tuple[int, ...], request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6 for some satellites."""


@runtime_checkable
class Searches(Protocol):
    """Searches of a block, which are made in samples or drawn from a model of the detection."""

    def e1(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6 [WFO, Sec. IV-B, step 4]."""

    def exhaustive(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6 [WFO, Sec. IV-C, step 5]."""


SEARCH_NOT_RUN = (
    "no E1 samples",
    "no signal of this satellite on E1",
    "no E6 samples",
    "the satellite has no RECS with a known key that was still secret at reception",
    "the E6 samples do not hold the RECS anywhere in the time uncertainty",
    "the RECS was not found in E6",
    "the RECS was found, but its key may have been public when it arrived",
    "the RECS contains the open E6-C code, which repeats each ms, so a search cannot tell a replay from the code "
    "itself",
    "the next search is not due yet",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SnapshotBlock:
    """Data that a receiver gives the processor for n epochs and m satellites.

    Attributes
    ----------
    index
        Running number of each epoch in its source.
    time
        Receiver-clock times to which the observations refer.
    received_at
        [n, m], receiver-clock time at which the last E6 sample for a satellite was received. The processor compares
        `received_at` with the disclosure of the key.
    time_uncertainty_s
        Upper limit of the error of the receiver's clock against Galileo System Time, in s.
    svids
        Satellites of the second axis, in ascending order.
    asked
        bool[n, m]: satellites whose verdict is due, tracked on E1 or not.
    recs
        bool[n]: epochs with RECS.
    e1
        E1 measurements of all satellites.
    front_end
        Power and gain of the front ends, by band.
    e6
        Object with the method `correlate`; None without E6.
    searches
        Object that makes the search of E1 and the exhaustive search; None if no search is possible.
    osnma
        OSNMA compared with a second channel; None without a second channel.
    increments
        Velocity increments of the inertial sensors; None without inertial sensors.
    data_authenticated
        bool[n, m], whether OSNMA authenticates the navigation data of a satellite; None if not checked.
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
