"""The path over a meaconer's antenna: the delay of each satellite's signal relative to the direct signal.

A meaconer at the position r_a retransmits the signals received at this position. So the signal of satellite s arrives
at the victim, at r,

    |s − r_a| + |r_a − r| − |s − r|

later than the direct signal. The second term and the repeater's own delay are common to all satellites and move the
victim's clock. The other two terms move the victim's position to r_a.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.sky.elevation import SatelliteRange
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.spoofer.attack import Attack
from vestige.spoofer.profiles import Profile, Table
from vestige.spoofer.repeaters import Meaconing, Place

# Linear interpolation at this step leaves 0.2 mm per km of distance for a static receiver, 5 mm at 4 m/s².
_STANDING_STEP_S, _MOVING_STEP_S = 10.0, 0.1
_AROUND_S = 20.0  # before and after the run


def placed_attacks(attacks: Sequence[Attack], path: SatelliteRange, duration_s: float) -> tuple[Attack, ...]:
    """Return the attacks for one satellite: a meaconer with an antenna delays the signal by the path over this antenna.

    Parameters
    ----------
    attacks
        Attacks of a scenario.
    path
        The satellite and the victim.
    duration_s
        Length of the run.
    """
    return tuple(
        _placed(one, one.antenna, path, duration_s) if isinstance(one, Meaconing) and one.antenna is not None else one
        for one in attacks
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedMeaconing(Meaconing):
    """A meaconer with an antenna, for one satellite."""

    way_m: Table  # length of the path over the antenna, less that of the direct path

    @property
    def delay_m(self) -> Profile:
        """Delay against the true signal in m."""
        own_m = self.delay_s * SPEED_OF_LIGHT_MPS
        return replace(self.way_m, values=tuple(way_m + own_m for way_m in self.way_m.values))


def _placed(attack: Meaconing, antenna: Place, path: SatelliteRange, duration_s: float) -> PlacedMeaconing:
    given = {one.name: getattr(attack, one.name) for one in fields(attack)}
    return PlacedMeaconing(**given, way_m=_way_over(antenna, path, duration_s, attack.delay_s))


def _way_over(antenna: Place, path: SatelliteRange, duration_s: float, delay_s: float) -> Table:
    """Return the excess of the path over an antenna relative to the direct path in m, `delay_s` before each time."""
    fixed = StaticTrajectory(
        latitude_deg=antenna.latitude_deg, longitude_deg=antenna.longitude_deg, height_m=antenna.height_m
    )
    step_s = _STANDING_STEP_S if isinstance(path.trajectory, StaticTrajectory) else _MOVING_STEP_S
    around_s = _AROUND_S if isinstance(path.trajectory, StaticTrajectory) else 0.0
    n_times = math.ceil((duration_s + 2 * around_s) / step_s) + 1
    times_s = np.linspace(-around_s, duration_s + around_s, n_times)
    then_s = times_s - delay_s
    to_antenna_m = replace(path, trajectory=fixed).range_m(then_s)
    onward_m = np.linalg.norm(fixed.motion(then_s).position_m - path.trajectory.motion(then_s).position_m, axis=1)
    way_m = to_antenna_m + onward_m - path.range_m(then_s)
    return Table(time_s=tuple(times_s.tolist()), values=tuple(way_m.tolist()))
