"""Check by solution separation whether the positions with and without each satellite agree.

See `navigation/raim.py` for the theory. The check does not detect an attack that shifts the ranges of all satellites
consistently, in time or in position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from vestige.acas_processor.checks.check import Monitor, series_of, two_sided_detection
from vestige.acas_processor.evidence import Evidence
from vestige.navigation.position_fix import UNKNOWNS, Fix, local_geometry
from vestige.navigation.raim import redundancy, separation_factor, solution_separation
from vestige.records.checks import CheckName, CheckSeries

_AXES = ("east", "north", "up")


def separations(fix: Fix) -> tuple[Float[np.ndarray, "n 3 m"], Int[np.ndarray, " n"]]:
    """Return the separations in σ by axis and satellite, and the number of satellites left out in turn.

    A separation is |Δx_q|/σ_ss,q. Δx_q is the difference on the axis q between the positions with and without the
    satellite, and σ_ss,q is the standard deviation of Δx_q. Undefined separations are NaN.
    """
    parts = redundancy(local_geometry(fix), fix.weight)
    separation = solution_separation(parts, fix.residual_m, fix.weight)
    sigma = separation.sigma_m[:, :3]
    # If a satellite hardly affects an axis, the computed σ consists of rounding errors only.
    touched = sigma > 1e-9
    modes = np.count_nonzero(np.isfinite(sigma[:, 2]), axis=1)
    return np.abs(separation.difference_m[:, :3]) / np.where(touched, sigma, np.nan), modes


def largest_separations(fix: Fix) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
    """Return the largest value of `separations` on each axis, and the number of satellites left out in turn."""
    sigmas, modes = separations(fix)
    return _largest(sigmas), modes


def _largest(values: Float[np.ndarray, "*n k"]) -> Float[np.ndarray, "*n"]:
    """Return the largest value along the last axis; NaN where all values are NaN."""
    known = np.isfinite(values)
    found = np.max(np.where(known, values, -np.inf), axis=-1, initial=-np.inf)
    return np.where(known.any(axis=-1), found, np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class SolutionSeparationMonitor(Monitor):
    """Monitor that compares the position without each satellite with the position from all satellites.

    The statistic is the largest |Δx_q|/(K_q σ_ss,q) over satellites and axes q, so its threshold is 1. `separations`
    computes |Δx_q|/σ_ss,q, and `factors` computes K_q.
    """

    name: ClassVar = CheckName.SOLUTION_SEPARATION
    unit: ClassVar = "thresholds"
    p_fa_horizontal: float = 9e-8  # false-alarm probability of one epoch, both horizontal axes together (LPV-200)
    p_fa_vertical: float = 3.9e-6  # false-alarm probability of one epoch, vertical axis (LPV-200)

    @property
    def p_fa(self) -> float:
        """False-alarm probability of one epoch; an upper limit, because it is a sum over axes and satellites."""
        return self.p_fa_horizontal + self.p_fa_vertical

    @classmethod
    def of_budget(cls, p_fa: float) -> SolutionSeparationMonitor:
        """Return the monitor that gives half of `p_fa` to the horizontal axes and half to the vertical axis."""
        return cls(p_fa_horizontal=p_fa / 2, p_fa_vertical=p_fa / 2)

    def factors(self, modes: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
        """Return the factor K for east, north and up; `modes` is the number of satellites left out in turn."""
        axes = (self.p_fa_horizontal / 2, self.p_fa_horizontal / 2, self.p_fa_vertical)
        counts, place = np.unique(modes, return_inverse=True)
        table = [[separation_factor(p_fa, max(count, 1)) for p_fa in axes] for count in counts.tolist()]
        return np.array(table, np.float64).reshape(-1, len(axes))[place]

    def ratios(self, fix: Fix) -> Float[np.ndarray, "n 3 m"]:
        """Return |Δx_q| divided by its threshold for east, north, up and every satellite; NaN where undefined."""
        sigmas, modes = separations(fix)
        return sigmas / self.factors(modes)[..., None]

    def statistic(self, fix: Fix) -> Float[np.ndarray, " n"]:
        """Return the largest value of `ratios` at every epoch; NaN without redundancy."""
        return self.over_threshold(*largest_separations(fix))

    def over_threshold(
        self, largest: Float[np.ndarray, "n 3"], modes: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Return the statistic of each epoch from the result of `largest_separations`, without the fix itself."""
        return _largest(largest / self.factors(modes))

    def probability_of_detection(
        self, fix: Fix, column: int, bias_m: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, " k"]:
        """Return the probability, at the first epoch, that omitting the biased satellite of `column` reveals the bias.

        The result is a lower limit, because omitting another satellite may reveal the bias too.
        """
        share = redundancy(fix.geometry[:1], fix.weight[:1]).unexplained[0, column]
        used = int(fix.n_used[0])
        single = min(self.p_fa_horizontal / 2, self.p_fa_vertical, key=lambda p: separation_factor(p, used)) / used
        return two_sided_detection(bias_m * np.sqrt(fix.weight[0, column] * share), single)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return statistic and threshold of the check for every epoch of a block."""
        fix, svids = evidence.measured.fix, evidence.measured.snapshots.svids
        nothing = np.full(evidence.shape[0], np.nan)
        used = np.zeros(evidence.shape[0], np.int64) if fix is None else fix.satellites
        statistic = nothing if fix is None else self.over_threshold(fix.separation_sigmas, fix.separation_modes)

        def explain(epoch: int, _satellite: int) -> str:
            if fix is None or not used[epoch]:
                return "no position fix"
            if used[epoch] <= UNKNOWNS:
                return f"{used[epoch]} satellites give a position, but no further range to compare"
            ratios = self.ratios(fix.at(epoch))[0]
            known = np.where(np.isfinite(ratios), ratios, -np.inf)
            axis, column = np.unravel_index(int(np.argmax(known)), known.shape)
            svid = svids[int(column)]
            return f"without E{svid:02d} the position moves too far {_AXES[axis]}"

        return series_of(self, statistic, np.ones(statistic.shape), explain)
