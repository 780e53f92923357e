"""The ACAS processor: from a snapshot and its assistance to verdicts [WFO, Sec. II-B, III].

`measure` is heavy and pure: one snapshot in, one measurement out, so snapshots can be measured in any order on any
number of workers. `decide` is light; at level 1 it needs nothing else. `step` goes with a state from snapshot to
snapshot, which is what levels 2 and 3 are about (`watch.py`). For one satellite `measure` goes

    segment of this epoch → validated key → chips → hand-over from E1
    → *the window that is correlated ends provably before the key's disclosure*
    → bank of correlators → threshold → detector → range offset

and stops at the first step that is impossible, with the reason. Nothing here knows where the snapshot came from.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.alarm import StateChange
from vestige.acas_processor.authentic_position import AuthenticPosition, authentic_position
from vestige.acas_processor.detection_block import detect_block
from vestige.acas_processor.detectors import Detector, EarlyDetector
from vestige.acas_processor.error_budget import ErrorBudget
from vestige.acas_processor.handover import NOMINAL_E6_OVER_E1_DB, assisted_delay_m, hand_over
from vestige.acas_processor.minimum_defence import Limits
from vestige.acas_processor.mitigation import ALARMS, LEVELS, decide
from vestige.acas_processor.monitors.vestigial_search import TimeUncertainty
from vestige.acas_processor.thresholds import probability_of_detection, threshold
from vestige.acas_processor.watch import Watch, WatchState
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.disclosure import provably_before_disclosure
from vestige.crypto.group_delay import OS_ICD_CONVENTION, GroupDelayConvention
from vestige.crypto.recs import CipherMode, decrypt
from vestige.measurement import Detection, Measurement, SatelliteMeasurement
from vestige.records import Assistance, CorrelatorBank, E1Observation, EncryptedSegment, Handover, Snapshot, Verdict
from vestige.source import Source
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite
from vestige.validated_key import ValidatedKey

NOT_SEEN = "not seen on E1"
SEGMENT_WINDOW_S = 0.5  # a snapshot belongs to the RECS that reaches it within this time


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """What follows from one snapshot.

    Attributes
    ----------
    measurement
        Steps 1 and 2, before any decision.
    verdicts
        One for each satellite that E1 shows, and for each that it showed in the last hour and does not now.
    unseen
        Satellites of the RECS that E1 does not show, ever seen or not.
    changes
        Satellites of which something else is shown than before.
    position
        The one that the snapshot authenticates; None without orbits or with too few ranges.
    state
        What the next snapshot needs.
    """

    measurement: Measurement
    verdicts: tuple[Verdict, ...]
    unseen: frozenset[int]
    changes: tuple[StateChange, ...]
    position: AuthenticPosition | None
    state: WatchState


@dataclass(frozen=True, slots=True, kw_only=True)
class AcasProcessor:
    """The receiver's ACAS processing with all its settings.

    Attributes
    ----------
    level
        Mitigation level [WFO, Sec. IV].
    detector
        Which correlator is taken as the signal [WFO, Sec. III-A, III-B].
    p_fa
        Single-event false-alarm probability of the E6 detection, per correlator.
    n_taps, tap_spacing_m
        The bank: so many correlators, so far apart, around the hand-over's prediction.
    budget, kappa
        Error budget of E6 − E1 and its factor: the range check is |offset| ≤ κσ.
    min_pd
        Below this predicted probability of detection a missing signal is no alarm [WFO, Sec. III-A, step 5].
    e6_over_e1_db
        Expected C/N0 of E6-C over E1-C, from the signals, the antenna and the front ends.
    cipher_mode, group_delay_convention
        The two points on which the service's interface is not public.
    watch
        Settings of the checks that levels 2 and 3 add.
    """

    level: int = 1
    detector: Detector = field(default_factory=EarlyDetector)
    p_fa: float = 1e-7
    n_taps: int = 11
    tap_spacing_m: float = 15.0
    budget: ErrorBudget = field(default_factory=ErrorBudget.uncorrected)
    kappa: float = 3.0
    min_pd: float = 0.9
    e6_over_e1_db: float = NOMINAL_E6_OVER_E1_DB
    cipher_mode: CipherMode = CipherMode.CBC
    group_delay_convention: GroupDelayConvention = OS_ICD_CONVENTION
    watch: Watch = field(default_factory=Watch)

    def __post_init__(self) -> None:
        if self.level not in LEVELS:
            raise ValueError(f"mitigation level {self.level} is not one of {sorted(LEVELS)}")
        if self.n_taps < 2 * self.detector.spacing + 1:
            raise ValueError(f"{self.n_taps} correlators are too few for a spacing of {self.detector.spacing}")

    @property
    def offsets_m(self) -> Float[np.ndarray, " n_taps"]:
        """Offsets of the correlators from the prediction in m."""
        return (np.arange(self.n_taps) - (self.n_taps - 1) / 2) * self.tap_spacing_m

    def run(self, source: Source) -> Iterator[Verdict]:
        """Yield the verdicts of every snapshot of a source."""
        for step in self.steps(source, assistance=source.assistance):
            yield from step.verdicts

    def steps(
        self, snapshots: Iterable[Snapshot], *, assistance: Assistance, state: WatchState | None = None
    ) -> Iterator[Step]:
        """Yield what follows from each snapshot; `state` is that of an earlier run, if there was one."""
        for snapshot in snapshots:
            step = self.step(state, snapshot, assistance)
            state = step.state
            yield step

    def step(self, state: WatchState | None, snapshot: Snapshot, assistance: Assistance) -> Step:
        """Return what follows from one snapshot; `state` is that of the snapshot before, None at first.

        Only the RECS of its own time count, not those before and after it, which have snapshots of their own. So the
        verdicts are the same whether the RECS to come are known or not.
        """
        if state is None:
            state = WatchState(uncertainty=TimeUncertainty(initial_s=snapshot.time_uncertainty_s))
        assistance = replace(assistance, segments=_segments_of(assistance, snapshot))
        measurement = self.measure(snapshot, assistance)
        lost = tuple(SatelliteMeasurement(svid=svid, unavailable=NOT_SEEN) for svid in state.lost(snapshot))
        failed = any(verdict.status in ALARMS for verdict in self.decide(measurement))
        state, further = self.watch.step(self.level, state, snapshot, measurement, assistance, failed=failed)
        verdicts = decide(measurement, self.level, self.limits, further.checks, further.true_offset_m)
        verdicts += decide(replace(measurement, satellites=lost), self.level, self.limits)
        verdicts = tuple(sorted(verdicts, key=lambda verdict: verdict.svid))
        state, changes = self.watch.learn(state, snapshot, measurement, verdicts)
        position = authentic_position(self.watch.fix, snapshot.time, snapshot.observations, verdicts, state.alarm.shown)
        return Step(
            measurement=replace(measurement, satellites=(*measurement.satellites, *lost)),
            verdicts=verdicts,
            unseen=snapshot.unseen,
            changes=changes,
            position=position,
            state=state,
        )

    @property
    def limits(self) -> Limits:
        """Thresholds of steps 1 and 2."""
        return Limits(budget=self.budget, kappa=self.kappa, min_pd=self.min_pd)

    def decide(self, measurement: Measurement) -> tuple[Verdict, ...]:
        """Return one verdict for each satellite of a measurement, from steps 1 and 2 alone."""
        return decide(measurement, 1, self.limits)

    def measure(self, snapshot: Snapshot, assistance: Assistance) -> Measurement:
        """Return what can be measured of every satellite that E1 observes."""
        satellites = tuple(
            self._measure_satellite(snapshot, assistance, snapshot.observations[svid])
            for svid in sorted(snapshot.observations)
        )
        return Measurement(
            index=snapshot.index,
            time=snapshot.time,
            satellites=satellites,
            observations=snapshot.observations,
            front_end=snapshot.front_end,
        )

    def _measure_satellite(  # noqa: PLR0911  (each return is a step that was not reached)
        self, snapshot: Snapshot, assistance: Assistance, observation: E1Observation
    ) -> SatelliteMeasurement:
        svid = observation.svid
        segment = _segment_at(assistance, svid, snapshot.time + -observation.pseudorange_m / SPEED_OF_LIGHT_MPS)
        if segment is None:
            return SatelliteMeasurement(svid=svid, unavailable="no RECS of this satellite for this time")
        key = _key_at(assistance, segment.key_time)
        if key is None:
            return SatelliteMeasurement(svid=svid, unavailable=f"no validated OSNMA key of {segment.key_time}")
        delay_m = assisted_delay_m(assistance, svid, snapshot.time, self.group_delay_convention)
        chips = decrypt(segment, key, mode=self.cipher_mode)
        handover = hand_over(observation, snapshot.time, chips, delay_m=delay_m, e6_over_e1_db=self.e6_over_e1_db)
        received_until = max(snapshot.received_at, _window_end(handover, self.offsets_m))
        if not provably_before_disclosure(key.disclosed_at - received_until, snapshot.time_uncertainty_s):
            reason = _not_provable(received_until, snapshot.time_uncertainty_s, key)
            return SatelliteMeasurement(svid=svid, unavailable=reason)
        if snapshot.e6 is None:
            return SatelliteMeasurement(svid=svid, unavailable="no E6 samples", available_at=key.complete_at)

        bank = snapshot.e6.correlate(handover, self.offsets_m)
        if bank is None:
            reason = f"the E6 samples do not hold the RECS expected at {handover.start_time}"
            return SatelliteMeasurement(svid=svid, handover=handover, unavailable=reason, available_at=key.complete_at)
        require_finite(f"E6 of E{svid:02d}", taps=float(np.abs(bank.taps).sum()), noise_power=bank.noise_power)
        if not bank.noise_power > 0:
            reason = "the E6 samples are all zero"
            return SatelliteMeasurement(svid=svid, handover=handover, unavailable=reason, available_at=key.complete_at)
        return SatelliteMeasurement(
            svid=svid,
            handover=handover,
            bank=bank,
            detection=self.detect(bank),
            predicted_pd=float(probability_of_detection(handover.expected_cn0_dbhz, bank.integration_s, self.p_fa)),
            available_at=key.complete_at,
        )

    def detect(self, bank: CorrelatorBank) -> Detection | None:
        """Return the detected signal of one bank, or None."""
        limit = float(threshold(self.p_fa))
        block = detect_block(
            bank.taps[None, :],
            np.array([bank.noise_power]),
            bank.offsets_m,
            detector=self.detector,
            threshold_sigma=limit,
        )
        if block.tap[0] < 0:
            return None
        return Detection(
            tap=int(block.tap[0]),
            magnitude=float(block.magnitude_sigma[0]),
            phase_rad=float(block.phase_rad[0]),
            threshold=limit,
            range_offset_m=float(block.range_offset_m[0]),
        )


def _segments_of(assistance: Assistance, snapshot: Snapshot) -> tuple[EncryptedSegment, ...]:
    """Return the RECS that the satellites of a snapshot sent at its time, within `SEGMENT_WINDOW_S`."""
    sent = [snapshot.time + -one.pseudorange_m / SPEED_OF_LIGHT_MPS for one in snapshot.observations.values()]
    return segments_between(assistance, min(sent), max(sent)) if sent else ()


def segments_between(assistance: Assistance, first: GalileoTime, last: GalileoTime) -> tuple[EncryptedSegment, ...]:
    """Return the RECS that are sent from the first to the last time, give or take `SEGMENT_WINDOW_S`."""
    segments = assistance.segments
    low = bisect_left(segments, first + -SEGMENT_WINDOW_S, key=lambda segment: segment.transmit_time)
    high = bisect_right(segments, last + SEGMENT_WINDOW_S, key=lambda segment: segment.transmit_time)
    return segments[low:high]


def _segment_at(assistance: Assistance, svid: int, transmit_time: GalileoTime) -> EncryptedSegment | None:
    """Return the satellite's RECS that is sent nearest to a time, within `SEGMENT_WINDOW_S`."""
    own = [one for one in segments_between(assistance, transmit_time, transmit_time) if one.svid == svid]
    return min(own, key=lambda segment: abs(segment.transmit_time - transmit_time), default=None)


def _window_end(handover: Handover, offsets_m: Float[np.ndarray, " n_taps"]) -> GalileoTime:
    """Return the time label at which the latest correlator of a bank ends."""
    duration_s = handover.chips.chips.size / handover.chips.chip_rate_hz
    return handover.start_time + (duration_s + float(offsets_m[-1]) / SPEED_OF_LIGHT_MPS)


def _not_provable(received_until: GalileoTime, time_uncertainty_s: float, key: ValidatedKey) -> str:
    """Return why samples are not provably from before their key's disclosure."""
    if math.isinf(time_uncertainty_s):
        return (
            "not provably received before the key's disclosure: the bound on the receiver clock's error is not known "
            "(time_uncertainty_s)"
        )
    return (
        f"not provably received before the key's disclosure: samples until {received_until} "
        f"± {time_uncertainty_s:g} s, key on air from {key.disclosed_at}"
    )


def _key_at(assistance: Assistance, time: GalileoTime) -> ValidatedKey | None:
    return next((key for key in assistance.keys if key.time == time), None)
