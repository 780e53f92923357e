"""RAIM as checks: whether the pseudoranges of an epoch agree, by residuals and by leaving one satellite out.

See `navigation/raim.py` for the theory. A pull of all satellites together, in time or in position, is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from vestige.acas_processor.monitors.judgement import check_budget, judged, not_run, two_sided_detection
from vestige.navigation.position_fix import UNKNOWNS, Fix, local_geometry
from vestige.navigation.raim import (
    NOT_EXCLUDED,
    chi_square_statistic,
    chi_square_threshold,
    degrees_of_freedom,
    exclude_one,
    missed_detection,
    redundancy,
    separation_factor,
    solution_separation,
)
from vestige.records import CheckResult

_AXES = ("east", "north", "up")


@dataclass(frozen=True, slots=True, kw_only=True)
class RaimMonitor:
    """Whether the residuals of a fix are those of independent errors with the σ of its weights.

    Attributes
    ----------
    p_fa
        False-alarm probability of one epoch.
    """

    p_fa: float = 1e-5

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "RAIM"

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "sigma²"

    def statistic(self, fix: Fix) -> Float[np.ndarray, " n"]:
        """Return T of every epoch, NaN without redundancy."""
        enough = fix.valid & (degrees_of_freedom(fix.weight) > 0)
        return np.where(enough, chi_square_statistic(fix.residual_m, fix.weight), np.nan)

    def threshold(self, fix: Fix) -> Float[np.ndarray, " n"]:
        """Return the threshold of every epoch, NaN without redundancy."""
        return chi_square_threshold(degrees_of_freedom(fix.weight), self.p_fa)

    def probability_of_detection(
        self, fix: Fix, column: int, bias_m: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, " k"]:
        """Return the probability that a bias on the satellite of a column is seen, in the first epoch of a fix."""
        share = redundancy(fix.geometry[:1], fix.weight[:1]).unexplained[0, column]
        freedom = int(degrees_of_freedom(fix.weight[:1])[0])
        return 1 - missed_detection(bias_m**2 * fix.weight[0, column] * share, freedom, self.p_fa)

    def check(self, fix: Fix | None, svids: Sequence[int], epoch: int = 0) -> CheckResult:
        """Return the check of one epoch; if it fails, the reason names the satellite that would explain it.

        Parameters
        ----------
        fix
            Fixes, None if there are none.
        svids
            Satellite of each column.
        epoch
            Row of the fix.
        """
        if fix is None or not fix.valid[epoch]:
            return not_run(self, "no position fix")
        if fix.n_used[epoch] <= UNKNOWNS:
            return not_run(self, f"{fix.n_used[epoch]} satellites leave nothing to compare")
        one = slice(epoch, epoch + 1)
        residual, weight = fix.residual_m[one], fix.weight[one]
        found = exclude_one(redundancy(fix.geometry[one], weight), residual, weight, self.p_fa)
        culprit = int(found.excluded[0])
        failure = "the pseudoranges do not agree, and no single satellite explains it"
        if culprit != NOT_EXCLUDED:
            failure = f"the pseudoranges do not agree; without E{svids[culprit]:02d} they do"
        return judged(self, float(self.statistic(fix)[epoch]), float(self.threshold(fix)[epoch]), failure)


def separations(fix: Fix) -> tuple[Float[np.ndarray, "n 3 m"], Int[np.ndarray, " n"]]:
    """Return |Δx_q|/σ_ss,q for east, north, up and every satellite, NaN where not defined, and how many are defined."""
    parts = redundancy(local_geometry(fix), fix.weight)
    separation = solution_separation(parts, fix.residual_m, fix.weight)
    sigma = separation.sigma_m[:, :3]
    # an axis that a satellite hardly touches has a σ of rounding errors
    touched = sigma > 1e-9
    modes = np.count_nonzero(np.isfinite(sigma[:, 2]), axis=1)
    return np.abs(separation.difference_m[:, :3]) / np.where(touched, sigma, np.nan), modes


def largest_separations(fix: Fix) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
    """Return `separations` of the satellite that has the largest, axis by axis, and how many satellites there are."""
    sigmas, modes = separations(fix)
    return _largest(sigmas), modes


def _largest(values: Float[np.ndarray, "*n k"]) -> Float[np.ndarray, "*n"]:
    """Return the largest number of the last axis, NaN where there is none."""
    known = np.isfinite(values)
    found = np.max(np.where(known, values, -np.inf), axis=-1, initial=-np.inf)
    return np.where(known.any(axis=-1), found, np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class SolutionSeparationMonitor:
    """Whether the position without each satellite is where the position with all is.

    The statistic is the largest |Δx_q|/(K_q σ_ss,q) over satellites and axes, so its threshold is 1.

    Attributes
    ----------
    p_fa_horizontal, p_fa_vertical
        False-alarm probabilities of one epoch, for both horizontal axes together and for the vertical one.
    """

    p_fa_horizontal: float = 9e-8  # LPV-200
    p_fa_vertical: float = 3.9e-6  # LPV-200

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "solution separation"

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "thresholds"

    @property
    def p_fa(self) -> float:
        """False-alarm probability of one epoch; a bound, as the modes depend on each other."""
        return self.p_fa_horizontal + self.p_fa_vertical

    @classmethod
    def of_budget(cls, p_fa: float) -> SolutionSeparationMonitor:
        """Return the monitor of one budget for all axes: half of it horizontal, half vertical."""
        return cls(p_fa_horizontal=p_fa / 2, p_fa_vertical=p_fa / 2)

    def factors(self, modes: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
        """Return K of east, north and up, for so many satellites left out in turn."""
        axes = (self.p_fa_horizontal / 2, self.p_fa_horizontal / 2, self.p_fa_vertical)
        counts, place = np.unique(modes, return_inverse=True)
        table = [[separation_factor(p_fa, max(count, 1)) for p_fa in axes] for count in counts.tolist()]
        return np.array(table, np.float64).reshape(-1, len(axes))[place]

    def ratios(self, fix: Fix) -> Float[np.ndarray, "n 3 m"]:
        """Return |Δx_q| over its threshold for east, north, up and every satellite; NaN where not defined."""
        sigmas, modes = separations(fix)
        return sigmas / self.factors(modes)[..., None]

    def statistic(self, fix: Fix) -> Float[np.ndarray, " n"]:
        """Return the largest ratio of every epoch, NaN without redundancy."""
        return self.over_threshold(*largest_separations(fix))

    def over_threshold(
        self, largest: Float[np.ndarray, "n 3"], modes: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Return `statistic` from what `largest_separations` found: that knows no budget, and this no fix."""
        return _largest(largest / self.factors(modes))

    def probability_of_detection(
        self, fix: Fix, column: int, bias_m: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, " k"]:
        """Return the probability that leaving out the biased satellite of a column shows it, in the first epoch.

        Other satellites may show it too: a lower bound.
        """
        share = redundancy(fix.geometry[:1], fix.weight[:1]).unexplained[0, column]
        used = int(fix.n_used[0])
        single = min(self.p_fa_horizontal / 2, self.p_fa_vertical, key=lambda p: separation_factor(p, used)) / used
        return two_sided_detection(bias_m * np.sqrt(fix.weight[0, column] * share), single)

    def check(self, fix: Fix | None, svids: Sequence[int], epoch: int = 0) -> CheckResult:
        """Return the check of one epoch; parameters are those of `RaimMonitor.check`."""
        if fix is None or not fix.valid[epoch]:
            return not_run(self, "no position fix")
        if fix.n_used[epoch] <= UNKNOWNS:
            return not_run(self, f"{fix.n_used[epoch]} satellites leave nothing to compare")
        ratios = self.ratios(fix)[epoch]
        axis, column = np.unravel_index(int(np.argmax(np.where(np.isfinite(ratios), ratios, -np.inf))), ratios.shape)
        failure = f"without E{svids[int(column)]:02d} the position moves too far {_AXES[axis]}"
        return judged(self, float(self.statistic(fix)[epoch]), 1.0, failure)
