"""Measure the verdicts of level 2 on a low-noise meaconer of both bands, against its delay and its power.

python benchmarks/quiet_meaconer.py [--seeds 6] [--early-reach-m 75] [--figure docs/levels/quiet_meaconer.png]

The attacker receives the satellites 20 dB better than the victim and cancels nothing. The meaconer captures E1, because
it is on air before the receiver starts. The scene has eight satellites at 45 dBHz and two RECS. The script prints two
tables in Markdown: the share of verdicts with an alarm, and the share of satellites with a range in use that is wrong
by more than 53 m (2κσ). With --figure the delays are 30 m apart. The figure shows the share of alarms for the
correlators of the processor and for correlators that reach 75 m to the early side.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
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
    """Return the scene: a minute of sky.toml at level 2, with the meaconer on air from the first epoch on."""
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
        # E1 follows the meaconer, so the E1 range is late by the delay; the range of an earlier signal corrects it
        error_m = delay_m + np.where(block.earlier, block.true_offset_m, 0.0)
        wrong.append((np.isfinite(block.range_in_use_m) & (np.abs(error_m) > WRONG_M))[recs])
    return float(np.mean(np.concatenate(alarms))), float(np.mean(np.concatenate(wrong)))


def shares(
    delays_m: Sequence[float], powers_db: Sequence[float], seeds: int, early_reach_m: float | None
) -> np.ndarray:
    """Return the shares of alarms and of wrong ranges, powers by delays by 2, over `seeds` runs of each."""
    further = () if early_reach_m is None else (f"processor.early_reach_m={early_reach_m}",)

    def mean(delay_m: float, power_db: float) -> np.ndarray:
        runs = [alarms_and_wrong_ranges(quiet_meaconer(delay_m, power_db, seed, *further)) for seed in range(seeds)]
        return np.mean(runs, axis=0)

    return np.array([[mean(delay_m, power_db) for delay_m in delays_m] for power_db in powers_db])


def draw(path: Path, seeds: int) -> None:
    """Draw the share of alarms over the delay with a curve for each power, for the usual correlators and for ±75 m."""
    delays_m, powers_db = np.arange(60.0, 901.0, 30.0), (1.0, 3.0, 6.0, 9.0)
    figure, axes = plt.subplots(2, 1, figsize=(7, 4.6), sharex=True, layout="constrained")
    for axis, reach_m in zip(axes, (600.0, 75.0), strict=True):
        alarms = shares(delays_m, powers_db, seeds, reach_m)[..., 0]
        for power_db, curve, width in zip(powers_db, alarms, (7.0, 5.0, 3.0, 1.2), strict=True):
            axis.plot(delays_m, curve, ".-", lw=width, ms=width + 3, label=f"{power_db:+.0f} dB")
        print(f"bank to {reach_m:.0f} m early: the smallest share of alarms is {alarms.min():.2f}")
        axis.set(ylim=(-0.05, 1.1), ylabel="verdicts with an alarm", title=f"correlators to {reach_m:.0f} m early")
    axes[0].legend(ncols=4, loc="lower center")
    axes[1].set_xlabel("delay of the meaconer (m)")
    figure.savefig(path, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--early-reach-m", type=float)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    if options.figure:
        draw(options.figure, options.seeds)
        return
    found = shares(DELAYS_M, POWERS_DB, options.seeds, options.early_reach_m)
    for title, part in (("alarms", found[..., 0]), ("wrong ranges in use", found[..., 1])):
        print(f"\n| {title} | " + " | ".join(f"{one:.0f} m" for one in DELAYS_M) + " |")
        print("|---" * (len(DELAYS_M) + 1) + "|")
        for power_db, row in zip(POWERS_DB, part, strict=True):
            print(f"| {power_db:+.0f} dB | " + " | ".join(f"{one:.2f}" for one in row) + " |")


if __name__ == "__main__":
    main()
