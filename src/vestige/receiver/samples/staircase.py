"""Sampling rates at which the correlation function of the samples has large steps.

If f_s/R_c is nearly p/q with a small p, the samples of all chips fall on p phases. The sampled correlation function
then has steps of 1/p chip, and all correlators within a step give the same value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vestige.constants import SPEED_OF_LIGHT_MPS


@dataclass(frozen=True, slots=True, kw_only=True)
class Staircase:
    """The steps of the correlation function at a sampling rate."""

    tread_m: float  # size of the steps in m
    good_rate_hz: float  # next higher rate without such steps


_LARGEST_P = 16  # steps of 1/16 chip, 3.7 m on E6, are small enough
_NEAR = 1e-3  # if f_s/R_c differs more from p/q, the phases drift through a step within 16 ms
_GRID_HZ = 1e5  # suggested rates are multiples of 0.1 MHz


def commensurate_tread_m(sample_rate_hz: float, chip_rate_hz: float) -> Staircase | None:
    """Return the steps of the correlation function at a sampling rate; None if there are no steps.

    The steps have 1/p chip if f_s/R_c lies within 1e-3 of p/q with p ≤ 16. f_s is the rate of the samples that are
    correlated, because the replica's chips fall on p phases of these samples. So neither a filter nor a higher rate
    before the filter removes the steps.
    """
    p = _phases(sample_rate_hz / chip_rate_hz)
    if p is None:
        return None
    good = np.floor(sample_rate_hz / _GRID_HZ) + 1
    while _phases(good * _GRID_HZ / chip_rate_hz) is not None:
        good += 1
    return Staircase(tread_m=SPEED_OF_LIGHT_MPS / chip_rate_hz / p, good_rate_hz=float(good * _GRID_HZ))


def _phases(ratio: float) -> int | None:
    """Return the smallest p ≤ 16 of a fraction p/q ≥ 1/2 near `ratio`."""
    for p in range(1, _LARGEST_P + 1):
        if any(abs(ratio - p / q) < _NEAR for q in range(1, 2 * p + 1)):
            return p
    return None
