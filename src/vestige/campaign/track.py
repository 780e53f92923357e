"""One check over a campaign: what it looked at, what it allowed, how often it failed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from vestige.campaign.results import scenario_of
from vestige.campaign.statistics import Proportion, proportion
from vestige.errors import VestigeError
from vestige.receiver.clock import TwoStateClock
from vestige.scenario.stored import StoredScenario

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """One check over a campaign; satellites along a second axis, if it is of satellites.

    Attributes
    ----------
    name, unit
        As in `CheckResult`.
    p_fa
        False-alarm probability of one test.
    statistic, threshold
        The check fails where |statistic| > threshold; NaN where it was not run.
    exact
        Whether p_fa is meant to be met; otherwise it is a bound.
    """

    name: str
    unit: str
    p_fa: float
    statistic: Float[np.ndarray, "*n"]
    threshold: Float[np.ndarray, "*n"]
    exact: bool = True

    @property
    def run(self) -> Bool[np.ndarray, "*n"]:
        """Whether the check was run."""
        return np.isfinite(self.statistic) & np.isfinite(self.threshold)

    @property
    def failed(self) -> Bool[np.ndarray, "*n"]:
        """Whether the check was run and failed."""
        return self.run & (np.abs(self.statistic) > self.threshold)

    @property
    def alarms(self) -> Proportion:
        """Failures of all tests that were run."""
        return proportion(int(np.count_nonzero(self.failed)), int(np.count_nonzero(self.run)))


def observed_scenario(results: xarray.Dataset) -> StoredScenario:
    """Return the scenario of results that hold observations of E1.

    Raises
    ------
    VestigeError
        If they hold none.
    """
    if "e1_taps" not in results:
        raise VestigeError("results of a campaign: found no e1_taps, expected a [constellation], or level 2 or 3")
    return scenario_of(results)


def oscillator(scenario: StoredScenario) -> TwoStateClock:
    """Return the receiver's oscillator of a scenario; one without noise if there is no clock."""
    return scenario.receiver.clock or TwoStateClock(h0_s=0.0, h_minus_2_hz=0.0)
