"""Find the multipath channels in which as many RECS are missed as in the paper's harsh channel.

    python examples/multipath_calibration.py [FOLDER] [--epochs 100000]

The paper [WFO, Sec. VI-A] gives the number of missed RECS, 52 of 100,000, but not the power, delay and number of the
reflections. The example shows that many channels have 52 misses. The script runs `scenarios/harsh.toml` as correlators
over many channels. For each number of reflections and each mean excess delay the script interpolates between the tested
powers to the power at which 52 of 100,000 RECS are missed. For this power the script also gives two other results to
compare with the paper: the number of range offsets in the cluster near −22.5 m, and the standard deviation of the range
offset. The script writes FOLDER/calibration.csv and FOLDER/calibration.png (the default folder is build/calibration).
"""

from __future__ import annotations

import argparse
import csv
import os
from pathlib import Path
from typing import NamedTuple

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from matplotlib.figure import Figure

from vestige import plots
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import CLUSTER_M
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

ROOT = Path(__file__).resolve().parents[1]
POWERS_DB = (-22.0, -20.0, -18.0, -16.8, -15.8, -15.0, -14.0, -12.0)
EXCESSES_M = (15.0, 25.0, 40.0, 80.0)
RAYS = (1, 3)
PAPER_MISSES = 52  # number of missed RECS in 100,000 [WFO, Sec. VI-A]
CHUNK = 10_000


class Outcome(NamedTuple):
    """Results of a multipath channel.

    `misses` is the number of missed RECS, and `cluster` is the number of range offsets near −22.5 m, in 100,000 RECS.
    """

    n_rays: int
    mean_excess_m: float
    power_db: float
    misses: float
    cluster: float
    sigma_m: float


def outcome(n_rays: int, excess_m: float, power_db: float, epochs: int) -> Outcome:
    """Return the results of the early detector in one multipath channel."""
    channel = (
        f"receiver.multipath.{key}" for key in (f"n_rays={n_rays}", f"mean_excess_m={excess_m}", f"power_db={power_db}")
    )
    scenario = load_scenario(
        ROOT / "scenarios" / "harsh.toml", ('fidelity="correlators"', f"epochs={epochs}", *channel)
    )
    assert isinstance(scenario, CampaignScenario)
    plan = ScenarioPlan(scenario=scenario)
    truth, offsets_m = plan.prepare(), []
    for first in range(0, epochs, CHUNK):
        count = min(CHUNK, epochs - first)
        offsets_m.append(plan.measure(first, truth.advance(first, count))["range_offset_m"][0, :, 0].astype(float))
    offset_m = np.concatenate(offsets_m)
    share = 100_000 / epochs
    in_cluster = (offset_m >= CLUSTER_M[0]) & (offset_m <= CLUSTER_M[1])
    return Outcome(
        n_rays,
        excess_m,
        power_db,
        share * float(np.count_nonzero(np.isnan(offset_m))),
        share * float(np.count_nonzero(in_cluster)),
        float(np.nanstd(offset_m)),
    )


def calibrated(found: list[Outcome]) -> Outcome | None:
    """Interpolate the channel with as many missed RECS as the paper, from channels that differ only in power."""
    misses = np.array([one.misses for one in found])
    if not misses.min() < PAPER_MISSES < misses.max():
        return None
    above = int(np.argmax(misses > PAPER_MISSES))
    low, high = found[above - 1], found[above]
    logs = np.log([max(low.misses, 0.5), high.misses])
    share = float((np.log(PAPER_MISSES) - logs[0]) / (logs[1] - logs[0]))
    between = (np.array(low[2:]) * (1 - share) + np.array(high[2:]) * share).tolist()
    return Outcome(low.n_rays, low.mean_excess_m, between[0], PAPER_MISSES, between[2], between[3])


def main() -> None:
    """Run all channels, print the table, and write calibration.csv and calibration.png."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=ROOT / "build" / "calibration")
    parser.add_argument("--epochs", type=int, default=100_000)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    found: dict[tuple[int, float], list[Outcome]] = {}
    print("reflections  excess (m)  power of 52 misses (dB)  cluster  1σ of the range (m)")
    for n_rays in RAYS:
        for excess_m in EXCESSES_M:
            here = [outcome(n_rays, excess_m, power_db, options.epochs) for power_db in POWERS_DB]
            found[n_rays, excess_m] = here
            one = calibrated(here)
            says = (
                "none of these powers"
                if one is None
                else f"{one.power_db:23.1f}  {one.cluster:7.0f}  {one.sigma_m:19.2f}"
            )
            print(f"{n_rays:11d}  {excess_m:10.0f}  {says}", flush=True)
    rows = [one for each in found.values() for one in each]
    with (options.folder / "calibration.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(Outcome._fields)
        writer.writerows(rows)
    draw(found, options.folder / "calibration.png")
    print(f"{options.folder / 'calibration.png'}: many channels miss 52. The count does not tell the paper's channel.")


def draw(found: dict[tuple[int, float], list[Outcome]], path: Path) -> None:
    """Draw misses, offsets in the cluster and the standard deviation of the range offset against multipath power."""
    figure = Figure(figsize=(6.3, 7.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    labels = (
        ("misses", "missed of 100,000"),
        ("cluster", "near −22.5 m of 100,000"),
        ("sigma_m", "1σ of the range (m)"),
    )
    for panel, (name, label) in zip(panels, labels, strict=True):
        for (n_rays, excess_m), each in found.items():
            values = [getattr(one, name) for one in each]
            style = "-" if n_rays == 1 else "--"
            panel.plot(
                [one.power_db for one in each],
                values,
                style,
                color=f"C{EXCESSES_M.index(excess_m)}",
                label=f"{excess_m:.0f} m, {n_rays} reflection{'s' if n_rays > 1 else ''}",
            )
        panel.set_ylabel(label)
    panels[0].set_yscale("symlog", linthresh=1)
    limits = panels[0].get_ylim()
    ticks = [0, *(digit * 10**power for power in range(5) for digit in (1, 2, 5))]
    panels[0].set_yticks(ticks, [f"{tick:,}" for tick in ticks])
    panels[0].set_ylim(limits)
    panels[1].set_ylim(bottom=0)
    panels[0].axhline(PAPER_MISSES, color="black", linewidth=1)
    panels[0].annotate("the paper: 52", (POWERS_DB[0], PAPER_MISSES), xytext=(0, 3), textcoords="offset points")
    panels[-1].set_xlabel("mean power of all reflections over the direct signal (dB)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    plots.write(panels[0], path)


if __name__ == "__main__":
    main()
