"""Calibrate the receiver's constant delay between E6 and E1 with measurements of the receiver."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vestige.acas_processor.measurement import MeasurementBlock
from vestige.constants import SPEED_OF_LIGHT_MPS

MIN_SATELLITES = 3  # with fewer satellites, the spoofing of a single satellite would look like a bias


def hardware_bias_correction_s(measured: Iterable[MeasurementBlock]) -> float | None:
    """Return the correction of the hardware bias in s that makes the median range offset zero.

    The bias is common to all satellites, in contrast to ionosphere, multipath and noise. The median over the epochs is
    taken first for each satellite. The median over all detected satellites is robust against a minority of spoofed
    satellites. Calibrate with signals that are known to be authentic, and use the calibrated bias afterwards.

    Parameters
    ----------
    measured
        Measured blocks of the processor, for example `step.block.measured` of each of its steps.

    Returns
    -------
    float | None
        Correction in s; None if fewer than `MIN_SATELLITES` satellites were detected.

    Examples
    --------
    A single satellite is not enough for a calibration:

    >>> import vestige as vs
    >>> source = vs.simulate(vs.load_scenario("scenarios/quick.toml", ["epochs=2", "receiver.cn0_dbhz=45"]))
    >>> steps = vs.AcasProcessor().steps(source, assistance=source.assistance)
    >>> vs.hardware_bias_correction_s(step.block.measured for step in steps) is None
    True
    """
    offsets: dict[int, list[float]] = {}
    for block in measured:
        detected = np.isfinite(block.detected.range_offset_m)
        for epoch, column in zip(*(axis.tolist() for axis in np.nonzero(detected)), strict=True):
            svid = block.snapshots.svids[column]
            offsets.setdefault(svid, []).append(float(block.detected.range_offset_m[epoch, column]))
    if len(offsets) < MIN_SATELLITES:
        return None
    return float(np.median([np.median(values) for values in offsets.values()])) / SPEED_OF_LIGHT_MPS
