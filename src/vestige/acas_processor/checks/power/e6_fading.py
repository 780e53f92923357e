"""Check whether E6 fades from RECS to RECS more than noise and multipath allow [WFO, Sec. VI-B, figures 12, 13].

Theory of operation
-------------------
The phase of a second signal of relative amplitude a changes relative to the phase of the true signal. The second signal
therefore increases the magnitude of the correlator in some RECS and reduces the magnitude in other RECS. For small a,
the variance of these changes is about a²/2 relative to the power of the true signal. The magnitude m of the detecting
correlator is in standard deviations of the noise per dimension, and its mean is m̄. The statistic is √(T/(N − 2)). T is
the scatter of m about a straight line over the last N RECS, relative to the noise (`monitoring/recs_windows.py`).
Without reflections the variance of m is

    σ² = 1 + (ρ m̄)²

Reflections with the mean power P, relative to the true signal, add the variance m̄² P/2. The antenna gain, and the
position of the signal between two correlators, change m from RECS to RECS by the relative amount ρ.

The check needs no carrier phase of E1, so it runs with any interval between RECS.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import ClassVar

import numpy as np

from vestige.acas_processor.checks.check import Monitor, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.acas_processor.monitoring.recs_windows import (
    last_of,
    recs_of_satellites,
    remembered_recs,
    scatter,
    scatter_threshold,
)
from vestige.navigation.elevation_model import relative_ray_amplitude
from vestige.records.checks import CheckName, CheckSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class E6FadingMonitor(Monitor):
    """Monitor of the E6 magnitude: it fails if the magnitude scatters more than noise and multipath allow.

    Attributes
    ----------
    window
        N, number of RECS of a test.
    ray_power_db
        P, mean power of all reflections over the direct signal in dB, at 16° of elevation.
    ray_life_s
        L, duration of a reflection in s: 0 if each RECS has other reflections, infinite if the duration is unknown.
    gain_sigma_db
        ρ in dB: standard deviation of the magnitude from RECS to RECS that is not caused by noise or reflections.
    p_fa
        False-alarm probability of one test of one satellite, an upper limit.
    """

    name: ClassVar = CheckName.E6_FADING
    unit: ClassVar = "sigma"
    window: int = 30
    ray_power_db: float = -15.8
    ray_life_s: float = inf
    gain_sigma_db: float = 0.3
    p_fa: float = 1e-6

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block; each test uses the last N RECS of a satellite."""
        n = self.window
        statistic, threshold = np.full((2, *evidence.shape), np.nan)
        relative = relative_ray_amplitude(evidence.elevation_rad)
        for column, recs in enumerate(recs_of_satellites(evidence)):
            ends_here = recs.row[n - 1 :] >= 0
            rows = recs.row[n - 1 :][ends_here]
            time_s, magnitude, stretch = (
                last_of(values, n)[ends_here] for values in (recs.time_s, recs.magnitude_sigma, recs.stretch)
            )
            whole = (stretch[:, 0] == stretch[:, -1]) & np.all(np.diff(time_s, axis=1) > 0, axis=1)
            level = np.mean(magnitude, axis=1)[:, None]
            variance = 1 + (level * (10 ** (self.gain_sigma_db / 20) - 1)) ** 2
            power = 10 ** (self.ray_power_db / 10) * relative[rows, column] ** 2
            with np.errstate(invalid="ignore", divide="ignore"):
                t = scatter(time_s, magnitude, np.broadcast_to(1 / variance, magnitude.shape))
            weights = np.broadcast_to(level**2 / variance, magnitude.shape)
            limit = scatter_threshold(time_s, weights, power / 2, ray_life_s=self.ray_life_s, p_fa=self.p_fa)
            statistic[rows, column] = np.where(whole, np.sqrt(t / (n - 2)), np.nan)
            threshold[rows, column] = np.where(whole, np.sqrt(limit / (n - 2)), np.nan)

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if evidence.measured.detected.tap[here] < 0:
                return "nothing was detected on E6"
            if np.isnan(statistic[here]):
                return f"fewer than {n} RECS in a row since E1 began to track the satellite"
            return f"the magnitude of E6 scatters {statistic[here]:.1f} times as much as noise does"

        return series_of(self, statistic, threshold, explain)

    def remember(self, evidence: Evidence) -> CheckMemory:
        """Return at most the last N − 1 detected RECS of each satellite that is still tracked on E1."""
        return remembered_recs(evidence, self.window - 1)
