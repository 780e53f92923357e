"""Calibration of the receiver's constant delay between E6 and E1 from its own measurements."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.measurement import Measurement

MIN_SATELLITES = 3  # with one satellite a bias cannot be told from spoofing


def hardware_bias_correction_s(measurements: Iterable[Measurement]) -> float | None:
    """Return what to add to the hardware bias so that the median range offset is zero, in s.

    The bias is common to all satellites; ionosphere, multipath and noise are not. The median over all detected
    satellites survives a minority of spoofed ones. So calibrate where the signals are known to be good, and keep the
    value.

    Returns
    -------
    float | None
        None if fewer than `MIN_SATELLITES` satellites were detected.
    """
    offsets: dict[int, list[float]] = {}
    for measurement in measurements:
        for satellite in measurement.satellites:
            if satellite.detection is not None:
                offsets.setdefault(satellite.svid, []).append(satellite.detection.range_offset_m)
    if len(offsets) < MIN_SATELLITES:
        return None
    return float(np.median([np.median(values) for values in offsets.values()])) / SPEED_OF_LIGHT_MPS
