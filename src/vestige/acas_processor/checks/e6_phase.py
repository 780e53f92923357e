"""Check whether the E6 carrier phase follows the E1 phase from RECS to RECS [WFO, Sec. VI-B, figures 12 and 13].

Theory of operation
-------------------
One oscillator drives both front ends. Geometry, troposphere and clocks change the ranges of both carriers by the same
amount. The phase φ is the phase of the detecting correlator minus the phase that the E1 carrier predicts
(`searches/handover.py`). Without a second signal, only the ionosphere, noise and multipath change φ. A second E6 signal
of small relative amplitude a adds about a²/2 to the variance of φ while the range difference between the two signals
changes. The phase between the two signals turns once for each 23.4 cm of their range difference. The statistic is
√(T/(N − 2)). T is the scatter of φ about a straight line over the last N RECS, relative to the noise
(`monitoring/recs_windows.py`). Noise gives φ at each RECS the variance

    σ² = 1/m² + (f6/f1)² (σ_PLL² + (2π σ_FLL Δt)²)

The magnitude m of the correlator is in standard deviations of the noise per dimension. The carrier frequencies of E1
and E6 are f1 and f6. The noise of the E1 loops at the C/N0 of E1 has the standard deviations σ_PLL and σ_FLL. The E1
Doppler extrapolates the E1 phase over the time Δt to the middle of the RECS.

Between two RECS the phase is known up to whole turns. The check takes the smallest of the possible phase steps. The
check relies on this choice only if

    (2π/λ6) v |t_k − t_{k−1}| + 4 √(σ_k² + σ_{k−1}² + P) < π

v is the fastest change of the range difference E6 − E1 by the ionosphere, and λ6 is the wavelength of E6. P is the mean
power of all reflections over the power of the direct signal. If this condition is false for any step between the N
RECS, the check is not run. The check is not run either if the N RECS take more than 120 s, because the ionosphere
changes linearly only over a shorter time. `p_fa` assumes that φ has only noise and multipath about a straight line. An
ionosphere that does not change linearly raises the false-alarm rate. False alarms were measured for `p_fa` = 10⁻⁶ and
reflections that change with each RECS. Without a spoofer, 73 of 59,677 overlapping windows of 100 RECS failed, and no
window of 30 RECS failed (docs/checks). At 35 dBHz and v = 3 mm/s the condition is true up to 27 s between two RECS.
With a RECS every 30 s, a window of 30 RECS takes more than 120 s, so the check is not run.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.checks.check import Monitor, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.acas_processor.monitoring.recs_windows import (
    Recs,
    last_of,
    recs_of_satellites,
    remembered_recs,
    scatter,
    scatter_threshold,
)
from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.elevation_model import relative_ray_amplitude
from vestige.records.checks import CheckName, CheckSeries
from vestige.theory.thermal_noise import fll_variance_hz2, pll_variance_rad2

STRAIGHT_S = 120.0  # longest time over which a straight line describes the ionosphere, in s
_SURE = 4.0  # largest change of a phase step by noise and reflections, in standard deviations


class _Tested(NamedTuple):
    """Properties of windows of N RECS; each test has a window."""

    scatter: Float[np.ndarray, " tests"]  # T, the scatter of φ about a straight line relative to the noise
    limit: Float[np.ndarray, " tests"]  # threshold of T
    whole: Bool[np.ndarray, " tests"]  # whether each RECS has a phase, and E1 was tracked without a gap
    continued: Bool[np.ndarray, " tests"]  # whether the number of whole turns is known from each RECS to the next
    straight: Bool[np.ndarray, " tests"]  # whether a straight line describes the ionosphere


@dataclass(frozen=True, slots=True, kw_only=True)
class E6PhaseMonitor(Monitor):
    """Monitor of φ, the E6 phase minus its prediction: it fails if φ scatters more than noise and multipath allow.

    Attributes
    ----------
    window
        N, number of RECS of a test.
    ray_power_db
        P, mean power of all reflections over the direct signal in dB, at 16° of elevation.
    ray_life_s
        L, duration of a reflection in s: 0 if the reflections change with each RECS, infinite if the duration is
        unknown.
    change_mps
        v, fastest change of the range difference E6 − E1 by the ionosphere, in m/s.
    pll_bandwidth_hz, fll_bandwidth_hz, loop_integration_s
        One-sided bandwidths of the phase and the frequency loop of E1 in Hz, and the integration time of both loops in
        s.
    p_fa
        False-alarm probability of one test of one satellite, an upper limit while the ionosphere changes linearly.
    """

    name: ClassVar = CheckName.E6_PHASE
    unit: ClassVar = "sigma"
    window: int = 30
    ray_power_db: float = -15.8
    ray_life_s: float = inf
    change_mps: float = 0.003
    pll_bandwidth_hz: float = 18.0
    fll_bandwidth_hz: float = 5.0
    loop_integration_s: float = 20e-3
    p_fa: float = 1e-6

    def variance_rad2(
        self,
        magnitude_sigma: Float[np.ndarray, "*n"],
        cn0_e1_dbhz: Float[np.ndarray, "*n"],
        extrapolated_s: Float[np.ndarray, "*n"],
    ) -> Float[np.ndarray, "*n"]:
        """Return σ², the part of the variance of φ that noise causes at each RECS, in rad²."""
        cn0_hz = 10 ** (cn0_e1_dbhz / 10)
        loops = {"integration_s": self.loop_integration_s}
        of_phase = pll_variance_rad2(cn0_hz, bandwidth_hz=self.pll_bandwidth_hz, **loops)
        of_doppler = fll_variance_hz2(cn0_hz, bandwidth_hz=self.fll_bandwidth_hz, **loops)
        of_e1 = of_phase + of_doppler * (2 * pi * extrapolated_s) ** 2
        return 1 / magnitude_sigma**2 + (E6_CARRIER_HZ / E1_CARRIER_HZ) ** 2 * of_e1

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block; each test uses the last N RECS of a satellite."""
        statistic, threshold = np.full((2, *evidence.shape), np.nan)
        far, long = np.zeros((2, *evidence.shape), np.bool_)
        relative = relative_ray_amplitude(evidence.elevation_rad)
        for column, recs in enumerate(recs_of_satellites(evidence)):
            ends_here = recs.row[self.window - 1 :] >= 0
            rows = recs.row[self.window - 1 :][ends_here]
            power = 10 ** (self.ray_power_db / 10) * relative[rows, column] ** 2
            found = self._tested(recs, ends_here, power)
            far[rows, column], long[rows, column] = found.whole & ~found.continued, found.whole & ~found.straight
            tested = found.whole & found.continued & found.straight
            statistic[rows, column] = np.where(tested, np.sqrt(found.scatter / (self.window - 2)), np.nan)
            threshold[rows, column] = np.where(tested, np.sqrt(found.limit / (self.window - 2)), np.nan)

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            measured = evidence.measured
            if measured.detected.tap[here] < 0:
                return "nothing was detected on E6"
            if np.isnan(measured.predicted_phase_rad[here]):
                return "E1 has no carrier phase"
            if far[here]:
                return "RECS are too far apart: the phase may turn by more than half a turn from one to the next"
            if long[here]:
                return f"the last {self.window} RECS take more than {STRAIGHT_S:g} s"
            if np.isnan(statistic[here]):
                return f"fewer than {self.window} RECS in a row with a carrier phase of E1 without a gap"
            return f"the phase of E6 scatters about that of E1 {statistic[here]:.1f} times as much as noise does"

        return series_of(self, statistic, threshold, explain)

    def remember(self, evidence: Evidence) -> CheckMemory:
        """Return at most the last N − 1 detected RECS of each satellite that is still tracked on E1."""
        return remembered_recs(evidence, self.window - 1)

    def _tested(self, recs: Recs, ends_here: Bool[np.ndarray, " k"], power: Float[np.ndarray, " tests"]) -> _Tested:
        """Return the properties of each window that ends in the block; `ends_here` marks these windows."""
        n = self.window
        variance = self.variance_rad2(recs.magnitude_sigma, recs.cn0_e1_dbhz, recs.extrapolated_s)
        time_s, phase_rad, variance, stretch = (
            last_of(values, n)[ends_here] for values in (recs.time_s, recs.phase_rad, variance, recs.stretch)
        )
        whole = (stretch[:, 0] == stretch[:, -1]) & np.all(np.isfinite(phase_rad + variance), axis=1)
        apart_s = np.diff(time_s, axis=1)
        steps = np.diff(phase_rad, axis=1)
        steps -= 2 * pi * np.round(steps / (2 * pi))
        spread = np.sqrt(variance[:, 1:] + variance[:, :-1] + power[:, None])
        moved = 2 * pi * E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * self.change_mps * apart_s
        continued = np.all(moved + _SURE * spread < pi, axis=1) & np.all(apart_s > 0, axis=1)
        values = np.cumsum(np.concatenate([np.zeros((len(steps), 1)), steps], axis=1), axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            t = scatter(time_s, values, 1 / variance)
        limit = scatter_threshold(time_s, 1 / variance, power / 2, ray_life_s=self.ray_life_s, p_fa=self.p_fa)
        return _Tested(t, limit, whole, continued, time_s[:, -1] - time_s[:, 0] <= STRAIGHT_S)
