"""Compute position, velocity and clock from pseudoranges and range rates by weighted least squares, for many epochs.

Theory of operation
-------------------
A signal with pseudorange P at the receiver's clock time t left the satellite at t − P/c on the satellite's own clock.
So the satellite's state at transmission needs no iteration. Let s be the satellite's position at transmission, rotated
with the Earth during the travel time. The equation

    P + c Δt_sat − corrections = |s − r| + b + error

is linearised in the receiver's position r and in b, which is c times the receiver's clock error. The corrections are
atmospheric delays, which the caller may subtract from P. The equation is solved by Gauss–Newton steps from the Earth's
centre. x contains r and b, y contains the residuals, and the diagonal matrix W contains the weights 1/σ²:

    x ← x + (HᵀWH)⁻¹HᵀW y,   H = [−(s − r)/|s − r|, 1]

The pseudorange errors may have a common part with the covariance c cᵀ, where c is a vector, in addition to independent
errors. An example is the ionospheric error of the pseudoranges at a receiver, for which c is proportional to the
obliquity M (`elevation_model`). A common part that is equal for all satellites affects only the clock error of the fix.
A common part that grows towards the horizon affects mainly height and clock error of the fix, and changes the residuals
little. W ignores the correlation of the errors, but the covariance P of the fix contains the correlation. With S =
(HᵀWH)⁻¹HᵀW,

    P = S (diag(σ² − c²) + c cᵀ) Sᵀ

The range rate is linear in the receiver's velocity and clock drift. The matrix of the velocity fix is H with its first
three columns multiplied by 1/(1 − u·ṡ/c). u is the unit vector from satellite to receiver, and ṡ is the satellite's
velocity in a frame that does not rotate.

The first axis of an array is the epoch. The second axis is the satellite if there is a value for each satellite. In
pseudoranges and range rates, NaN means that a satellite was not measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import carried_by_earth, local_axes_at, turned_with_earth
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.orbit import satellite_position, satellite_state
from vestige.time import GalileoTime

UNKNOWNS = 4  # position and clock of one system
_STEPS = 12  # largest number of steps; 6 steps are enough from the Earth's centre
_SETTLED_M = 1e-4
# Ratio of the smallest to the largest eigenvalue of HᵀH below which a geometry counts as singular. A geometry with a
# DOP of 10⁴ has a ratio of about 1e-9.
_SINGULAR = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True)
class Transmission:
    """States of m satellites when they transmitted the signals of n epochs; NaN for signals that were not received.

    Attributes
    ----------
    position_m, velocity_mps
        Position in m and velocity in m/s in ECEF coordinates at the time of transmission.
    clock_m, clock_mps
        Error of the satellite clock on E1, times c, in m, and the rate of this product in m/s.
    """

    position_m: Float[np.ndarray, "n m 3"]
    velocity_mps: Float[np.ndarray, "n m 3"]
    clock_m: Float[np.ndarray, "n m"]
    clock_mps: Float[np.ndarray, "n m"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """Position fixes of n epochs; NaN for epochs with fewer than four satellites or a singular geometry.

    Attributes
    ----------
    position_m, clock_m
        ECEF position in m, and c times the receiver clock's error in m, positive if the clock is ahead.
    covariance_m2
        Covariance P of (x, y, z, clock) in ECEF. The covariance is valid if the errors have the σ of the weights and
        are independent apart from the common part.
    residual_m
        Measured minus fitted pseudorange in m; NaN for unused satellites and epochs without a fix.
    geometry
        Matrix H, with rows of zeros for unused satellites and epochs without a fix.
    weight
        Weights 1/σ² in 1/m²; 0 for unused satellites and epochs without a fix.
    n_used
        Number of satellites that the fix uses, or could use in an epoch without a fix.
    """

    position_m: Float[np.ndarray, "n 3"]
    clock_m: Float[np.ndarray, " n"]
    covariance_m2: Float[np.ndarray, "n 4 4"]
    residual_m: Float[np.ndarray, "n m"]
    geometry: Float[np.ndarray, "n m 4"]
    weight: Float[np.ndarray, "n m"]
    n_used: Int[np.ndarray, " n"]

    @property
    def valid(self) -> Bool[np.ndarray, " n"]:
        """Whether each epoch has a fix."""
        return np.isfinite(self.clock_m)


def transmission(
    ephemerides: Sequence[Ephemeris],
    start: GalileoTime,
    elapsed_s: Float[np.ndarray, " n"],
    pseudorange_m: Float[np.ndarray, "n m"],
) -> Transmission:
    """Return the states of the satellites when they transmitted the received signals.

    Parameters
    ----------
    ephemerides
        One ephemeris for each column of `pseudorange_m`.
    start, elapsed_s
        Times of reception `start` + `elapsed_s` on the receiver's clock.
    pseudorange_m
        c · (time of reception on the receiver's clock − time of transmission on the satellite's clock).
    """
    columns = []
    for ephemeris, pseudorange in zip(ephemerides, pseudorange_m.T, strict=True):
        sent_s = elapsed_s - pseudorange / SPEED_OF_LIGHT_MPS
        # `sent_s` is on the satellite's clock, whose error is computed at `sent_s`. The drift over 1 ms is negligible.
        _, clock_s = satellite_position(ephemeris, start, sent_s)
        columns.append(satellite_state(ephemeris, start, sent_s - clock_s))
    return Transmission(
        position_m=np.stack([state.position_m for state in columns], axis=1),
        velocity_mps=np.stack([state.velocity_mps for state in columns], axis=1),
        clock_m=SPEED_OF_LIGHT_MPS * np.stack([state.clock_s for state in columns], axis=1),
        clock_mps=SPEED_OF_LIGHT_MPS * np.stack([state.clock_drift for state in columns], axis=1),
    )


def position_fix(
    sent: Transmission,
    pseudorange_m: Float[np.ndarray, "n m"],
    sigma_m: Float[np.ndarray, "n m"],
    *,
    common_m: Float[np.ndarray, "n m"] | None = None,
) -> Fix:
    """Return the position and clock error of the receiver at each epoch by weighted least squares.

    Parameters
    ----------
    sent
        States of the satellites at transmission.
    pseudorange_m
        Pseudoranges in m; NaN for satellites that were not measured.
    sigma_m
        Standard deviation of each pseudorange in m.
    common_m
        Vector c in m, the error of each pseudorange if the common error has the size 1σ. `sigma_m` includes the common
        error. None means that there is no common error.
    """
    measured = pseudorange_m + sent.clock_m
    used, weight = _weights(measured, sigma_m)
    position, clock = _position_and_clock(sent, measured, used, weight)
    geometry, predicted = _predict(sent.position_m, position, used)
    known = np.isfinite(clock)[:, None] & used
    return Fix(
        position_m=position,
        clock_m=clock,
        covariance_m2=_covariance(geometry, weight, np.zeros_like(weight) if common_m is None else common_m),
        residual_m=np.where(known, measured - predicted - clock[:, None], np.nan),
        geometry=geometry,
        weight=np.where(known, weight, 0.0),
        n_used=np.count_nonzero(used, axis=1),
    )


def fixed_position_m(
    sent: Transmission, pseudorange_m: Float[np.ndarray, "n m"], sigma_m: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, "n 3"]:
    """Return only `position_m` of `position_fix`, without residuals and covariances.

    Parameters
    ----------
    sent, pseudorange_m, sigma_m
        Parameters of `position_fix`.
    """
    measured = pseudorange_m + sent.clock_m
    return _position_and_clock(sent, measured, *_weights(measured, sigma_m))[0]


def _weights(
    measured: Float[np.ndarray, "n m"], sigma_m: Float[np.ndarray, "n m"]
) -> tuple[Bool[np.ndarray, "n m"], Float[np.ndarray, "n m"]]:
    """Return whether each measurement is used, and its weight in 1/m², which is 0 if the measurement is not used."""
    used = np.isfinite(measured) & np.isfinite(sigma_m)
    return used, np.where(used, 1.0 / np.where(used, sigma_m, 1.0) ** 2, 0.0)


def _position_and_clock(
    sent: Transmission,
    measured: Float[np.ndarray, "n m"],
    used: Bool[np.ndarray, "n m"],
    weight: Float[np.ndarray, "n m"],
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " n"]]:
    """Return ECEF position and c times the clock error, both in m, by Gauss–Newton steps from the Earth's centre."""
    position, clock = np.zeros((measured.shape[0], 3)), np.zeros(measured.shape[0])
    moving = np.ones(measured.shape[0], np.bool_)
    for _ in range(_STEPS):
        geometry, predicted = _predict(sent.position_m, position, used)
        residual = np.where(used, measured - predicted - clock[:, None], 0.0)
        step = np.where(moving[:, None], _solve(geometry, weight, residual), 0.0)
        position, clock = position + step[:, :3], clock + step[:, 3]
        moving = np.any(np.abs(step) > _SETTLED_M, axis=1)  # tested for each epoch, so that fixes are independent
        if not np.any(moving):
            break
    return position, clock


def velocity_fix(
    sent: Transmission, fix: Fix, range_rate_mps: Float[np.ndarray, "n m"]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " n"]]:
    """Return the receiver's ECEF velocity and c times its clock's drift, both in m/s; NaN without a solution.

    Parameters
    ----------
    sent
        States of the satellites at transmission.
    fix
        Position fix of the epochs of `sent`. The weights of this fix also weight the range rates.
    range_rate_mps
        Rate of the pseudorange, −λ · Doppler, in m/s; NaN for satellites that were not measured.
    """
    known, slowed = _static_rates(sent, fix)
    used = np.isfinite(range_rate_mps) & (fix.weight > 0)
    residual = np.where(used, range_rate_mps - known, 0.0)
    scale = np.concatenate((np.repeat(1 / slowed[..., None], 3, axis=-1), np.ones((*slowed.shape, 1))), axis=-1)
    geometry = np.where(used[..., None], fix.geometry * scale, 0.0)
    solution = _solve(geometry, np.where(used, fix.weight, 0.0), residual)
    return solution[:, :3], solution[:, 3]


def static_range_rate(sent: Transmission, fix: Fix) -> Float[np.ndarray, "n m"]:
    """Return the pseudorange rates of a receiver at rest at the position of the fix, with a clock without drift.

    The rates are NaN for satellites that the fix does not use.

    Parameters
    ----------
    sent
        States of the satellites at transmission.
    fix
        Position fix of the epochs of `sent`.
    """
    return np.where(fix.weight > 0, _static_rates(sent, fix)[0], np.nan)


def _static_rates(sent: Transmission, fix: Fix) -> tuple[Float[np.ndarray, "n m"], Float[np.ndarray, "n m"]]:
    """Return the pseudorange rates of a receiver at rest without clock drift, and the factors 1 − u·ṡ/c."""
    in_space = sent.velocity_mps + carried_by_earth(sent.position_m)
    s_1 = turned_with_earth(in_space, _flight_s(sent.position_m, fix.position_m))
    carried = carried_by_earth(fix.position_m)
    towards = fix.geometry[..., :3]  # u, the unit vector from satellite to receiver
    slowed = 1 - np.einsum("nmi,nmi->nm", towards, s_1) / SPEED_OF_LIGHT_MPS
    return np.einsum("nmi,nmi->nm", towards, carried[:, None] - s_1) / slowed - sent.clock_mps, slowed


@dataclass(frozen=True, slots=True, kw_only=True)
class Dilution:
    """Dilutions of precision: standard deviations of the fix in m if every pseudorange has σ = 1 m."""

    geometric: Float[np.ndarray, " n"]
    position: Float[np.ndarray, " n"]
    horizontal: Float[np.ndarray, " n"]
    vertical: Float[np.ndarray, " n"]
    time: Float[np.ndarray, " n"]


def dilution(geometry_local: Float[np.ndarray, "n m 4"]) -> Dilution:
    """Return the dilutions of precision of a geometry in local axes; NaN without a fix."""
    weight = np.any(geometry_local != 0, axis=-1).astype(np.float64)
    east, north, up, time = np.moveaxis(np.diagonal(inverse_normal(geometry_local, weight), axis1=1, axis2=2), -1, 0)
    return Dilution(
        geometric=np.sqrt(east + north + up + time),
        position=np.sqrt(east + north + up),
        horizontal=np.sqrt(east + north),
        vertical=np.sqrt(up),
        time=np.sqrt(time),
    )


def local_geometry(fix: Fix) -> Float[np.ndarray, "n m 4"]:
    """Return the matrix H of the fixes in local axes (east, north, up, clock)."""
    return in_local_axes(fix.geometry, fix.position_m)


def in_local_axes(
    geometry: Float[np.ndarray, "n m 4"], position_m: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n m 4"]:
    """Return the matrix H in the local axes at the positions, from the matrix H in ECEF."""
    turned = np.einsum("nij,nmj->nmi", local_axes_at(position_m), geometry[..., :3])
    return np.concatenate((turned, geometry[..., 3:]), axis=-1)


def inverse_normal(
    geometry: Float[np.ndarray, "n m 4"], weight: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, "n 4 4"]:
    """Return (HᵀWH)⁻¹; NaN where HᵀH of the used satellites is singular."""
    sighted = np.matmul(np.where(weight[..., None] > 0, geometry, 0.0).transpose(0, 2, 1), geometry)
    solvable = _solvable(np.where(np.isfinite(sighted), sighted, 0.0))
    # The epochs become the last axis of `columns`, so that a sum over satellites adds long rows, which is fast.
    columns = np.ascontiguousarray(np.moveaxis(geometry, 0, -1))
    normal = np.moveaxis(np.sum((columns * weight.T[:, None])[:, :, None] * columns[:, None], axis=0), -1, 0)
    normal[~solvable] = np.eye(UNKNOWNS)
    inverse = np.linalg.inv(normal)
    inverse[~solvable] = np.nan
    return inverse


def _solvable(sighted: Float[np.ndarray, "n 4 4"]) -> Bool[np.ndarray, " n"]:
    """Return whether each matrix HᵀH is regular, which means that a fix exists.

    With t the trace, the product of the three larger eigenvalues is at most (t/3)³. The smallest eigenvalue is
    therefore at least det(HᵀH) (3/t)³. The largest eigenvalue is at most t. If the lower limit of the smallest
    eigenvalue is far above the threshold, the eigenvalues are not computed.
    """
    trace = np.trace(sighted, axis1=1, axis2=2)
    least = np.linalg.det(sighted) * (3 / np.maximum(trace, 1e-9)) ** 3
    solvable = least > 1e4 * _SINGULAR * np.maximum(trace, 1.0)  # 1e4 covers the determinant's rounding error
    rest = np.flatnonzero(~solvable)
    if rest.size:
        eigenvalues = np.linalg.eigvalsh(sighted[rest])
        solvable[rest] = eigenvalues[:, 0] > _SINGULAR * np.maximum(eigenvalues[:, -1], 1.0)
    return solvable


def _covariance(
    geometry: Float[np.ndarray, "n m 4"], weight: Float[np.ndarray, "n m"], common_m: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, "n 4 4"]:
    """Return S (diag(σ² − c²) + c cᵀ) Sᵀ, where S diag(σ²) Sᵀ is (HᵀWH)⁻¹."""
    inverse = inverse_normal(geometry, weight)
    gain = np.einsum("nij,nmj,nm->nim", inverse, geometry, weight)
    shifts = gain * np.where(weight > 0, common_m, 0.0)[:, None]
    together = shifts.sum(axis=2)
    return inverse + together[:, :, None] * together[:, None] - np.einsum("nim,njm->nij", shifts, shifts)


def _flight_s(sent_m: Float[np.ndarray, "n m 3"], receiver_m: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n m"]:
    # A travel time without Earth rotation has an error of up to 0.15 µs. A Sagnac correction with such a travel time
    # has an error of 0.3 mm.
    apart = sent_m - receiver_m[:, None]
    flight_s = np.sqrt(np.einsum("nmi,nmi->nm", apart, apart)) / SPEED_OF_LIGHT_MPS
    apart = turned_with_earth(sent_m, flight_s) - receiver_m[:, None]
    return np.sqrt(np.einsum("nmi,nmi->nm", apart, apart)) / SPEED_OF_LIGHT_MPS


def _predict(
    sent_m: Float[np.ndarray, "n m 3"], receiver_m: Float[np.ndarray, "n 3"], used: Bool[np.ndarray, "n m"]
) -> tuple[Float[np.ndarray, "n m 4"], Float[np.ndarray, "n m"]]:
    """Return the matrix H and the predicted ranges."""
    apart = receiver_m[:, None] - turned_with_earth(sent_m, _flight_s(sent_m, receiver_m))
    ranges = np.sqrt(np.einsum("nmi,nmi->nm", apart, apart))
    rows = np.concatenate((apart / ranges[..., None], np.ones((*ranges.shape, 1))), axis=-1)
    return np.where(used[..., None] & np.isfinite(rows), rows, 0.0), ranges


def _solve(
    geometry: Float[np.ndarray, "n m 4"], weight: Float[np.ndarray, "n m"], residual: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, "n 4"]:
    """Return (HᵀWH)⁻¹HᵀW y, the weighted least-squares solution for the residuals y."""
    return np.einsum("nij,nmj,nm->ni", inverse_normal(geometry, weight), geometry, weight * residual)
