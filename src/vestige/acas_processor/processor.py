"""Turn snapshots and their assistance into verdicts: the ACAS processor [WFO, Sec. II-B, III, IV].

The processor works on blocks of n epochs × m satellites. One snapshot is a block of one epoch. `measure` correlates E6
and has no state, so blocks can be measured in any order on any number of workers. `assess` makes the searches and the
checks, and carries a state from block to block. The division of epochs into blocks changes no bit of the verdicts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, floor

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.assess import assess
from vestige.acas_processor.checks.e1_e6_range import KAPPA
from vestige.acas_processor.checks.power.e6_misses import MissPrediction
from vestige.acas_processor.checks.power.e6_power import MIN_PD
from vestige.acas_processor.detectors import Detector, EarlyDetector
from vestige.acas_processor.levels import LEVELS, OPTIONAL, STEADY_P_FA, CheckSpec
from vestige.acas_processor.measure import detect, exceeds_threshold, measure
from vestige.acas_processor.measurement import DetectedBlock, MeasurementBlock
from vestige.acas_processor.monitoring.alarm import StateChange
from vestige.acas_processor.monitoring.alarm_budget import budget_of, set_kappa
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings, set_shares
from vestige.acas_processor.monitoring.state import ReceiverState
from vestige.acas_processor.own_check import OwnCheck
from vestige.acas_processor.position.authentic_position import AuthenticPosition, authentic_positions
from vestige.acas_processor.position.error_budget import ErrorBudget
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.constants import NOMINAL_E6_OVER_E1_DB, SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.group_delay import OS_ICD_CONVENTION, GroupDelayConvention
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.records import Verdict
from vestige.records.checks import AlarmShare, CheckName
from vestige.records.recs_block import AssistanceData
from vestige.records.snapshot_block import BankBlock, SnapshotBlock
from vestige.sample_processor.correlator_kernel import REACH_CHIPS
from vestige.signals.definitions import E6C
from vestige.source import Source
from vestige.theory.thresholds import threshold

EARLY_REACH_M = 600.0  # more than the 2 chips of E1 (586 m) that the search on E1 omits around the tracked signal


@dataclass(frozen=True, kw_only=True)
class Step:
    """The processor's answer to one block of snapshots: verdicts, positions, and the state for the next block."""

    block: VerdictBlock  # verdicts of every epoch and satellite, as arrays
    state: ReceiverState  # state for the next block

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts of all satellites that E1 tracks or tracked within the last hour."""
        return tuple(self.block.verdicts())

    @cached_property
    def changes(self) -> tuple[StateChange, ...]:
        """Changes of the state that a receiver shows its user."""
        return tuple(self.block.changes())

    @cached_property
    def positions(self) -> tuple[AuthenticPosition, ...]:
        """Positions of the block from ranges in use."""
        return tuple(authentic_positions(self.block))

    @property
    def unseen(self) -> frozenset[int]:
        """Satellites that need a verdict, but were not tracked on E1 in at least one epoch of the block."""
        snapshots = self.block.measured.snapshots
        missing = np.any(snapshots.asked & ~snapshots.e1.seen, axis=0)
        return frozenset(svid for svid, one in zip(snapshots.svids, missing.tolist(), strict=True) if one)


@dataclass(frozen=True, slots=True, kw_only=True)
class AcasProcessor:
    """Turn the snapshots of a receiver into verdicts by ACAS; the attributes are the settings of the processor.

    Attributes
    ----------
    level
        Mitigation level [WFO, Sec. IV].
    detector
        Detector that chooses the correlator of the signal [WFO, Sec. III-A, III-B].
    p_fa
        Single-event false-alarm probability of the E6 detection, per correlator.
    n_taps, tap_spacing_m
        Part of the bank that is symmetric about the predicted range: number of correlators, and distance between
        neighbours in m. Further correlators follow on the early side up to `early_reach_m`.
    early_reach_m
        Distance in m by which the bank extends before the prediction, with the spacing `tap_spacing_m`. The window of
        the correlator limits the whole bank to 820 m, so with 75 m on the late side this distance is at most 735 m. If
        a meaconer with a short delay captures E1, the true E6 signal is earlier than E1 predicts. The search for a
        second signal on E1 omits 2 chips, 586 m, around the tracked signal, so the bank has to cover this distance.
    budget, kappa
        Error budget of the range check, and its factor κ: the check passes if |range offset| ≤ κσ. If
        `monitoring.alarms_per_day` is set, `range_kappa` replaces κ.
    min_pd
        Smallest predicted probability of detection at which a missing signal is an alarm [WFO, Sec. III-A, step 5].
    e6_over_e1_db
        Expected C/N0 of E6-C minus the C/N0 of E1-C in dB, from the signals, the antenna and the front ends.
    cipher_mode, group_delay_convention
        Cipher mode of the RECS, and convention of the group delays. The service does not publish mode and convention.
    monitoring
        Settings of the false-alarm budget, of the checks that levels 2 and 3 add, and of the optional checks.
    own_checks
        Checks that a user wrote; a check is made at its own `level` and at higher levels.

    Raises
    ------
    ValueError
        If the level does not exist, the bank is too short for the detector or too long for the correlator, or two own
        checks have the same name.
    VestigeError
        If `monitoring.alarms_per_day` is too small for the checks of the level.

    Examples
    --------
    >>> import vestige as vs
    >>> processor = vs.AcasProcessor(level=1, detector=vs.EarlyDetector(spacing=1), p_fa=1e-7)
    >>> round(processor.detection_threshold, 3), round(processor.range_limit_m, 1)
    (5.678, 26.6)
    >>> source = vs.simulate(vs.load_scenario("scenarios/quick.toml", ["epochs=2", "receiver.cn0_dbhz=45"]))
    >>> [verdict.status.name for verdict in processor.run(source)]
    ['AUTHENTIC', 'AUTHENTIC']
    """

    level: int = 1
    detector: Detector = field(default_factory=EarlyDetector)
    p_fa: float = 1e-7
    n_taps: int = 11
    tap_spacing_m: float = 15.0
    early_reach_m: float = EARLY_REACH_M
    budget: ErrorBudget = field(default_factory=ErrorBudget.uncorrected)
    kappa: float = KAPPA
    min_pd: float = MIN_PD
    e6_over_e1_db: float = NOMINAL_E6_OVER_E1_DB
    cipher_mode: CipherMode = CipherMode.CBC
    group_delay_convention: GroupDelayConvention = OS_ICD_CONVENTION
    monitoring: MonitoringSettings = field(default_factory=MonitoringSettings)
    own_checks: tuple[OwnCheck, ...] = ()

    def __post_init__(self) -> None:
        if self.level not in LEVELS:
            raise ValueError(f"mitigation level {self.level} is not one of {sorted(LEVELS)}")
        if self.n_taps < 2 * self.detector.spacing + 1:
            raise ValueError(f"{self.n_taps} correlators are too few for a spacing of {self.detector.spacing}")
        reach_m, limit_m = float(np.ptp(self.offsets_m)) / 2, REACH_CHIPS * SPEED_OF_LIGHT_MPS / E6C.chip_rate_hz
        if reach_m > limit_m:
            raise ValueError(
                f"the bank of correlators reaches {reach_m:g} m from its middle, more than the limit of {limit_m:.0f} m"
            )
        names = [one.spec.name for one in self.own_checks]
        if len(set(names)) < len(names):
            raise ValueError(f"the names of checks must differ, found {', '.join(names)}")
        if self.monitoring.alarms_per_day is not None:
            set_shares(self)  # raises VestigeError if the number of alarms a day is too small

    @property
    def own_of_level(self) -> tuple[OwnCheck, ...]:
        """Checks of the level that a user wrote."""
        return tuple(one for one in self.own_checks if one.level <= self.level)

    @property
    def optional(self) -> tuple[CheckSpec, ...]:
        """Optional checks that are turned on."""
        return tuple(spec for spec in OPTIONAL if spec.make is not None and spec.make(self, STEADY_P_FA) is not None)

    @property
    def added_checks(self) -> tuple[CheckSpec, ...]:
        """Checks in addition to the level's checks: the optional checks, then the user's checks."""
        return (*self.optional, *(one.spec for one in self.own_of_level))

    @property
    def specs(self) -> tuple[CheckSpec, ...]:
        """Table rows of all checks of the level; the user's checks are last."""
        rows = LEVELS[self.level]
        if self.monitoring.alarms_per_day is not None:
            shares = set_shares(self)
            rows = tuple(replace(row, confirm=shares[row.name].confirm) for row in rows)
        return (*rows, *self.added_checks)

    @property
    def bank_p_fa(self) -> float:
        """Upper limit of the probability that noise exceeds the detection threshold in any correlator of the bank."""
        return self.p_fa * self.offsets_m.size

    @property
    def range_kappa(self) -> float:
        """Factor κ of the range check: the setting `kappa`, or the value that follows from the false alarms a day."""
        if self.monitoring.alarms_per_day is None:
            return self.kappa
        return set_kappa(set_shares(self)[CheckName.E1_E6_RANGE], self.bank_p_fa)

    @property
    def range_limit_m(self) -> float:
        """Largest range offset that passes the range check: κσ in m."""
        return self.budget.limit_m(self.range_kappa)

    @property
    def miss_prediction(self) -> MissPrediction:
        """Prediction of the probability that the receiver misses E6 without an attack."""
        return MissPrediction(
            min_pd=self.min_pd,
            detection_p_fa=self.p_fa,
            ray_power_db=self.monitoring.second_signal.ray_power_db,
            e6_over_e1_db=self.e6_over_e1_db,
        )

    @property
    def offsets_m(self) -> Float[np.ndarray, " n_taps"]:
        """Offsets of the correlators from the prediction in m, early to late."""
        possible_m = (2 * REACH_CHIPS - 2) * SPEED_OF_LIGHT_MPS / E6C.chip_rate_hz - 2 * self.late_reach_m
        wanted = ceil((self.early_reach_m - self.late_reach_m) / self.tap_spacing_m - 1e-9)
        further = max(0, min(wanted, floor(possible_m / self.tap_spacing_m)))
        return (np.arange(-further, self.n_taps) - (self.n_taps - 1) / 2) * self.tap_spacing_m

    @property
    def late_reach_m(self) -> float:
        """Offset of the last correlator from the prediction in m."""
        return (self.n_taps - 1) / 2 * self.tap_spacing_m

    @property
    def detection_threshold(self) -> float:
        """Threshold of the E6 detection in standard deviations of the noise per dimension."""
        return float(threshold(self.p_fa))

    @property
    def limits(self) -> str:
        """The level with its thresholds and limits, in one line."""
        kind = getattr(self.detector, "kind", type(self.detector).__name__)
        return (
            f"level {self.level}; E6 is detected above {self.detection_threshold:.3f} σ (P_fa {self.p_fa:g}) in one of "
            f"{self.offsets_m.size} correlators, {self.offsets_m[0]:+g} to {self.offsets_m[-1]:+g} m; "
            f"detector {kind}; E6-E1 range within ±{self.range_limit_m:.1f} m"
        )

    def run(self, source: Source) -> Iterator[Verdict]:
        """Yield the verdicts of every snapshot of a source, in the order of time.

        Parameters
        ----------
        source
            Recording (`RecordingSource`) or simulation (`simulate`), with its assistance.

        Yields
        ------
        Verdict
            Verdict of one satellite and one snapshot.
        """
        for step in self.steps(source, assistance=source.assistance):
            yield from step.verdicts

    def steps(
        self, blocks: Iterable[SnapshotBlock], *, assistance: AssistanceData, state: ReceiverState | None = None
    ) -> Iterator[Step]:
        """Yield the processor's answer to each block; `state` is the final state of an earlier run, or None."""
        for block in blocks:
            step = self.step(state, block, assistance)
            state = step.state
            yield step

    def step(self, state: ReceiverState | None, block: SnapshotBlock, assistance: AssistanceData) -> Step:
        """Return the answer to a block; `state` is the state after the previous block, or None for the first block."""
        verdicts, after = self.assess(state, self.measure(block, assistance), assistance)
        return Step(block=verdicts, state=after)

    def measure(self, block: SnapshotBlock, assistance: AssistanceData) -> MeasurementBlock:
        """Return the measurements of a block, which do not depend on other blocks."""
        return measure(self, block, assistance)

    def detect(self, banks: BankBlock, correlated: Bool[np.ndarray, "n m"]) -> DetectedBlock:
        """Return the result of the detector for banks; `correlated` is True for banks that contain correlators."""
        return detect(self, banks, correlated)

    def exceeds_threshold(self, banks: BankBlock) -> Bool[np.ndarray, "n m n_taps"]:
        """Return for each correlator whether its magnitude exceeds the detection threshold; False for NaN."""
        return exceeds_threshold(self, banks)

    def false_alarm_budget(self, block: VerdictBlock) -> Mapping[CheckName | str, AlarmShare]:
        """Return the share of each check in the false alarms of the level; `block` gives the C/N0 of the satellites."""
        return budget_of(self, block)

    def assess(
        self, state: ReceiverState | None, measured: MeasurementBlock, assistance: AssistanceData
    ) -> tuple[VerdictBlock, ReceiverState]:
        """Return the verdicts of a measured block, and the state after the block."""
        return assess(self, state, measured, assistance)
