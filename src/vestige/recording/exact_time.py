"""Compute times of samples, and write times as text, without loss of precision.

The time of 5·10¹³ samples at 10 MHz in s has a resolution of 0.9 ns as a float64, or 28 cm of range. So the whole
seconds are split off in exact arithmetic first. Only the fraction is rounded, and only once.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from vestige.time import GalileoTime


def later(start: GalileoTime, seconds: Fraction) -> GalileoTime:
    """Return the time exactly `seconds` after `start`, with the fraction of a second rounded once.

    Negative `seconds` give a time before `start`.
    """
    if not seconds:
        return start
    whole, rest = divmod(seconds + Fraction(start.fraction), 1)
    return GalileoTime.normalized(start.week, start.second + whole, float(rest))


def samples_later(start: GalileoTime, count: int, sample_rate_hz: float) -> GalileoTime:
    """Return the time `count` samples after `start`, with the sampling rate in Hz taken as exact."""
    return later(start, Fraction(count) / Fraction(sample_rate_hz))


def exact_second(time: GalileoTime) -> str:
    """Return the second of the week as text, with the fewest digits that give the same fraction again: `348018.1`."""
    digits = np.format_float_positional(time.fraction, unique=True, trim="-")
    return str(time.second) + digits.removeprefix("0")


def exact_gst(time: GalileoTime) -> str:
    """Return the text `WEEK:SECOND` from which `GalileoTime.parse` gives exactly the same time."""
    return f"{time.week}:{exact_second(time)}"
