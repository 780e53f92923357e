"""Measure how each check detects its attack over the simulated sky, against the strength of the attack.

python benchmarks/detection_curves.py -o folder [--seeds 20] [--only clock]

The folder gets a figure and a CSV table for each attack; the tables are printed as in docs/checks. Multipath,
ionosphere, clock and sensors are those of scenarios/sky.toml, and budgets are 1e-5. The thresholds of power and noise
floor allow for a drift of the front end of 0.3 dB, as in the levels. A check detects the attack if it fails for any
satellite while the attack acts. Counts have intervals.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import csv
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))  # a helper that the tests and this script share

from check_detection import check_detection
from vestige.campaign.statistics import Proportion
from vestige.plots import check_curves, write
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SKY = Path(__file__).parents[1] / "scenarios" / "sky.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """An attack, its strengths, and the checks that can detect it."""

    title: str
    label: str
    strengths: tuple[float, ...]
    attack: str  # TOML; {0} is the strength, {1} a hundred times the strength for a ramp of 100 s
    checks: tuple[str, ...]
    window_s: tuple[float, float] = (60.0, 120.0)
    log: bool = False


CURVES = {
    "power": Curve(
        title="Jamming of E1",
        label="J/N (dB)",
        strengths=(-20.0, -10.0, -6.0, -5.0, -4.5, -4.0, -3.0, 0.0, 1.0, 2.0, 3.0, 4.0, 6.0),
        attack='{{kind="jamming", bands=["E1"], start_s=60, j_over_n_db={0}}}',
        checks=("E1 received power", "C/N0"),
    ),
    "osnma": Curve(
        title="Jamming of E1, OSNMA",
        label="J/N (dB)",
        strengths=(13.0, 14.0, 14.5, 15.0, 18.0, 20.0, 21.0, 21.5, 22.0),
        attack='{{kind="jamming", bands=["E1"], start_s=60, j_over_n_db={0}}}',
        checks=("OSNMA availability", "OSNMA reception"),
        window_s=(60.0, 400.0),
    ),
    "osnma_data": Curve(
        title="E1 of all satellites with data of the attacker's own",
        label="spoofer over true signal (dB)",
        strengths=(-3.0, -1.0, 0.0, 0.2, 0.3, 0.4, 0.5, 1.0, 3.0),
        attack='{{kind="lift-off", bands=["E1"], forged_nav_data=true, start_s=60, power_db={0}, '
        'delay_m={{kind="ramp", first=0, last=60, start_s=70, stop_s=110}}}}',
        checks=("OSNMA agreement", "OSNMA availability"),
        window_s=(60.0, 400.0),
    ),
    "e6_power": Curve(
        title="One satellite pulled far on E1",
        label="pull to the late side (m)",
        strengths=(
            -200.0,
            -75.0,
            -70.0,
            -68.0,
            -66.0,
            -50.0,
            -30.0,
            30.0,
            90.0,
            300.0,
            570.0,
            580.0,
            590.0,
            600.0,
            700.0,
        ),
        attack='{{kind="position-push", svids=[7], bands=["E1"], start_s=20, power_db=12, '
        'delay_m={{kind="ramp", first=0, last={0}, start_s=25, stop_s=60}}}}',
        checks=("E6 power", "E1-E6 range"),
        window_s=(61.0, 120.0),
    ),
    "e6_jamming": Curve(
        title="Jamming of E6, detection there",
        label="J/N in 20.46 MHz (dB)",
        strengths=(-6.0, -3.0, 0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0),
        attack='{{kind="jamming", bands=["E6"], start_s=60, j_over_n_db={0}}}',
        checks=("E6 power", "post-correlation noise floor"),
    ),
    "lift_off": Curve(
        title="Lift-off to 60 m",
        label="spoofer over true signal (dB)",
        strengths=(-30.0, -20.0, -17.0, -15.0, -12.0, -10.0, -3.0, 0.4, 3.0, 4.0, 6.0),
        attack='{{kind="lift-off", start_s=60, power_db={0}, '
        'delay_m={{kind="ramp", first=0, last=60, start_s=60, stop_s=100}}}}',
        checks=("power-distortion", "E1 received power", "C/N0"),
    ),
    "second": Curve(
        title="Lift-off to 60 m, on E6",
        label="spoofer over true signal (dB)",
        strengths=(-30.0, -15.0, -12.0, -9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 10.0, 12.0, 13.0, 14.0, 15.0),
        attack='{{kind="lift-off", start_s=60, power_db={0}, '
        'delay_m={{kind="ramp", first=0, last=60, start_s=60, stop_s=100}}}}',
        checks=("E6 second signal", "E6 C/N0", "E6 received power"),
    ),
    "searches": Curve(
        title="Replay of both bands, a millisecond late",
        label="spoofer over true signal (dB)",
        strengths=(-30.0, -25.0, -22.0, -20.0, -18.0, -16.0, -14.0, -12.0, -9.0, -6.0, 0.0),
        attack='{{kind="meaconing", start_s=60, power_db={0}, delay_s=0.001, acquired=false, reception_gain_db=20}}',
        checks=("E1 vestigial search", "E6 exhaustive search"),
    ),
    "floor": Curve(
        title="Jamming of E6",
        label="J/N in 20.46 MHz (dB)",
        strengths=(-20.0, -12.0, -8.0, -6.0, -5.0, -4.5, -4.0, -3.5, -3.0, 0.0),
        attack='{{kind="jamming", bands=["E6"], start_s=60, j_over_n_db={0}}}',
        checks=("post-correlation noise floor",),
    ),
    "pull": Curve(
        title="One satellite pulled on E1",
        label="pull (m)",
        strengths=(0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 60.0),
        attack='{{kind="position-push", svids=[7], bands=["E1"], start_s=20, power_db=12, '
        'delay_m={{kind="ramp", first=0, last={0}, start_s=25, stop_s=60}}}}',
        checks=("E1-E6 range", "RAIM", "solution separation"),
        window_s=(61.0, 120.0),
    ),
    "clock": Curve(
        title="Time push of all satellites",
        label="rate (m/s)",
        strengths=(0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
        attack='{{kind="time-push", start_s=50, power_db=6, '
        'delay_m={{kind="ramp", first=0, last={1}, start_s=60, stop_s=160}}}}',
        checks=("clock innovation", "clock slope"),
        log=True,
    ),
    "clock_code": Curve(
        title="Time push of the codes alone",
        label="rate (m/s)",
        strengths=(1.0, 2.0, 5.0, 7.0, 10.0, 15.0, 20.0),
        attack='{{kind="time-push", start_s=50, power_db=12, phase={{kind="locked"}}, '
        'delay_m={{kind="ramp", first=0, last={1}, start_s=60, stop_s=160}}}}',
        checks=("clock consistency", "clock innovation"),
        log=True,
    ),
    "inertial": Curve(
        title="One satellite pulled on both bands, RECS each 10 s",
        label="rate (m/s)",
        strengths=(0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0),
        attack='{{kind="position-push", svids=[7], start_s=50, power_db=6, '
        'delay_m={{kind="ramp", first=0, last={1}, start_s=65, stop_s=165}}}}',
        checks=("inertial range rate", "RAIM"),
        log=True,
    ),
}


def scenario(curve: Curve, strength: float, seed: int) -> CampaignScenario:
    """Return the campaign of one run."""
    attack = f"attack=[{curve.attack.format(strength, 100 * strength)}]"
    settings = (f"seed={seed}", f"epochs={round(curve.window_s[1])}", "recs.every=10", attack)
    found = load_scenario(SKY, settings)
    assert isinstance(found, CampaignScenario)
    return found


def point(curve: Curve, seeds: Sequence[int], strength: float) -> dict[str, Proportion]:
    """Return the detections of each check at a strength."""
    make: Callable[[int], CampaignScenario] = partial(scenario, curve, strength)
    return check_detection(make, seeds, checks=curve.checks, window_s=curve.window_s)


def table(curve: Curve, seen: Mapping[str, Sequence[Proportion]]) -> str:
    """Return the counts with their intervals as lines of Markdown."""
    heads = " | ".join(f"{strength:g}" for strength in curve.strengths)
    rows = [f"| {curve.label} | {heads} |", "|---" * (1 + len(curve.strengths)) + "|"]
    for name, points in seen.items():
        cells = " | ".join(f"{one.value:.2f} ({one.low:.2f}–{one.high:.2f})" for one in points)
        rows.append(f"| {name} | {cells} |")
    return "\n".join(rows)


def main() -> None:
    """Measure, print and draw the curves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--only", choices=CURVES)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(2) as pool:
        for name, curve in CURVES.items():
            if options.only not in (None, name):
                continue
            points = list(pool.map(partial(point, curve, range(options.seeds)), curve.strengths))
            seen = {check: [one[check] for one in points] for check in curve.checks}
            print(f"{curve.title}\n\n{table(curve, seen)}\n", flush=True)
            axes = check_curves(curve.strengths, seen, title=curve.title, label=curve.label, log=curve.log)
            write(axes, options.output / f"{name}.png")
            with (options.output / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(("strength", "check", "seen", "runs", "low", "high"))
                for check, proportions in seen.items():
                    for strength, one in zip(curve.strengths, proportions, strict=True):
                        writer.writerow((strength, check, one.successes, one.trials, one.low, one.high))


if __name__ == "__main__":
    main()
