"""The checks over a campaign of a sky as tests of their rates need them: one false-alarm probability, ideal parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import xarray

from check_detection import P_FA, with_p_fa
from sky_builder import sky_scenario
from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import failures, judged_by
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test
from vestige.records.checks import CheckName, CheckSeries


def results_of(*settings: str) -> xarray.Dataset:
    """Return the results of `scenarios/sky.toml` with some values replaced."""
    return direct_results(ScenarioPlan(scenario=sky_scenario(*settings)))


def chance(check: CheckSeries, share: int = 1) -> float:
    """Return how likely so many failures are; of tests that depend on each other only one in `share` counts."""
    found = failures(check)
    return binomial_test(found.successes // share, found.trials // share, check.p_fa)


def checks_of(
    results: xarray.Dataset, p_fa: float = P_FA, *, drift_db: float = 0.0, cn0_model_sigma_db: float = 1.5
) -> Mapping[CheckName, CheckSeries]:
    """Return all checks of level 3 over the results of a campaign.

    Parameters
    ----------
    results
        Of a campaign.
    p_fa
        False-alarm probability of one test, of the three of the clock together.
    drift_db
        Drift of the front ends that the thresholds of power and noise floor allow for, 1σ; the simulated ones have
        none.
    cn0_model_sigma_db
        Spread of the C/N0 about the expectation that its threshold allows for, 1σ.
    """

    def change(processor: AcasProcessor) -> AcasProcessor:
        other = with_p_fa(p_fa)(processor)
        settings = other.monitoring
        return replace(
            other,
            monitoring=replace(
                settings,
                e1_power=replace(settings.e1_power, sigma_system_db=drift_db),
                e6_power=replace(settings.e6_power, sigma_system_db=drift_db),
                noise_floor=replace(settings.noise_floor, sigma_system_db=drift_db),
                e1_cn0=replace(settings.e1_cn0, sigma_model_db=cn0_model_sigma_db),
            ),
        )

    return judged_by(results, change).checks
