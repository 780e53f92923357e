"""Measure a block of snapshots, each epoch independently of all other epochs [WFO, Sec. II-B, III].

The steps for one satellite and epoch are

    RECS of this epoch → key validated and not yet disclosed when the samples were taken → chips
    → hand-over from E1 → bank of correlators → threshold → detector → range offset

The measurement stops at the first impossible step, which `Availability` names. Recorded and simulated snapshots are
measured in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.acas_processor.detectors import Detector
from vestige.acas_processor.measurement import (
    Availability,
    DetectedBlock,
    MeasurementBlock,
    spread_over_block,
)
from vestige.acas_processor.position.fix_measurement import LazyFix
from vestige.acas_processor.searches.handover import assisted_delay_m, hand_over, predicted_phase_rad, reception_s
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.osnma.disclosure import provably_before_disclosure
from vestige.crypto.recs.recs_segment import decrypt
from vestige.records import Handover
from vestige.records.recs_block import AssistanceData, RecsBlock, RecsLookup
from vestige.records.snapshot_block import BankBlock, SnapshotBlock
from vestige.theory.range_offset import range_offset_m
from vestige.theory.thresholds import probability_of_detection

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor

# C/N0 is rounded before P_d is computed, because to compute P_d for every value would take most of the computing time.
# An estimate of C/N0 is accurate to 0.1 dB only.
_CN0_DECIMALS = 2


def measure(processor: AcasProcessor, snapshots: SnapshotBlock, assistance: AssistanceData) -> MeasurementBlock:
    """Return the measurements of all epochs and satellites of a block."""
    lookup = assistance.recs_of(snapshots)
    availability = _before_samples(snapshots, lookup.block)
    asked = availability == Availability.CORRELATED
    handovers = _DecryptedHandovers(processor, snapshots, assistance, lookup)
    banks = _banks(processor, snapshots, asked, handovers)
    availability[asked & np.isnan(banks.noise_power)] = Availability.OUTSIDE
    availability[handovers.too_late] = Availability.NOT_PROVEN
    availability[asked & (banks.noise_power <= 0)] = Availability.ZERO
    correlated = availability == Availability.CORRELATED
    expected_dbhz = snapshots.e1.cn0_dbhz + processor.e6_over_e1_db
    # in a model of E6 without hand-over, the RECS is sent at the time of the snapshot
    after_s = np.where(np.isnan(handovers.expected_s), reception_s(snapshots.e1), handovers.expected_s)
    phase_rad = np.where(correlated, predicted_phase_rad(snapshots.e1, after_s), np.nan)
    return MeasurementBlock(
        snapshots=snapshots,
        recs=lookup.block,
        availability=availability,
        banks=banks,
        detected=detect(processor, banks, correlated),
        predicted_pd=_predicted_pd(expected_dbhz, correlated, banks.integration_s, processor.p_fa),
        expected_s=handovers.expected_s,
        doppler_e6_hz=handovers.doppler_e6_hz,
        predicted_phase_rad=phase_rad,
        extrapolated_s=np.where(np.isnan(phase_rad), np.nan, after_s),
        fixes=LazyFix(settings=processor.monitoring.fix, time=snapshots.time, svids=snapshots.svids, e1=snapshots.e1),
    )


def detect(processor: AcasProcessor, banks: BankBlock, correlated: Bool[np.ndarray, "n m"]) -> DetectedBlock:
    """Return the result of the processor's detector for banks of correlators."""
    limit = processor.detection_threshold
    found = detect_block(
        banks.taps[correlated],
        banks.noise_power[correlated],
        banks.offsets_m,
        detector=processor.detector,
        threshold_sigma=limit,
    )
    shape = correlated.shape
    return DetectedBlock(
        tap=spread_over_block(found.tap, correlated, shape, -1),
        magnitude_sigma=spread_over_block(found.magnitude_sigma, correlated, shape),
        phase_rad=spread_over_block(found.phase_rad, correlated, shape),
        range_offset_m=spread_over_block(found.range_offset_m, correlated, shape),
        threshold_sigma=limit,
    )


def exceeds_threshold(processor: AcasProcessor, banks: BankBlock) -> Bool[np.ndarray, "n m n_taps"]:
    """Return for each correlator whether its magnitude exceeds the detection threshold; False for NaN."""
    return normalised_magnitudes(banks.taps, banks.noise_power) > processor.detection_threshold


def normalised_magnitudes(
    taps: Complex128[np.ndarray, "*n n_taps"], noise_power: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n n_taps"]:
    """Return the magnitudes of correlators in standard deviations of the noise per dimension."""
    return np.abs(taps) / np.sqrt(noise_power / 2)[..., None]


def detect_block(
    taps: Complex128[np.ndarray, "n_epochs n_taps"],
    noise_power: Float[np.ndarray, " n_epochs"],
    offsets_m: Float[np.ndarray, " n_taps"],
    *,
    detector: Detector,
    threshold_sigma: float,
) -> DetectedBlock:
    """Return the result of `detector` for banks of correlators.

    `noise_power` is the mean of |tap|² of the noise, in I and Q together. The threshold is in standard deviations of
    the noise per dimension.
    """
    magnitudes = normalised_magnitudes(taps, noise_power)
    tap = detector.detect(magnitudes, threshold_sigma)
    found = tap >= 0
    rows, columns = np.arange(tap.size), np.where(found, tap, 0)
    return DetectedBlock(
        tap=tap,
        magnitude_sigma=np.where(found, magnitudes[rows, columns], np.nan),
        phase_rad=np.where(found, np.angle(taps[rows, columns]), np.nan),
        range_offset_m=range_offset_m(magnitudes, tap, detector.spacing, offsets_m),
        threshold_sigma=threshold_sigma,
    )


def _before_samples(snapshots: SnapshotBlock, recs: RecsBlock) -> np.ndarray:
    """Return the `Availability` of each satellite at each epoch that is known before samples are correlated."""
    lead_s = recs.disclosed - snapshots.received_at
    secret = provably_before_disclosure(lead_s, snapshots.time_uncertainty_s[:, None])
    availability = np.full(snapshots.asked.shape, Availability.CORRELATED, np.int8)
    if snapshots.e6 is None:
        availability[:] = Availability.NO_SAMPLES
    availability[~secret] = Availability.NOT_PROVEN
    availability[~recs.with_key] = Availability.NO_KEY
    availability[~recs.found] = Availability.NO_RECS
    availability[~snapshots.e1.seen] = Availability.NOT_SEEN
    return availability


def _banks(
    processor: AcasProcessor, snapshots: SnapshotBlock, asked: Bool[np.ndarray, "n m"], handovers: _DecryptedHandovers
) -> BankBlock:
    if snapshots.e6 is not None:
        return snapshots.e6.correlate(asked, handovers, processor.offsets_m)
    noise_power, integration_s = np.full((2, *asked.shape), np.nan)
    taps = np.full((*asked.shape, processor.offsets_m.size), np.nan + 0j)
    return BankBlock(offsets_m=processor.offsets_m, taps=taps, noise_power=noise_power, integration_s=integration_s)


def _predicted_pd(
    expected_dbhz: Float[np.ndarray, "n m"],
    correlated: Bool[np.ndarray, "n m"],
    integration_s: Float[np.ndarray, "n m"],
    p_fa: float,
) -> Float[np.ndarray, "n m"]:
    known = correlated & ~np.isnan(expected_dbhz)
    predicted = np.full(known.shape, np.nan)
    if known.any():
        for length_s in np.unique(integration_s[known]).tolist():
            here = known & (integration_s == length_s)
            levels, place = np.unique(np.round(expected_dbhz[here], _CN0_DECIMALS), return_inverse=True)
            predicted[here] = probability_of_detection(levels, length_s, p_fa)[place]
    return predicted


@dataclass(slots=True, eq=False)
class _DecryptedHandovers:
    """Hand-overs of a block; the chips of a RECS are decrypted only when the hand-over is requested."""

    processor: AcasProcessor
    snapshots: SnapshotBlock
    assistance: AssistanceData
    lookup: RecsLookup
    expected_s: np.ndarray = None  # type: ignore[assignment]

    doppler_e6_hz: np.ndarray = None  # type: ignore[assignment]
    too_late: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        self.expected_s, self.doppler_e6_hz = np.full((2, *self.snapshots.asked.shape), np.nan)
        self.too_late = np.zeros(self.snapshots.asked.shape, np.bool_)

    def at(self, epoch: int, satellite: int) -> Handover | None:
        """Return the hand-over of one satellite at one epoch, with the decrypted chips.

        The hand-over is None if its window of samples does not end provably before the disclosure of the key. The time
        at which the source claims to have received the samples does not matter for this test.
        """
        segment, key = self.lookup.segment(epoch, satellite)
        time = self.snapshots.time.at(epoch)
        processor = self.processor
        delay_m = assisted_delay_m(self.assistance, segment.svid, time, processor.group_delay_convention)
        chips = decrypt(segment, key, mode=processor.cipher_mode)
        observation = self.snapshots.e1.observation(segment.svid, epoch, satellite)
        handover = hand_over(observation, time, chips, delay_m=delay_m)
        self.expected_s[epoch, satellite] = handover.start_time - time
        self.doppler_e6_hz[epoch, satellite] = handover.doppler_hz
        duration_s = chips.duration_s
        end = handover.start_time + (duration_s + processor.late_reach_m / SPEED_OF_LIGHT_MPS)
        uncertainty_s = float(self.snapshots.time_uncertainty_s[epoch])
        if not provably_before_disclosure(key.disclosed_at - end, uncertainty_s):
            self.too_late[epoch, satellite] = True
            return None
        return handover
