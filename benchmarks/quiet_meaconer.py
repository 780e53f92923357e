"""A quiet meaconer of both bands that was there from the start: what level 2 says, over its delay and its power.

python benchmarks/quiet_meaconer.py [--seeds 6] [--early-reach-m 75]

The attacker receives the satellites 20 dB better than the victim, cancels nothing, and captures E1 because it is on air
before the receiver is. Eight satellites at 45 dBHz, two RECS. Printed are two tables in Markdown: the share of verdicts
with an alarm, and the share of satellites with a range in use that is wrong by more than 53 m (2κσ).
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from pathlib import Path

import numpy as np

import vestige as vs
from vestige.acas_processor.levels import is_alarm
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.scenario_processor import processor_of

SKY = Path(__file__).parents[1] / "scenarios" / "sky.toml"
DELAYS_M = (60.0, 80.0, 100.0, 150.0, 225.0, 300.0, 450.0, 570.0, 585.0, 600.0, 700.0, 900.0)
POWERS_DB = (1.0, 3.0, 6.0, 9.0, 12.0, 15.0)
WRONG_M = 53.0


def quiet_meaconer(delay_m: float, power_db: float, seed: int, *further: str) -> CampaignScenario:
    """Return the scene: a minute of sky.toml at level 2 with the meaconer on air from its first epoch on."""
    attack = (
        f'attack=[{{kind="meaconing", start_s=0, delay_s={delay_m / SPEED_OF_LIGHT_MPS}, power_db={power_db}, '
        "reception_gain_db=20}]"
    )
    settings = ("epochs=31", f"seed={seed}", "processor.level=2", attack, *further)
    scenario = load_scenario(SKY, settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


def alarms_and_wrong_ranges(scenario: CampaignScenario) -> tuple[float, float]:
    """Return the share of verdicts with an alarm, and of satellites with a wrong range in use, over all RECS."""
    source, processor = vs.simulate(scenario), processor_of(scenario)
    alarms, wrong = [], []
    delay_m = scenario.attack[0].delay_s * SPEED_OF_LIGHT_MPS
    for step in processor.steps(source, assistance=source.assistance):
        block = step.block
        recs = block.measured.snapshots.recs
        alarms.append(is_alarm(block.status)[recs])
        # E1 follows the meaconer, so its range is late by the delay; an earlier signal takes that back
        error_m = delay_m + np.where(block.earlier, block.true_offset_m, 0.0)
        wrong.append((np.isfinite(block.range_in_use_m) & (np.abs(error_m) > WRONG_M))[recs])
    return float(np.mean(np.concatenate(alarms))), float(np.mean(np.concatenate(wrong)))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--early-reach-m", type=float)
    options = parser.parse_args()
    further = () if options.early_reach_m is None else (f"processor.early_reach_m={options.early_reach_m}",)
    found = np.array(
        [
            [
                np.mean(
                    [
                        alarms_and_wrong_ranges(quiet_meaconer(delay_m, power_db, seed, *further))
                        for seed in range(options.seeds)
                    ],
                    axis=0,
                )
                for delay_m in DELAYS_M
            ]
            for power_db in POWERS_DB
        ]
    )
    for title, part in (("alarms", found[..., 0]), ("wrong ranges in use", found[..., 1])):
        print(f"\n| {title} | " + " | ".join(f"{one:.0f} m" for one in DELAYS_M) + " |")
        print("|---" * (len(DELAYS_M) + 1) + "|")
        for power_db, row in zip(POWERS_DB, part, strict=True):
            print(f"| {power_db:+.0f} dB | " + " | ".join(f"{one:.2f}" for one in row) + " |")


if __name__ == "__main__":
    main()
