"""Campaigns of a sky as tests need them: settings in, columns out, without a store."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "sky.toml"
CLEAN = (
    "receiver.multipath=none",
    "receiver.e1_multipath=none",
    "receiver.ionosphere=none",
    "position.ionosphere_sigma_m=0.0",
    "position.multipath_sigma_m=0.0",
    "position.floor_sigma_m=0.001",
)


def sky_scenario(*settings: str, path: Path = SCENARIO) -> CampaignScenario:
    """Return `scenarios/sky.toml` with some values replaced."""
    scenario = load_scenario(path, settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


def columns_of(scenario: CampaignScenario, chunk: int = 5000) -> dict[str, np.ndarray]:
    """Return all columns of a campaign, measured in chunks."""
    from vestige.campaign.scenario_plan import ScenarioPlan

    plan = ScenarioPlan(scenario=scenario)
    preparation, pieces = plan.prepare(), []
    for first in range(0, plan.n_epochs, chunk):
        count = min(chunk, plan.n_epochs - first)
        pieces.append(plan.measure(first, preparation.advance(first, count)))
    return {
        name: np.concatenate([piece[name] for piece in pieces], axis=column.dims.index("epoch"))
        for name, column in plan.columns.items()
    }
