"""Check whether the correlation function of samples has large steps, and find a sampling rate without large steps.

f_s is the sampling rate, and R_c is the chip rate. If f_s/R_c is nearly p/q with a small p, all samples fall on p
phases of a chip. The correlation function of such samples has steps of 1/p chip, and all correlators within a step give
the same value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vestige.constants import SPEED_OF_LIGHT_MPS


@dataclass(frozen=True, slots=True, kw_only=True)
class Staircase:
    """The steps of the correlation function at a sampling rate."""

    tread_m: float  # size of the steps in m
    good_rate_hz: float  # next higher sampling rate in Hz without large steps


_LARGEST_P = 16  # largest p for which a step of 1/p chip counts as large; 1/16 chip is 3.7 m on E6
_NEAR = 1e-3  # largest distance of f_s/R_c from p/q; at a larger distance the phases drift through a step within 16 ms
_GRID_HZ = 1e5  # suggested rates are multiples of 0.1 MHz


def commensurate_tread_m(sample_rate_hz: float, chip_rate_hz: float) -> Staircase | None:
    """Return the large steps of the correlation function at a sampling rate, or None if there are no large steps.

    The size of a step is 1/p chip, for the smallest p ≤ 16 of a fraction p/q ≥ 1/2 within 1e-3 of f_s/R_c. f_s is the
    rate of the samples that are correlated, because the samples of the replica fall on p phases of a chip at this rate.
    So neither a filter nor a higher rate before the filter removes the steps.
    """
    p = _phases(sample_rate_hz / chip_rate_hz)
    if p is None:
        return None
    good = np.floor(sample_rate_hz / _GRID_HZ) + 1
    while _phases(good * _GRID_HZ / chip_rate_hz) is not None:
        good += 1
    return Staircase(tread_m=SPEED_OF_LIGHT_MPS / chip_rate_hz / p, good_rate_hz=float(good * _GRID_HZ))


def _phases(ratio: float) -> int | None:
    """Return the smallest p ≤ 16 of a fraction p/q ≥ 1/2 within 1e-3 of `ratio`, or None without such a fraction."""
    for p in range(1, _LARGEST_P + 1):
        if any(abs(ratio - p / q) < _NEAR for q in range(1, 2 * p + 1)):
            return p
    return None
