"""False alarms of every check over a sky in the five nominal scenes, as the table of docs/checks/README.md.

python benchmarks/false_alarms.py [--hours 3] [--p-fa 0.001]

**Bold**: so many alarms, or where the budget (≤) is no bound as few, have less than one chance in a thousand.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import tempfile
from pathlib import Path

from vestige.acas_processor.monitors.cn0_expectation import Cn0Monitor
from vestige.campaign.monitoring import Track, tracks

from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test
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


def measured(settings: tuple[str, ...], seed: int, hours: float, p_fa: float) -> tuple[Track, ...]:
    """Return the checks of one scene, with ten satellites and a RECS every 10 s; slack for fading, if there is any."""
    base = ("constellation.svids=none", "recs.every=10", f"epochs={round(3600 * hours)}", f"seed={seed}")
    scenario = load_scenario(SKY, (*base, *settings))
    assert isinstance(scenario, CampaignScenario)
    with tempfile.TemporaryDirectory() as folder:
        results = run(ScenarioPlan(scenario=scenario), Path(folder) / "scene", workers=2).load()
    fading_db = 0.0 if scenario.receiver.multipath is None else Cn0Monitor().sigma_model_db
    return tracks(results, p_fa=p_fa, cn0_model_sigma_db=fading_db)


def entry(track: Track) -> str:
    """Return alarms of tests, bold where they do not fit the budget."""
    alarms = track.alarms
    chance = binomial_test(alarms.successes, alarms.trials, track.p_fa) if alarms.trials else 1.0
    off = chance < SIGNIFICANT and (track.exact or alarms.value > track.p_fa)
    text = f"{alarms.successes} of {alarms.trials}"
    text = text if track.exact else f"{text} ≤"
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
        print(f"| {row[0].name} | {row[0].p_fa:.2g} | " + " | ".join(entry(track) for track in row) + " |")


if __name__ == "__main__":
    main()
