"""Detection on arrays with a leading epoch axis: one snapshot and a block of a thousand are the same code."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex128, Float, Int

from vestige.acas_processor.detectors import Detector
from vestige.theory.range_offset import range_offset_m


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionBlock:
    """What a detector says of a block of correlator banks."""

    tap: Int[np.ndarray, " n_epochs"]  # index of the punctual correlator, −1 where nothing was detected
    # its magnitude in standard deviations of the noise per dimension, and its phase; NaN where nothing was detected
    magnitude_sigma: Float[np.ndarray, " n_epochs"]
    phase_rad: Float[np.ndarray, " n_epochs"]
    # measured minus predicted range in m; NaN where nothing was detected
    range_offset_m: Float[np.ndarray, " n_epochs"]


def detect_block(
    taps: Complex128[np.ndarray, "n_epochs n_taps"],
    noise_power: Float[np.ndarray, " n_epochs"],
    offsets_m: Float[np.ndarray, " n_taps"],
    *,
    detector: Detector,
    threshold_sigma: float,
) -> DetectionBlock:
    """Return what `detector` finds in every bank of a block.

    `noise_power` is the mean of |tap|² of noise, both dimensions together; the threshold is in standard deviations per
    dimension.
    """
    magnitudes = np.abs(taps) / np.sqrt(noise_power / 2)[:, None]
    tap = detector.detect(magnitudes, threshold_sigma)
    found = tap >= 0
    rows, columns = np.arange(tap.size), np.where(found, tap, 0)
    return DetectionBlock(
        tap=tap,
        magnitude_sigma=np.where(found, magnitudes[rows, columns], np.nan),
        phase_rad=np.where(found, np.angle(taps[rows, columns]), np.nan),
        range_offset_m=range_offset_m(magnitudes, tap, detector.spacing, offsets_m),
    )
