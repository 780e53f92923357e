"""Decide whether the chips of a RECS belong to the open E6-C code, whose public primary code repeats each millisecond.

E6-C was not encrypted before the service began. A user can test the whole processing with RECS that are made from a
recording of unencrypted E6-C (`vestige recs make`). With RECS of the open code, a search for the earliest arrival is
meaningless. The reason is that the chips that arrived 100 ms earlier, one period of the secondary code, also match the
RECS.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int8

from vestige.constants import SECONDARY_PERIOD_S
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E6C


def is_open_e6c(chips: Int8[np.ndarray, " n_chips"], svid: int) -> bool:
    """Return whether the chips of a RECS repeat, except for the sign, with the period of the primary code.

    Parameters
    ----------
    chips
        int8[n_chips]: chips ±1 in order of transmission. If the chips contain only one code period, this period is
        compared with the public primary code. If the chips are shorter than a code period, the result is False.
    svid
        SVID of the satellite.

    Examples
    --------
    >>> from vestige.signals.codes import tiered_code
    >>> is_open_e6c(tiered_code(E6C, 7)[:81_840], 7)
    True
    >>> rng = np.random.default_rng(1)
    >>> is_open_e6c((1 - 2 * rng.integers(0, 2, 81_840)).astype(np.int8), 7)
    False
    """
    first = primary_code(E6C, svid)
    n_periods = chips.size // first.size
    if n_periods == 0:
        return False
    periods = chips[: n_periods * first.size].reshape(n_periods, first.size).astype(np.int32)
    against = periods[0] if n_periods > 1 else first.astype(np.int32)
    return bool(np.all(np.abs(periods @ against) == first.size))


def repeated_after_s(chips: Int8[np.ndarray, " n_chips"], svid: int) -> float | None:
    """Return the time in s after which a satellite sends the chips again; None if the chips are not open E6-C code."""
    return SECONDARY_PERIOD_S if is_open_e6c(chips, svid) else None
