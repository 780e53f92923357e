"""Compute the delay of each satellite's signal over a meaconer's antenna, relative to the direct signal.

A meaconer at the position r_a retransmits the signals received at this position. The victim is at the position r. The
path of the retransmitted signal of a satellite at the position s is longer than the direct path by

    |s − r_a| + |r_a − r| − |s − r|

The term |r_a − r| and the repeater's own delay are common to all satellites and shift the clock of the victim's fix.
The terms |s − r_a| and |s − r| move the position of the victim's fix to r_a.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.sky.elevation import SatelliteRange
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.spoofer.attack import Attack
from vestige.spoofer.profiles import Profile, Table
from vestige.spoofer.repeaters import Meaconing, Place

# Interval in s between points with exact delays and rates, for a static and for a moving receiver. Cubics between such
# points have an error of 2 µm, both for a static receiver and on a circle of 40 m at 20 m/s.
_STANDING_STEP_S, _MOVING_STEP_S = 10.0, 0.1
_AROUND_S = 20.0  # time in s before and after the run that the cubics of a static receiver also cover


def placed_attacks(attacks: Sequence[Attack], path: SatelliteRange, duration_s: float) -> tuple[Attack, ...]:
    """Return the attacks on one satellite, with the delay over the antenna for each meaconer that has an antenna.

    All other attacks are returned unchanged.

    Parameters
    ----------
    attacks
        Attacks of a scenario.
    path
        Range from the satellite to the victim.
    duration_s
        Length of the run in s.
    """
    return tuple(
        _placed(one, one.antenna, path, duration_s) if isinstance(one, Meaconing) and one.antenna is not None else one
        for one in attacks
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Curve(Table):
    """Piecewise cubic function through points with given rates, continuous in value and rate.

    Before the first and after the last point, the value is constant.
    """

    rates: tuple[float, ...] = ()
    # times, values and rates of the points
    _points: Float[np.ndarray, "3 n"] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        Table.__post_init__(self)
        object.__setattr__(self, "_points", np.array([self.time_s, self.values, self.rates]))

    def value(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the value at each time in s after the scenario's start."""
        u, _, (value, first, quadratic, cubic) = self._cubic(t_s)
        return value + u * (first + u * (quadratic + u * cubic))

    def rate(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the derivative of the value at each time, per s."""
        u, step_s, (_, first, quadratic, cubic) = self._cubic(t_s)
        within = (t_s >= self._points[0, 0]) & (t_s < self._points[0, -1])
        return np.where(within, (first + u * (2 * quadratic + u * 3 * cubic)) / step_s, 0.0)

    def _cubic(
        self, t_s: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], tuple[Float[np.ndarray, " n"], ...]]:
        """Return for each time the elapsed fraction of the step, the step in s, and the coefficients of the cubic."""
        times_s, values, rates = self._points
        left = np.clip(np.searchsorted(times_s, t_s, side="right") - 1, 0, times_s.size - 2)
        step_s = times_s[left + 1] - times_s[left]
        u = np.clip((t_s - times_s[left]) / step_s, 0.0, 1.0)
        rise, first, last = values[left + 1] - values[left], rates[left] * step_s, rates[left + 1] * step_s
        return u, step_s, (values[left], first, 3 * rise - 2 * first - last, first + last - 2 * rise)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedMeaconing(Meaconing):
    """Meaconer with an antenna, with the delay of one satellite's signal."""

    # delay in m relative to the true signal: excess length of the path over the antenna, plus the repeater's own delay
    late_m: _Curve

    @property
    def delay_m(self) -> Profile:
        """Delay of the repeated signal relative to the true signal, in m."""
        return self.late_m


def _placed(attack: Meaconing, antenna: Place, path: SatelliteRange, duration_s: float) -> PlacedMeaconing:
    given = {one.name: getattr(attack, one.name) for one in fields(attack)}
    return PlacedMeaconing(**given, late_m=_delay_over(antenna, path, duration_s, attack.delay_s))


def _delay_over(antenna: Place, path: SatelliteRange, duration_s: float, delay_s: float) -> _Curve:
    """Return the delay over an antenna in m: c · `delay_s` plus the excess length of the path `delay_s` earlier."""
    fixed = StaticTrajectory(
        latitude_deg=antenna.latitude_deg, longitude_deg=antenna.longitude_deg, height_m=antenna.height_m
    )
    step_s = _STANDING_STEP_S if isinstance(path.trajectory, StaticTrajectory) else _MOVING_STEP_S
    around_s = _AROUND_S if isinstance(path.trajectory, StaticTrajectory) else 0.0
    n_times = math.ceil((duration_s + 2 * around_s) / step_s) + 1
    times_s = np.linspace(-around_s, duration_s + around_s, n_times)
    then_s = times_s - delay_s
    to_antenna, victim = replace(path, trajectory=fixed), path.trajectory.motion(then_s)
    between_m = victim.position_m - fixed.motion(then_s).position_m
    onward_m = np.linalg.norm(between_m, axis=1)
    away_mps = np.einsum("ni,ni->n", between_m, victim.velocity_mps)
    onward_mps = np.divide(away_mps, onward_m, out=np.zeros_like(onward_m), where=onward_m > 0)
    to_antenna_mps, direct_mps = to_antenna.rate_mps(then_s), path.rate_mps(then_s)
    late_m = to_antenna.range_m(then_s) + onward_m - path.range_m(then_s) + delay_s * SPEED_OF_LIGHT_MPS
    return _Curve(
        time_s=tuple(times_s.tolist()),
        values=tuple(late_m.tolist()),
        rates=tuple((to_antenna_mps + onward_mps - direct_mps).tolist()),
    )
