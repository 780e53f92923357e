"""Estimate the error of the receiver's clock from the E1 ranges.

All pseudoranges of an epoch contain the same clock error. A position fix solves for this error. Without a fix the
travel times limit the error. Travel times from Galileo satellites to the Earth lie between `SHORTEST_TRAVEL_S` and
`LONGEST_TRAVEL_S`. So the median pseudorange divided by c, minus the middle of both limits, is the clock error to
within `TRAVEL_SPREAD_S`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.measurement import MeasurementBlock
from vestige.acas_processor.position.possible_range import LONGEST_TRAVEL_S, SHORTEST_TRAVEL_S, row_median
from vestige.constants import SPEED_OF_LIGHT_MPS

TRAVEL_SPREAD_S = (LONGEST_TRAVEL_S - SHORTEST_TRAVEL_S) / 2
_MIDDLE_S = (LONGEST_TRAVEL_S + SHORTEST_TRAVEL_S) / 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClockError:
    """Error of the receiver's clock at n epochs, from the E1 ranges.

    Attributes
    ----------
    error_s
        Time of the clock minus Galileo System Time in s; positive if the clock is ahead. NaN without a pseudorange.
    sigma_m
        Standard deviation of the clock error from the position fix, multiplied by c, without errors that are common to
        all satellites; NaN where there is no fix.
    of_fix
        True where a position fix gives the error. Elsewhere the travel times give the error to within
        `TRAVEL_SPREAD_S`.
    """

    error_s: Float[np.ndarray, " n"]
    sigma_m: Float[np.ndarray, " n"]
    of_fix: Bool[np.ndarray, " n"]


def clock_error(measured: MeasurementBlock) -> ClockError:
    """Return the clock error from the E1 ranges of a block."""
    error_s = row_median(measured.snapshots.e1.pseudorange_m)[:, 0] / SPEED_OF_LIGHT_MPS - _MIDDLE_S
    if measured.fix is None:
        return ClockError(error_s=error_s, sigma_m=np.full(error_s.size, np.nan), of_fix=np.zeros(error_s.size, bool))
    fix, sigma_m = measured.fix.fix, measured.fix.own_sigma_clock_m
    of_fix = fix.valid & np.isfinite(sigma_m)
    return ClockError(
        error_s=np.where(of_fix, fix.clock_m / SPEED_OF_LIGHT_MPS, error_s),
        sigma_m=np.where(of_fix, sigma_m, np.nan),
        of_fix=of_fix,
    )
