"""Compute the geometry of signals that are replayed under a sky and come from earlier positions of the satellites.

A spoofing signal with the delay τ is the signal that the receiver could have received τ earlier. ρ is the range of the
line of sight. At the time t the delay and the rate of the spoofing signal relative to the direct signal are:

    delay    c τ + ρ(t − τ) − ρ(t)
    rate     derivative of this delay, for code and carrier

The receiver computes the satellite's position at t − τ − ρ/c, so all ranges are consistent, as in samples
(`samples.attacked_sky`). For a delay of 5 s the correction ρ(t − τ) − ρ(t) is up to 4 km. Delays up to 10 µs are not
changed, because their correction is less than 1 cm. In drawn correlators, strength and ionosphere of the spoofing
signal have their values at the time t. The multipath error of the E1 pseudorange also has its value at the time t.

A single line of sight does not need the correction ρ(t − τ) − ρ(t). A receiver of a single line of sight has no other
clock than the signal (`snapshots.e1`), so the receiver's clock shows the time of the replay. At the time that the
receiver's clock shows, the satellite's range equals the range of the replayed signal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_loop import E1Tracking
from vestige.receiver.sky.elevation import SatelliteRange
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Band
from vestige.signals.definitions import CARRIER_HZ
from vestige.spoofer.spoofer import BandEffects, Spoofer

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

# Interval in s between points with exact ranges and rates, for a static and for a moving receiver. Cubics between such
# points have an error of 1 µm for a static receiver, and of 2 mm where an acceleration of 4 m/s² begins.
_STANDING_STEP_S, _MOVING_STEP_S = 10.0, 0.1
_LEAST_DELAY_M = 1e-5 * SPEED_OF_LIGHT_MPS
_FIXED_POINT_STEPS = 3  # number of iterations; ρ changes by less than 1 km/s, so each iteration gains five decimals


@dataclass(frozen=True, slots=True, kw_only=True)
class SpooferUnderSky(Spoofer):
    """Attacker of one satellite of a sky.

    A spoofing signal has the geometry of the time at which the satellite sent the repeated signal.

    Attributes
    ----------
    path
        Range from the satellite to the receiver.
    clock_offset_s
        Receiver clock minus system time, a constant in s.
    """

    path: SatelliteRange
    clock_offset_s: float = 0.0

    def effects(self, band: Band, svid: int, times_s: Float[np.ndarray, " n"]) -> BandEffects:
        """Return the effects at the receiver in one band, at times in s after the start on the receiver's own clock."""
        own = Spoofer.effects(self, band, svid, times_s)
        late_m = np.where(own.power_db > -math.inf, own.delay_m, 0.0)
        moved_m, moved_mps = self.moved(times_s, late_m, own.delay_rate_mps)
        cycles = CARRIER_HZ[band] / SPEED_OF_LIGHT_MPS * moved_m
        return replace(
            own,
            delay_m=own.delay_m + moved_m,
            delay_rate_mps=own.delay_rate_mps + moved_mps,
            phase_rad=own.phase_rad - 2 * np.pi * (cycles - np.floor(cycles)),
            doppler_hz=own.doppler_hz - CARRIER_HZ[band] / SPEED_OF_LIGHT_MPS * moved_mps,
        )

    def moved(
        self,
        times_s: Float[np.ndarray, " n"],
        late_m: Float[np.ndarray, "n k"],
        late_mps: Float[np.ndarray, "n k"],
    ) -> tuple[Float[np.ndarray, "n k"], Float[np.ndarray, "n k"]]:
        """Return ρ(t − τ) − ρ(t) in m and its derivative in m/s, both 0 for delays up to 10 µs.

        The delay c τ is `late_m` in m, and the rate of this delay is `late_mps` in m/s.
        """
        moved_m, moved_mps = np.zeros((2, *late_m.shape))
        late = np.abs(late_m) > _LEAST_DELAY_M
        rows = np.flatnonzero(np.any(late, axis=1))
        if not rows.size:
            return moved_m, moved_mps
        now_s = (times_s[rows] - self.clock_offset_s)[:, None]
        then_s = now_s - late_m[rows] / SPEED_OF_LIGHT_MPS
        both_s = np.concatenate([now_s, then_s], axis=1)
        range_m = _curve(self.path, float(np.min(both_s)), float(np.max(both_s)))
        rate_mps = range_m.derivative()
        then_mps = rate_mps(then_s) * (1 - late_mps[rows] / SPEED_OF_LIGHT_MPS)
        moved_m[rows] = np.where(late[rows], range_m(then_s) - range_m(now_s), 0.0)
        moved_mps[rows] = np.where(late[rows], then_mps - rate_mps(now_s), 0.0)
        return moved_m, moved_mps

    def tracked(self, times_s: Float[np.ndarray, " n"], loop: E1Tracking) -> E1Tracking:
        """Return the E1 tracking of the loop after the geometry of the replay has been added.

        The geometry changes only for a delay above 10 µs (3 km). The true signal is then many chips away, so the loop
        follows the late signal alone.
        """
        late_m = np.stack([loop.error_m, loop.worst_error_m], axis=1)
        late_mps = np.repeat(loop.rate_error_mps[:, None], 2, axis=1)
        moved_m, moved_mps = self.moved(times_s, late_m, late_mps)
        return replace(
            loop,
            error_m=loop.error_m + moved_m[:, 0],
            worst_error_m=loop.worst_error_m + moved_m[:, 1],
            rate_error_mps=loop.rate_error_mps + moved_mps[:, 0],
        )


def _curve(path: SatelliteRange, first_s: float, last_s: float) -> CubicHermiteSpline:
    """Return the range in m between two system times, as cubics through knots on a fixed time grid.

    Because the grid is fixed, the range does not depend on the division of the run into blocks.
    """
    from scipy.interpolate import CubicHermiteSpline  # noqa: PLC0415  (loads slowly, and few runs replay the past)

    step_s = _STANDING_STEP_S if isinstance(path.trajectory, StaticTrajectory) else _MOVING_STEP_S
    low, high = math.floor(first_s / step_s), math.floor(last_s / step_s) + 1
    knots_s = np.arange(low, high + 1) * step_s
    sight = path.sight(knots_s)
    range_m, rate_mps = sight.range_m - sight.satellite_clock_m, sight.rate_mps - sight.satellite_clock_mps
    return CubicHermiteSpline(knots_s, range_m, rate_mps)


def replay_delay_m(
    path: SatelliteRange, times_s: Float[np.ndarray, " n"], late_m: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return c τ of signals with a given delay c τ + ρ(t − τ) − ρ(t) relative to the direct signal.

    Parameters
    ----------
    path
        Range from the satellite to the receiver.
    times_s
        Times of reception t in s after the scenario's start, in system time.
    late_m
        Delay of the signals relative to the direct signal, c τ + ρ(t − τ) − ρ(t), in m.
    """
    delay_m = late_m
    for _ in range(_FIXED_POINT_STEPS):
        delay_m = late_m - (path.range_m(times_s - delay_m / SPEED_OF_LIGHT_MPS) - path.range_m(times_s))
    return delay_m
