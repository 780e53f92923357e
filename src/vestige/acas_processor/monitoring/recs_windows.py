"""Collect the last N RECS of a satellite, and test the scatter of their values about a straight line.

Theory of operation
-------------------
A window contains N successive detected RECS with the values y, the times t and the weights w = 1/variance. A straight
line represents unknown or slowly changing terms (a constant, the ionosphere, the elevation). The line is fitted and
subtracted:

    T = Σ w (y − a − b t)²        ~ χ²(N − 2) if noise alone scatters the values

Reflections scatter the values too. The part of y that comes from reflections, in phase or in quadrature, has a normal
distribution with the variance P/2. P is the mean power of the reflections relative to the direct signal. If the
reflections change with every RECS, all N − 2 degrees of freedom have the variance k = 1 + w P N/(2 (N − 2)). If a
reflection lasts for a time L, d/2 reflections follow each other in a window. Each reflection increases the variance of
two degrees of freedom, because its phase is free and its amplitude is constant:

    d = 2 max(1, ⌊(t_N − t_1)/L⌋), at most N − 2        k = 1 + w P N/(2 d)

A new window begins when tracking on E1 loses the satellite, because the constant term of y changes at this time.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, Shaped

from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.theory.variance_test import variance_threshold


class Recs(NamedTuple):
    """Detected RECS of a satellite in order of time: remembered RECS from before the block, then RECS of the block."""

    row: Int[np.ndarray, " k"]  # row of the RECS in the block; −1 for earlier RECS
    # number of epochs of the block, before the RECS, at which E1 did not track the satellite
    stretch: Int[np.ndarray, " k"]
    # the following fields are remembered from block to block
    time_s: Float[np.ndarray, " k"]  # time of the RECS in s after the first epoch that the receiver ever processed
    # phase of the punctual correlator minus the phase that E1 predicts, up to a constant; NaN if unknown
    phase_rad: Float[np.ndarray, " k"]
    # magnitude of the punctual correlator in standard deviations of the noise per dimension
    magnitude_sigma: Float[np.ndarray, " k"]
    cn0_e1_dbhz: Float[np.ndarray, " k"]
    # time over which the Doppler of E1 extrapolates the E1 phase to the middle of the RECS, in s
    extrapolated_s: Float[np.ndarray, " k"]


_REMEMBERED = Recs._fields[2:]


def recs_of_satellites(evidence: Evidence) -> Iterator[Recs]:
    """Yield the remembered and the new detected RECS of each satellite, in the order of the block's columns."""
    measured, snapshots = evidence.measured, evidence.measured.snapshots
    detected = measured.detected
    phase_rad = detected.phase_rad - measured.predicted_phase_rad
    extrapolated_s = np.abs(measured.extrapolated_s) + measured.banks.integration_s / 2
    of_recs = (phase_rad, detected.magnitude_sigma, snapshots.e1.cn0_dbhz, extrapolated_s)
    lost = np.cumsum(~snapshots.e1.seen, axis=0)
    for column, svid in enumerate(snapshots.svids):
        before = np.array(evidence.memory.get(svid, ()), np.float64).reshape(-1, len(_REMEMBERED)).T
        rows = np.flatnonzero(detected.tap[:, column] >= 0)
        now = [
            evidence.time_s[rows],
            *(values[rows, column] for values in of_recs),
        ]
        old = np.full(before.shape[1], -1)
        yield Recs(
            np.concatenate([old, rows]),
            np.concatenate([old + 1, lost[rows, column]]),
            *(np.concatenate(pair) for pair in zip(before, now, strict=True)),
        )


def remembered_recs(evidence: Evidence, most: int) -> CheckMemory:
    """Return for each satellite at most the last `most` RECS since E1 last lost the satellite, for the next block."""
    lost = np.count_nonzero(~evidence.measured.snapshots.e1.seen, axis=0)
    found = {}
    for column, recs in enumerate(recs_of_satellites(evidence)):
        last = np.flatnonzero(recs.stretch == lost[column])[-most:]
        if last.size:
            found[evidence.measured.snapshots.svids[column]] = tuple(np.stack(recs[2:])[:, last].T.ravel().tolist())
    return found


def last_of(values: Shaped[np.ndarray, " k"], n: int) -> Shaped[np.ndarray, "tests n"]:
    """Return a row for each value from the n-th on: this value and the n − 1 values before it."""
    if values.size < n:
        return np.zeros((0, n), values.dtype)
    return np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(values, n))


def scatter(
    time_s: Float[np.ndarray, "tests n"], values: Float[np.ndarray, "tests n"], weights: Float[np.ndarray, "tests n"]
) -> Float[np.ndarray, " tests"]:
    """Return T, the weighted sum of squared deviations from the fitted straight line."""
    total = np.sum(weights, axis=1)
    t = time_s - time_s[:, -1:]
    t = t - (np.sum(weights * t, axis=1) / total)[:, None]
    y = values - (np.sum(weights * values, axis=1) / total)[:, None]
    slope = np.sum(weights * t * y, axis=1) / np.sum(weights * t**2, axis=1)
    return np.sum(weights * (y - slope[:, None] * t) ** 2, axis=1)


def scatter_threshold(
    time_s: Float[np.ndarray, "tests n"],
    weights: Float[np.ndarray, "tests n"],
    ray_variance: Float[np.ndarray, " tests"],
    *,
    ray_life_s: float,
    p_fa: float,
) -> Float[np.ndarray, " tests"]:
    """Return the largest T that passes; `ray_variance` is P/2, and `ray_life_s` is L."""
    n = time_s.shape[1]
    span_s = time_s[:, -1] - time_s[:, 0]
    lives = np.floor(span_s / ray_life_s) if ray_life_s > 0 else np.full(span_s.shape, np.inf)
    wide = np.minimum(2 * np.maximum(lives, 1), n - 2).astype(np.int64)
    ratio = 1 + np.mean(weights, axis=1) * ray_variance * n / wide
    return variance_threshold(n - 2, wide, ratio, p_fa)
