"""Measure the false alarms of every check over a sky in the five nominal scenes: the table of docs/checks/README.md.

python benchmarks/false_alarms.py [--hours 3] [--p-fa 0.001]

A number is **bold** if so many alarms have a probability below 1e-3. For a check with an exact budget, the number is
also bold if so few alarms have such a probability. "≤" marks a budget that is an upper limit.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))  # a helper that the tests and this script share

from check_detection import with_p_fa
from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.levels import failures, judged_by
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test
from vestige.records.checks import CheckSeries
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SKY = Path(__file__).parents[1] / "scenarios" / "sky.toml"
SIGNIFICANT = 1e-3
NO_RAYS = ("receiver.multipath=none", "receiver.e1_multipath=false", "position.multipath_sigma_m=0.0")
NO_IONOSPHERE = ("receiver.ionosphere=none", "position.ionosphere_sigma_m=0.0")
HARSH_IONOSPHERE = ('receiver.ionosphere.preset="2014"', "position.ionosphere_sigma_m=2.7")
SCENES = {
    "clean": (*NO_RAYS, *NO_IONOSPHERE, "position.floor_sigma_m=0.001"),
    "harsh": HARSH_IONOSPHERE,
    "iono 2014": (*NO_RAYS, *HARSH_IONOSPHERE),
    "iono 2017": NO_RAYS,
    "multipath": NO_IONOSPHERE,
}


def with_steady_front_ends(processor: AcasProcessor) -> AcasProcessor:
    """Return a processor that allows for no drift of the front ends, because simulated front ends have no drift."""
    settings = processor.monitoring
    steady = {
        name: replace(getattr(settings, name), sigma_system_db=0.0) for name in ("e1_power", "e6_power", "noise_floor")
    }
    return replace(processor, monitoring=replace(settings, **steady))


def measured(settings: tuple[str, ...], seed: int, hours: float, p_fa: float) -> tuple[CheckSeries, ...]:
    """Return the checks of a scene with ten satellites and a RECS every 10 s."""
    base = ("constellation.svids=none", "recs.every=10", f"epochs={round(3600 * hours)}", f"seed={seed}")
    scenario = load_scenario(SKY, (*base, *settings))
    assert isinstance(scenario, CampaignScenario)
    with tempfile.TemporaryDirectory() as folder:
        results = run(ScenarioPlan(scenario=scenario), Path(folder) / "scene", workers=2).load()
    found = judged_by(results, lambda processor: with_steady_front_ends(with_p_fa(p_fa)(processor)))
    return tuple(found.checks.values())


def entry(check: CheckSeries) -> str:
    """Return the failed tests as text, bold if their number contradicts the budget."""
    failed = failures(check)
    chance = binomial_test(failed.successes, failed.trials, check.p_fa) if failed.trials else 1.0
    off = chance < SIGNIFICANT and (check.exact or failed.value > check.p_fa)
    text = f"{failed.successes} of {failed.trials}"
    text = text if check.exact else f"{text} ≤"
    return f"**{text}**" if off else text


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=3.0)
    parser.add_argument("--p-fa", type=float, default=1e-3)
    options = parser.parse_args()
    columns = {
        name: measured(settings, 1000 + number, options.hours, options.p_fa)
        for number, (name, settings) in enumerate(SCENES.items())
    }
    print("| check | budget | " + " | ".join(columns) + " |")
    print("|---" * (2 + len(columns)) + "|")
    for row in zip(*columns.values(), strict=True):
        print(f"| {row[0].name} | {row[0].p_fa:.2g} | " + " | ".join(entry(check) for check in row) + " |")


if __name__ == "__main__":
    main()
