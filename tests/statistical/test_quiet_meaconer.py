"""A low-noise meaconer with a short delay: level 2 detects it at every delay, and uses the true range.

Both bands, reception gain 20 dB, on air from the start, nothing cancelled. E1 follows the meaconer. The search on E1
leaves out two chips, 586 m, around the tracked signal; there the bank of correlators on E6 has to find the true one.
benchmarks/quiet_meaconer.py draws the whole table, which docs/levels/README.md has.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vestige as vs
from vestige.acas_processor.levels import is_alarm
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.scenario_processor import processor_of

SKY = Path(__file__).resolve().parents[2] / "scenarios" / "sky.toml"


def judged(delay_m: float, level: int, *settings: str) -> tuple[np.ndarray, np.ndarray, VerdictBlock]:
    """Return alarms and errors of the ranges in use in m of a scene with one RECS."""
    attack = (
        f'attack=[{{kind="meaconing", start_s=0, delay_s={delay_m / SPEED_OF_LIGHT_MPS}, power_db=3, '
        "reception_gain_db=20}]"
    )
    scenario = load_scenario(SKY, ("epochs=1", f"processor.level={level}", attack, *settings))
    assert isinstance(scenario, CampaignScenario)
    source, processor = vs.simulate(scenario), processor_of(scenario)
    (step,) = processor.steps(source, assistance=source.assistance)
    block = step.block
    error_m = delay_m + np.where(block.earlier, block.true_offset_m, 0.0)
    return is_alarm(block.status), np.where(np.isfinite(block.range_in_use_m), error_m, np.nan), block


@pytest.mark.judged(
    by="truth of the simulation",
    what="level 2 under a low-noise meaconer",
    figure="an alarm at each delay, range in use within 53 m",
)
@pytest.mark.parametrize("delay_m", [60.0, 75.0, 100.0, 150.0, 300.0, 450.0, 570.0, 585.0, 600.0, 900.0])
def test_level_2_sees_it_and_uses_the_true_range(delay_m: float) -> None:
    alarms, error_m, _ = judged(delay_m, 2)
    assert alarms.all()
    assert np.count_nonzero(np.isfinite(error_m)) >= 6
    assert np.nanmax(np.abs(error_m)) < 53  # 2 κσ


@pytest.mark.parametrize("delay_m", [150.0, 300.0, 570.0])
def test_level_1_sees_it_too_and_a_short_bank_does_not(delay_m: float) -> None:
    assert judged(delay_m, 1)[0].all()
    assert not judged(delay_m, 2, "processor.early_reach_m=75")[0].any()


def test_at_fidelity_samples() -> None:
    alarms, error_m, _ = judged(300.0, 1, 'fidelity="samples"', "constellation.svids=[7, 13]")
    assert alarms.all()
    assert np.nanmax(np.abs(error_m)) < 53
