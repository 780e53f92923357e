"""Campaigns of a sky as tests need them: settings in, snapshots or columns out, without a store."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.records.snapshot_block import SnapshotBlock
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


def whole_block(scenario: CampaignScenario) -> tuple[SnapshotBlock, tuple[TruthBlock, ...]]:
    """Return all snapshots of a campaign as one block, and their truth."""
    receiver = scenario.simulated_receiver
    truth = tuple(one.advance(0, scenario.epochs) for one in receiver.truth())
    return receiver.snapshots(0, truth), truth


def e1_of(scenario: CampaignScenario) -> dict[str, np.ndarray]:
    """Return correlators and power of E1, the C/N0 of each satellite without interference, and the noise that rose."""
    block, truth = whole_block(scenario)
    assert block.e1.taps is not None
    strengths = [
        one.cn0_e1_dbhz + 20 * np.log10(own.geometry.amplitude)
        for one, own in zip(scenario.simulations, truth, strict=True)
    ]
    return {
        "taps": block.e1.taps,
        "power_db": block.front_end[Band.E1].total_power_db,
        "cn0_dbhz": np.stack(strengths, axis=1),
        "noise_rise_db": 10 * np.log10(1 + truth[0].e1_attack.rise(Band.E1)),
    }


def columns_of(scenario: CampaignScenario, chunk: int = 5000) -> dict[str, np.ndarray]:
    """Return all columns of a campaign, measured and judged in chunks."""
    from vestige.campaign.scenario_plan import ScenarioPlan

    plan = ScenarioPlan(scenario=scenario)
    preparation, state, pieces = plan.prepare(), None, []
    for first in range(0, plan.n_epochs, chunk):
        count = min(chunk, plan.n_epochs - first)
        state, piece = plan.judge(state, first, plan.measure(first, preparation.advance(first, count)))
        pieces.append(piece)
    return {
        name: np.concatenate([piece[name] for piece in pieces], axis=column.dims.index("epoch"))
        for name, column in plan.columns.items()
    }
