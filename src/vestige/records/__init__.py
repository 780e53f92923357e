"""Define the records that the parts of vestige exchange.

Records are frozen dataclasses with keyword arguments, and the names of attributes contain the units. By convention, a
**positive offset means a later arrival**. The processor receives only snapshots (as a `SnapshotBlock`) and
assistance, so the processor cannot tell a simulation from a recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Complex64, Complex128, Float, Int8, UInt32

from vestige.errors import VestigeError
from vestige.records.packed_chips import packed_chips, unpacked_chips
from vestige.records.verdict import CheckResult as CheckResult
from vestige.records.verdict import Outcome as Outcome
from vestige.records.verdict import Status as Status
from vestige.records.verdict import Verdict as Verdict
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite, require_finite_if_known, require_time_uncertainty
from vestige.validated_key import ValidatedKey

_ROUNDING_S = 1e-6  # largest rounding difference in s between two computations of the time at which samples end

if TYPE_CHECKING:
    from vestige.records.recs_block import RecsLookup
    from vestige.records.snapshot_block import SnapshotBlock


class Band(Enum):
    """A frequency band with its own front end."""

    E1 = "E1"
    E6 = "E6"


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Observation:
    """E1 measurements of one satellite at the time of a snapshot.

    Attributes
    ----------
    pseudorange_m
        c · (reception time on the receiver's clock − transmission time on the satellite's clock), in m.
    carrier_phase_cycles
        Accumulated carrier phase in cycles, growing when the range grows (RINEX convention); NaN if not measured.
    doppler_hz
        Carrier Doppler in Hz, positive when the satellite approaches; NaN if not measured.
    doppler_rate_hz_per_s
        Rate of change of the Doppler in Hz/s; NaN if not measured.
    cn0_dbhz
        C/N0 of E1-C alone (per component) in dBHz; NaN if not measured.
    """

    svid: int
    pseudorange_m: float
    carrier_phase_cycles: float
    doppler_hz: float
    doppler_rate_hz_per_s: float
    cn0_dbhz: float

    def __post_init__(self) -> None:
        require_finite(f"E1 of E{self.svid:02d}", pseudorange_m=self.pseudorange_m)
        require_finite_if_known(
            f"E1 of E{self.svid:02d}", carrier_phase_cycles=self.carrier_phase_cycles, doppler_hz=self.doppler_hz,
            doppler_rate_hz_per_s=self.doppler_rate_hz_per_s, cn0_dbhz=self.cn0_dbhz,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleBatch:
    """A series of consecutive front-end samples.

    Attributes
    ----------
    samples
        complex64[n_samples], without spectral inversion. Samples of a real (IF-sampled) recording have an imaginary
        part of 0.
    center_frequency_hz
        Radio frequency in Hz that is at 0 Hz in the samples.
    first_sample
        Number of the first sample on the counter that both front ends share.
    start
        Time of the first sample on the receiver's clock.
    """

    band: Band
    samples: Complex64[np.ndarray, " n_samples"]
    sample_rate_hz: float
    center_frequency_hz: float
    first_sample: int
    start: GalileoTime

    @property
    def end(self) -> GalileoTime:
        """Time at which the last sample ends, on the receiver's clock."""
        return self.start + self.samples.size / self.sample_rate_hz


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontEndStatus:
    """Status of one front end during one snapshot.

    The power is in dB relative to a fixed reference of the front end.
    """

    agc_gain_db: float
    total_power_db: float
    saturated: bool


@dataclass(frozen=True, kw_only=True)
class ChipSequence:
    """Chips of ±1 that one satellite sends, for example the E6-C chips of a decrypted RECS.

    The class method `of` makes a sequence from an array of +1 and −1.

    Attributes
    ----------
    transmit_time
        Satellite time at which the first chip leaves the satellite.
    n_chips
        Number of chips.
    packed
        The chips as bits (`vestige.records.packed_chips`): logic 0 is +1, logic 1 is −1.
    """

    svid: int
    transmit_time: GalileoTime
    chip_rate_hz: float
    n_chips: int
    packed: UInt32[np.ndarray, " n_words"]

    @classmethod
    def of(
        cls, *, svid: int, transmit_time: GalileoTime, chip_rate_hz: float, chips: Int8[np.ndarray, " n_chips"]
    ) -> ChipSequence:
        """Return a chip sequence from an array of +1 and −1.

        The function raises `ValueError` if a chip is neither +1 nor −1.
        """
        if not np.all(np.abs(chips) == 1):
            raise ValueError("chips must be +1 or -1")
        return cls(
            svid=svid,
            transmit_time=transmit_time,
            chip_rate_hz=chip_rate_hz,
            n_chips=chips.size,
            packed=packed_chips(chips),
        )

    @cached_property
    def chips(self) -> Int8[np.ndarray, " n_chips"]:
        """Chips as an int8 array of +1 and −1."""
        return unpacked_chips(self.packed, self.n_chips)

    @property
    def duration_s(self) -> float:
        """Duration of the chips at the chip rate, in s."""
        return self.n_chips / self.chip_rate_hz


@dataclass(frozen=True, slots=True, kw_only=True)
class Handover:
    """Prediction of the E6 signal from E1: start time, Doppler and Doppler rate [WFO, Sec. II-B].

    Attributes
    ----------
    start_time
        Receiver-clock time at which the first chip is expected in the E6 samples.
    doppler_hz
        Expected carrier Doppler on E6 at `start_time`, in Hz.
    doppler_rate_hz_per_s
        Rate of change of the Doppler in Hz/s.
    """

    svid: int
    chips: ChipSequence
    start_time: GalileoTime
    doppler_hz: float
    doppler_rate_hz_per_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelatorBank:
    """Bank of correlators of one satellite in one snapshot.

    Attributes
    ----------
    offsets_m
        float64[n_taps], offset of each tap from the hand-over's prediction in m; positive is later.
    taps
        complex128[n_taps], correlators at the offsets `offsets_m`.
    noise_power
        Mean of |tap|², in phase and in quadrature together, when the replica is a code that is not in the signal.
    integration_s
        Coherent integration time in s.
    """

    offsets_m: Float[np.ndarray, " n_taps"]
    taps: Complex128[np.ndarray, " n_taps"]
    noise_power: float
    integration_s: float


@runtime_checkable
class SampleSource(Protocol):
    """Source of the samples of one band, which can be read in pieces.

    Sample numbers count on the counter that E1 and E6 share.
    """

    @property
    def first_sample(self) -> int:
        """Number of the first sample."""
        ...

    @property
    def end_sample(self) -> int:
        """Number of the last sample plus 1."""
        ...

    def read(self, first: int, count: int) -> SampleBatch:
        """Return `count` samples from number `first` on; the source must contain all these samples."""
        ...


@runtime_checkable
class Correlatable(Protocol):
    """E6 data that the processor can correlate: samples, or a model of samples."""

    @property
    def received_from(self) -> GalileoTime:
        """Time tag of the beginning of the samples."""

    @property
    def received_until(self) -> GalileoTime:
        """Time tag of the end of the samples."""

    def correlate(self, handover: Handover, offsets_m: Float[np.ndarray, " n_taps"]) -> CorrelatorBank | None:
        """Return the bank of correlators at `offsets_m` around the hand-over; None if E6 does not contain the RECS."""

    @property
    def searched(self) -> SampleSource | None:
        """Samples in which a search looks for a RECS; None if the data are a model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """Data that a receiver gives the processor for all RECS with the same time of transmission.

    Attributes
    ----------
    index
        Running number of the snapshot in its source.
    time
        Receiver-clock time to which the observations refer.
    received_at
        Receiver-clock time at which the last E6 sample of the snapshot was received. `received_at` is never before the
        time tag at the end of the samples. The processor compares `received_at` and the time tags of the correlated
        samples with the disclosure of the key.
    time_uncertainty_s
        Upper limit of the error of the receiver's clock against Galileo System Time, in s; infinite if unknown.
    observations
        E1 observations by SVID, with Doppler and Doppler rate.
    recs
        SVIDs of the satellites whose RECS are in the snapshot, tracked on E1 or not; empty if the source does not name
        these satellites.
    """

    index: int
    time: GalileoTime
    received_at: GalileoTime
    time_uncertainty_s: float
    observations: Mapping[int, E1Observation]
    e6: Correlatable | None
    e1: SampleBatch | None = None
    front_end: Mapping[Band, FrontEndStatus] = field(default_factory=dict)
    recs: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        require_time_uncertainty(self.time_uncertainty_s)
        for svid, one in self.observations.items():
            require_finite(
                f"E1 of E{svid:02d}", doppler_hz=one.doppler_hz, doppler_rate_hz_per_s=one.doppler_rate_hz_per_s
            )
        if self.e6 is not None and self.e6.received_until - self.received_at > _ROUNDING_S:
            raise VestigeError(
                f"snapshot {self.index}: received_at: found {self.received_at}, expected the end of the E6 samples or "
                f"later, {self.e6.received_until}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class EncryptedSegment:
    """A RECS: chips of E6-C, encrypted again under a future OSNMA key.

    Attributes
    ----------
    transmit_time
        Satellite time at which the first chip leaves the satellite; RECS files count this time in deciseconds.
    n_chips
        Number of chips to correlate. The body may have more chips (the padding of the last AES block).
    cipher
        Body of the RECS, which contains the encrypted chips.
    key_time
        Start of the 30 s subframe that transmits the key of the RECS.
    key_delay
        KDI of the file: 0 for the key of the RECS's own subframe, 1 for the key of the next subframe.
    random_offset
        RAND of the file, which is a part of the initialization vector of the cipher.
    """

    svid: int
    transmit_time: GalileoTime
    n_chips: int
    cipher: bytes
    key_time: GalileoTime
    key_delay: int
    random_offset: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedOsnma:
    """Demodulated OSNMA of one satellite and subframe, without validation, for comparisons only."""

    svid: int | None  # None for a file of keys, which names no satellite
    time: GalileoTime  # start of the subframe (GST_SF)
    fields: tuple[bytes | None, ...] = ()  # 15 fields of 5 bytes; None if the page is lost, is a dummy, or has no OSNMA
    key: bytes | None = None  # key of the subframe; None if no chain gives the position of the key


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupDelay:
    """Broadcast group delay BGD(E1,E6) of one satellite in s, in the definition of [OS-ICD, 5.1.5]."""

    svid: int
    bgd_e1_e6_s: float
    valid_from: GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class Assistance:
    """Data that the processor gets in addition to snapshots.

    Attributes
    ----------
    hardware_bias_e1_e6_s
        Calibrated delay of the E6 front end minus that of E1 (E6 − E1), in s; positive if E6 arrives later.
    ionosphere_e1_m
        Predicted slant ionospheric delay on E1 by SVID, in m; a missing satellite means no prediction (0).
    """

    segments: tuple[EncryptedSegment, ...] = ()  # RECS in order of transmission
    group_delays: tuple[GroupDelay, ...] = ()
    keys: tuple[ValidatedKey, ...] = ()
    received: tuple[ReceivedOsnma, ...] = ()  # valid and invalid OSNMA in order of time
    hardware_bias_e1_e6_s: float = 0.0
    ionosphere_e1_m: Mapping[int, float] = field(default_factory=dict)

    def recs_of(self, snapshots: SnapshotBlock) -> RecsLookup:
        """Return the RECS that the satellites of a block sent, each with its key if the key is known."""
        from vestige.records.recs_block import find_recs  # noqa: PLC0415  (`recs_block` needs this module)

        return find_recs(snapshots, self)
