"""Interpolate E1 observations to a moment between the epochs of a file.

A snapshot begins with its RECS, usually at a time between two epochs of the E1 receiver. Let a and b be the epochs
before and after this time, at the times t_a and t_b = t_a + T. The carrier phase gives the motion between the epochs to
a fraction of a wavelength. So the interpolated pseudorange follows the phase. At the time t the share u = (t - t_a)/T
of the interval has passed, and the values are:

* Doppler f and its rate are linear in u. The Doppler is exact for constant acceleration.
* Phase φ is the cubic through φ_a and φ_b with the slopes -f_a and -f_b (Hermite). The phase is exact for constant
  acceleration and constant jerk. Without a phase, or across a cycle slip, φ is the integral of the Doppler, which is
  exact for constant acceleration, and no phase is returned.
* Pseudorange P = (1 - u)(P_a + λ(φ - φ_a)) + u(P_b + λ(φ - φ_b)). λ is the wavelength of E1. P is the weighted
  mean of the two pseudoranges after each pseudorange was moved along the phase to the time t.

Missing values are computed first. A missing Doppler comes from the slope of the phases at neighbouring epochs: the
slope of a parabola through three phases, or of a line through two phases. A missing Doppler rate comes from the
Dopplers of the neighbouring epochs. A Doppler rate that cannot be computed is set to zero, which causes a small error.
In half a snapshot of 16 ms, a Doppler rate of 50 Hz/s turns the carrier by less than 0.002 cycles.

Unless a satellite has an epoch at the requested time itself, the satellite is left out if the epoch before or after
this time is missing, or if these epochs are too far apart. A satellite is also left out if it has no Doppler, or if
code and carrier disagree, for example because the receiver's clock was set between the epochs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

WAVELENGTH_M = SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
# largest time in s from the requested time to an epoch that is used without interpolation; the range error is below
# 0.01 mm
SAME_TIME_S = 1e-8
SLIP_CYCLES, SLIP_HZ = 1.0, 5.0  # allowed difference of phase and integrated Doppler: a constant, plus a rate times T
# largest difference in m between the changes of pseudorange and carrier phase from epoch to epoch, about half an E1
# chip: more than noise and multipath cause, less than a step of the receiver's clock
CODE_CARRIER_M = 150.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Point:
    """Observation of a satellite at an epoch, `t` seconds after the requested moment."""

    t: float
    observation: E1Observation
    slipped: bool


def interpolate(epochs: Sequence[ObservationEpoch], time: GalileoTime, *, max_gap_s: float) -> dict[int, E1Observation]:
    """Return the E1 observations at `time` by SVID.

    Epochs are in time order, before and after `time`. A few epochs beyond the two nearest epochs help to compute
    missing values. `max_gap_s` is the longest time between two observations of a satellite in the same track.
    """
    result = {}
    for svid in sorted({svid for epoch in epochs for svid in epoch.observations}):
        points = [
            _Point(t=epoch.time - time, observation=epoch.observations[svid], slipped=svid in epoch.slipped)
            for epoch in epochs
            if svid in epoch.observations
        ]
        observation = _at_zero(points, max_gap_s)
        if observation is not None:
            result[svid] = observation
    return result


def is_final(epochs: Sequence[ObservationEpoch], time: GalileoTime, *, max_gap_s: float) -> bool:
    """Return whether epochs after the given epochs would not change the result of `interpolate` at `time`."""
    if not epochs or epochs[-1].time - time < -SAME_TIME_S:
        return False
    tracks: dict[int, list[tuple[float, E1Observation]]] = {}
    for epoch in epochs:
        for svid, observation in epoch.observations.items():
            tracks.setdefault(svid, []).append((epoch.time - time, observation))
    return all(_is_final(track, epochs[-1].time - time, max_gap_s) for track in tracks.values())


def _is_final(track: list[tuple[float, E1Observation]], last: float, max_gap_s: float) -> bool:
    """Return whether further epochs do not change the observation of a satellite.

    `last` is the time of the last epoch, in s after the requested moment.
    """
    here = next((index for index, (t, _) in enumerate(track) if t >= -SAME_TIME_S), None)
    if here is None:
        return last - track[-1][0] > max_gap_s
    if track[here][0] > SAME_TIME_S and here == 0:
        return True  # without an earlier epoch there is no observation
    observation = track[here][1]
    if not math.isnan(observation.doppler_hz + observation.doppler_rate_hz_per_s):
        return True
    # The point after `here` gives missing values of the point at `here`. The second point after `here` gives missing
    # values of the point after `here`.
    known_next = len(track) > here + 1 and not math.isnan(track[here + 1][1].doppler_hz)
    return known_next or len(track) > here + 2 or last - track[-1][0] > max_gap_s


def _at_zero(points: list[_Point], max_gap_s: float) -> E1Observation | None:
    """Return the observation at the requested moment, t = 0, or None if the satellite is left out."""
    for index, point in enumerate(points):
        if abs(point.t) <= SAME_TIME_S:
            complete = _complete(points, index, max_gap_s)
            return None if math.isnan(complete.doppler_hz) else complete
    after = next((index for index, point in enumerate(points) if point.t > 0), 0)
    if after == 0 or points[after].t - points[after - 1].t > max_gap_s:
        return None
    a, b = (replace(points[i], observation=_complete(points, i, max_gap_s)) for i in (after - 1, after))
    return _between(a, b)


def _between(a: _Point, b: _Point) -> E1Observation | None:
    first, last = a.observation, b.observation
    f_a, f_b, duration = first.doppler_hz, last.doppler_hz, b.t - a.t
    if math.isnan(f_a + f_b):
        return None
    u = -a.t / duration
    has_phase = _joined(a, b)
    total = last.carrier_phase_cycles - first.carrier_phase_cycles if has_phase else -(f_a + f_b) / 2 * duration
    # Hermite cubic from 0 to `total` with slopes -f_a, -f_b; a parabola if `total` is the integral of f.
    moved = total * u**2 * (3 - 2 * u) - duration * (f_a * u * (1 - u) ** 2 - f_b * u**2 * (1 - u))
    if abs(last.pseudorange_m - first.pseudorange_m - WAVELENGTH_M * total) > CODE_CARRIER_M:
        return None
    from_a = first.pseudorange_m + WAVELENGTH_M * moved
    from_b = last.pseudorange_m + WAVELENGTH_M * (moved - total)
    strengths = [cn0 for cn0 in (first.cn0_dbhz, last.cn0_dbhz) if not math.isnan(cn0)]
    return E1Observation(
        svid=first.svid,
        pseudorange_m=(1 - u) * from_a + u * from_b,
        carrier_phase_cycles=first.carrier_phase_cycles + moved if has_phase else math.nan,
        doppler_hz=(1 - u) * f_a + u * f_b,
        doppler_rate_hz_per_s=(1 - u) * first.doppler_rate_hz_per_s + u * last.doppler_rate_hz_per_s,
        cn0_dbhz=(1 - u) * strengths[0] + u * strengths[-1] if strengths else math.nan,
    )


def _joined(a: _Point, b: _Point) -> bool:
    """Return whether the carrier phase at `b` continues the carrier phase at `a`."""
    first, last, duration = a.observation, b.observation, b.t - a.t
    change = last.carrier_phase_cycles - first.carrier_phase_cycles
    if b.slipped or math.isnan(change):
        return False
    unlike = abs(change + (first.doppler_hz + last.doppler_hz) / 2 * duration)
    return math.isnan(unlike) or unlike <= SLIP_CYCLES + SLIP_HZ * duration


def _complete(points: list[_Point], index: int, max_gap_s: float) -> E1Observation:
    """Return the observation at `index` with Doppler and Doppler rate, computed from its neighbours if missing."""
    near = _neighbours(points, index, max_gap_s)
    observation = points[index].observation
    doppler = _doppler(points, index, max_gap_s)
    rate = observation.doppler_rate_hz_per_s
    if math.isnan(rate):
        values = [(points[i].t, _doppler(points, i, max_gap_s)) for i in near]
        known = [(t, value) for t, value in values if not math.isnan(value)]
        rate = (known[-1][1] - known[0][1]) / (known[-1][0] - known[0][0]) if len(known) > 1 else 0.0
    return replace(observation, doppler_hz=doppler, doppler_rate_hz_per_s=rate)


def _doppler(points: list[_Point], index: int, max_gap_s: float) -> float:
    """Return the observed Doppler at `index`, or the Doppler from continuous phases around `index`, or NaN."""
    here = points[index]
    if not math.isnan(here.observation.doppler_hz):
        return here.observation.doppler_hz
    near = [points[i] for i in _neighbours(points, index, max_gap_s)]
    joined = [
        p for p in near if p is here or (_joined(p, here) if p.t < here.t else _joined(here, p))
    ]  # the point itself, and at most one point on each side
    if len(joined) < 2:
        return math.nan
    reference = here.observation.carrier_phase_cycles
    times = [p.t - here.t for p in joined]
    phases = [p.observation.carrier_phase_cycles - reference for p in joined]
    return -float(np.polyfit(times, phases, len(joined) - 1)[-2])


def _neighbours(points: list[_Point], index: int, max_gap_s: float) -> list[int]:
    """Return the indices of a point and of its neighbours that are at most `max_gap_s` away."""
    return [
        i
        for i in (index - 1, index, index + 1)
        if 0 <= i < len(points) and abs(points[i].t - points[index].t) <= max_gap_s
    ]
