"""Issue an ephemeris repeatedly as a satellite does, with the same orbit and clock referred to later times.

Mean anomaly, node, inclination and clock continue with their rates, and the harmonics depend only on the argument of
latitude. So a new issue gives exactly the orbit of the old issue. Ω0 refers to the start of toe's week. If toe moves to
another week, Ω0 therefore also changes by the Earth's rotation in a week.

Satellites issue orbits whose toe is in the past, and receivers expect a toe in the past. `rnx2rtkp` refuses orbits with
a future toe [RTKLIB], and some programs refuse orbits that are older than 2 h.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from vestige.constants import SECONDS_PER_WEEK
from vestige.navigation.earth import GRAVITATION_M3PS2, ROTATION_RADPS
from vestige.navigation.ephemeris import Ephemeris
from vestige.time import GalileoTime

ISSUE_S = 7200.0  # time between two issues in s
_ISSUES = 1024  # IODnav has 10 bits [OS-ICD, 4.3.5]
_BEFORE_S = 60.0  # margin in s before the start, for the travel time and a wrong clock


def referred_to(ephemeris: Ephemeris, toe: GalileoTime) -> Ephemeris:
    """Return an ephemeris for the same orbit and clock that refers to another time. The IODnav does not change.

    Parameters
    ----------
    ephemeris
        Any ephemeris.
    toe
        New toe. The time toc moves by as much as toe.
    """
    t = toe - ephemeris.toe
    motion = math.sqrt(GRAVITATION_M3PS2 / ephemeris.sqrt_a**6) + ephemeris.delta_n_radps
    week_s = (toe.week - ephemeris.toe.week) * SECONDS_PER_WEEK
    return replace(
        with_clock_moved(ephemeris, t),
        toe=toe,
        m0_rad=_wrapped(ephemeris.m0_rad + motion * t),
        omega0_rad=_wrapped(ephemeris.omega0_rad + ephemeris.omega_dot_radps * t - ROTATION_RADPS * week_s),
        i0_rad=ephemeris.i0_rad + ephemeris.i_dot_radps * t,
    )


def with_clock_moved(ephemeris: Ephemeris, t: float) -> Ephemeris:
    """Return an ephemeris for the same orbit and clock, with toc moved by `t` seconds."""
    return replace(
        ephemeris,
        toc=ephemeris.toc + t,
        af0_s=ephemeris.af0_s + ephemeris.af1 * t + ephemeris.af2_per_s * t**2,
        af1=ephemeris.af1 + 2 * ephemeris.af2_per_s * t,
    )


def reissued(ephemeris: Ephemeris, number: int) -> Ephemeris:
    """Return the `number`th issue after an ephemeris, at intervals of 2 h. Issue 0 is the ephemeris itself."""
    moved = referred_to(ephemeris, ephemeris.toe + number * ISSUE_S)
    return replace(moved, iod_nav=(ephemeris.iod_nav + number) % _ISSUES)


def issues(ephemeris: Ephemeris, start: GalileoTime, end: GalileoTime) -> Iterator[Ephemeris]:
    """Yield the issues of an ephemeris that are in use from `start` to `end`.

    At any time from `start` to `end`, an issue has a toe that is at most 2 h in the past.
    """
    first, last = (math.ceil((time - ephemeris.toe) / ISSUE_S) - 1 for time in (start + -_BEFORE_S, end))
    for number in range(first, last + 1):
        yield reissued(ephemeris, number) if number else ephemeris


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2 * math.pi)
