"""Measure the detection by the E6 phase and fading monitors against power, rate of RECS and slip, with intervals.

python benchmarks/e6_carrier.py [--seeds 20] [--part power|slip|honest]

The scene is a line of sight of 35 dBHz with the multipath of scenarios/harsh.toml, which changes with every RECS, and
an ionosphere that changes smoothly. After an undisturbed window a spoofing signal is on E6, 10 m late, and its phase
slips against the true signal. A check detects the spoofing signal if it fails in the two windows after that. The budget
of a test is 1e-6. "lasting" is the check that allows for lasting reflections. "-" marks cells that are not run.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path

import numpy as np
import xarray

from vestige.acas_processor.checks.e6_phase import E6PhaseMonitor
from vestige.acas_processor.checks.power.e6_fading import E6FadingMonitor
from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import judged_by
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import proportion
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

HARSH = Path(__file__).parents[1] / "scenarios" / "harsh.toml"
CASES = (
    (0.0, 10),
    (inf, 10),
    (0.0, 30),
    (inf, 30),
    (0.0, 100),
    (inf, 100),
)  # lifetime of a reflection in s, window in RECS
POWERS_DB = (-16.0, -13.0, -10.0, -7.0, -4.0, 0.0)
SLIPS_HZ = (0.0, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.5, 0.97, 1.0)
INTERVALS_S = (1, 2, 5, 10, 30)
RATES = ((1, 100), (1, 30), (2, 30), (5, 10), (10, 10), (30, 10), (30, 30), (30, 100))  # interval in s, window in RECS


def results(seed: int, *, interval_s: int, power_db: float, slip_hz: float, recs: int, quiet: int) -> xarray.Dataset:
    """Return a run of `recs` RECS, of which the first `quiet` are undisturbed."""
    attack = (
        f'[{{kind="lift-off", start_s={quiet * interval_s}, bands=["E6"], reception_gain_db=20.0, power_db={power_db}, '
        f'delay_m=10.0, phase={{kind="slipping", slip_hz={slip_hz}}}}}]'
    )
    scenario = load_scenario(
        HARSH,
        (
            f"seed={seed}", f"epochs={recs}", f"interval_s={float(interval_s)}", 'fidelity="correlators"',
            'receiver.ionosphere.correlation="smooth"', f"attack={attack}",
        ),
    )  # fmt: skip
    assert isinstance(scenario, CampaignScenario)
    return direct_results(ScenarioPlan(scenario=scenario), judge=False)


def with_monitors(processor: AcasProcessor, life_s: float, window: int) -> AcasProcessor:
    """Return the processor with both monitors, which assume the default loops of the receiver."""
    phase, fading = (kind(ray_life_s=life_s, window=window) for kind in (E6PhaseMonitor, E6FadingMonitor))
    return replace(processor, monitoring=replace(processor.monitoring, e6_phase=phase, e6_fading=fading))


def row(seeds: Sequence[int], window: int, make: Callable[[int], xarray.Dataset]) -> dict[tuple[str, float], str]:
    """Return the number of runs that each check detects, with its interval."""
    lives = [life_s for life_s, n in CASES if n == window]
    seen, run = {}, {}
    for seed in seeds:
        one = make(seed)
        for life_s in lives:
            found = judged_by(one, partial(with_monitors, life_s=life_s, window=window))
            for name in ("E6 phase", "E6 fading"):
                check = found.checks[name]
                seen[name, life_s] = seen.get((name, life_s), 0) + bool(check.failed[window:].any())
                run[name, life_s] = run.get((name, life_s), 0) + bool(check.run[window:].any())
    cells = {}
    for key, count in seen.items():
        share = proportion(count, len(seeds))
        cells[key] = f"{share.value:.2f} ({share.low:.2f}–{share.high:.2f})" if run[key] else "-"
    return cells


def table(heads: Sequence[object], rows: Sequence[dict[tuple[str, float], str]], label: str) -> None:
    """Print cells as Markdown."""
    print(f"| {label} | " + " | ".join(f"{one:g}" for one in heads) + " |")
    print("|---" * (1 + len(heads)) + "|")
    for name, life_s in rows[0]:
        what = f"{name}{', lasting' if life_s else ''}"
        print(f"| {what} | " + " | ".join(one[name, life_s] for one in rows) + " |")
    print(flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--part", choices=("power", "slip", "honest"))
    options = parser.parse_args()
    seeds = range(options.seeds)
    if options.part in (None, "power"):
        for interval_s, window in RATES:
            print(f"RECS each {interval_s} s, the last {window} of them\n")
            made = partial(results, interval_s=interval_s, slip_hz=0.137, recs=3 * window, quiet=window)
            table(POWERS_DB, [row(seeds, window, partial(made, power_db=one)) for one in POWERS_DB], "power (dB)")
    if options.part in (None, "slip"):
        for window in (30, 100):
            print(f"RECS each 1 s, the last {window} of them, -7 dB\n")
            made = partial(results, interval_s=1, power_db=-7.0, recs=3 * window, quiet=window)
            table(SLIPS_HZ, [row(seeds, window, partial(made, slip_hz=one)) for one in SLIPS_HZ], "slip (Hz)")
    if options.part in (None, "honest"):
        print("| RECS | check | failed, new reflections | failed, lasting | tests |\n" + "|---" * 5 + "|")
        for interval_s, window in RATES:
            made = partial(results, interval_s=interval_s, power_db=-inf, slip_hz=0.1, recs=20_000, quiet=10)
            runs = [made(seed) for seed in (9, 10, 11)]
            for name in ("E6 phase", "E6 fading"):
                lives = [life_s for life_s, n in CASES if n == window]
                changes = [partial(with_monitors, life_s=life_s, window=window) for life_s in lives]
                new, lasting = ([judged_by(one, change).checks[name] for one in runs] for change in changes)
                counts = [sum(int(np.count_nonzero(one.failed)) for one in found) for found in (new, lasting)]
                tests = sum(int(np.count_nonzero(one.run)) for one in new)
                print(f"| {window}, each {interval_s} s | {name} | {counts[0]} | {counts[1]} | {tests} |", flush=True)


if __name__ == "__main__":
    main()
