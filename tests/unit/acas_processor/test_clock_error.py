"""The error that the E1 ranges show of the receiver's clock, and what the searches and ranges make of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_sky import ORBITS, exact_block
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.position.clock_error import TRAVEL_SPREAD_S, clock_error
from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Assistance
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SKY = Path(__file__).resolve().parents[3] / "scenarios" / "sky.toml"
PLACE = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)


@pytest.mark.parametrize("error_s", [-0.3, 0.5])
def test_a_fix_shows_it_to_metres_and_travel_times_to_20_ms(error_s: float) -> None:
    block = exact_block(PLACE, np.zeros(1))
    e1 = replace(block.e1, pseudorange_m=block.e1.pseudorange_m + error_s * SPEED_OF_LIGHT_MPS)
    block = replace(block, e1=e1, time_uncertainty_s=np.ones(1))
    for ephemerides, tolerance_s in ((ORBITS, 1e-5), ({}, TRAVEL_SPREAD_S)):
        settings = MonitoringSettings(fix=FixSettings(ephemerides=ephemerides))
        measured = AcasProcessor(level=2, monitoring=settings).step(None, block, Assistance()).block.measured
        shown = clock_error(measured)
        assert shown.of_fix[0] == bool(ephemerides)
        assert np.isfinite(shown.sigma_m[0]) == bool(ephemerides)
        assert shown.error_s[0] == pytest.approx(error_s, abs=tolerance_s)


@pytest.mark.parametrize("offset_s", [-0.5, 0.5])
def test_a_clock_that_is_as_wrong_as_its_limit_allows_keeps_its_ranges(offset_s: float) -> None:
    """Nobody sets the clock by the first fix: its limit must not become 1 µs around zero, or no range would fit."""
    settings = (
        "epochs=70",
        "processor.level=2",
        f"receiver.clock_offset_s={offset_s}",
        "receiver.time_uncertainty_s=1.0",
    )
    scenario = load_scenario(SKY, settings)
    assert isinstance(scenario, CampaignScenario)
    results = direct_results(ScenarioPlan(scenario=scenario))
    in_use = np.isfinite(results["range_in_use_m"].values)
    rows = np.flatnonzero(in_use.any(axis=1))
    assert rows.size == 3
    assert in_use[rows].all()
