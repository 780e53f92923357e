"""Show the lift-off attack of [WFO, Sec. VI-B]: the actions of the attacker, and the range offset of each detector.

    python examples/lift_off.py [FOLDER]

The example takes a few seconds. The example simulates `scenarios/liftoff.toml` with fidelity `correlators`, and stores
the results in FOLDER (the default is build/lift_off). The example then describes each phase of the attack in words, and
draws the range offsets of both detectors.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import xarray

from vestige import plots
from vestige.campaign.outcomes import DetectedSignal, outcomes, report
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.verdicts import range_limit_m
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

ROOT = Path(__file__).resolve().parents[1]

# For each phase of the attack: start in s, end in s, action of the attacker, effect of the action
STORY = (
    (
        0,
        300,
        "comes from the right, weak",
        "The signal is too weak to be a peak. The paper's harsh conditions hide it.",
    ),
    (
        300,
        580,
        "comes nearer",
        "The signal bends the range a little, and beats with the true signal: the phase swings.",
    ),
    (
        580,
        650,
        "is on top, and turns",
        "Two signals in a correlator add or cancel, depending on their phase. Here the phase changes slowly.",
    ),
    (
        650,
        850,
        "raises its power and leaves",
        "Within a chip there is a single peak, and it is the spoofer's. Both detectors follow it.",
    ),
    (
        850,
        1050,
        "is about a chip late",
        "The peaks part. The early detector takes the first peak as soon as there is one.",
    ),
    (1050, 1500, "stays 71 m late", "The true signal is earlier, so the early detector takes it at any power."),
)


def main(folder: Path) -> None:
    """Simulate the attack, print its phases and write the figure."""
    scenario = load_scenario(ROOT / "scenarios" / "liftoff.toml", ['fidelity="correlators"'])
    assert isinstance(scenario, CampaignScenario)
    shutil.rmtree(folder / "liftoff.zarr", ignore_errors=True)
    results = run(ScenarioPlan(scenario=scenario), folder / "liftoff.zarr").load()
    limit_m = range_limit_m(results)

    print(f"A lift-off of E6 at 35 dBHz. The range test raises an alarm beyond {limit_m:.1f} m; E1 is left alone.\n")
    belongs = outcomes(results, resolution_m=0.0).isel(satellite=0)
    for start_s, stop_s, does, why in STORY:
        inside = (results["time_s"].values >= start_s) & (results["time_s"].values < stop_s)
        print(f"{start_s:5d} to {stop_s} s  The attacker {does}{_spoofing_signal(results, inside)}.")
        for detector in ("early", "maximum"):
            print(f"   {detector:8s} {_concludes(results, belongs, detector, inside, limit_m)}")
        print(f"   {why}\n")
    for detector in ("early", "maximum"):
        found = report(results, detector)
        assert found is not None
        after_s = found.time_to_mitigate_s
        ends = (
            "it did not return to the true signal for the rest of the attack"
            if np.isnan(after_s)
            else f"it returned to the true signal {after_s:.0f} s after the attack began, and stayed"
        )
        print(f"{detector:8s} detector: {ends}.")

    figure = folder / "lift_off.png"
    plots.write(plots.attack_comparison(results), figure, width_cm=12.0)
    print(f"\nFigure: {figure}, both detectors over the truth.")
    print(f"Next: vestige plot all {folder / 'liftoff.zarr'} -o figures; vestige threats --quick; docs/attacks.md")


def _spoofing_signal(results: xarray.Dataset, inside: np.ndarray) -> str:
    """Return delay and power of the spoofing signal at the beginning and at the end of an interval, in words."""
    power_db = results["truth_spoofer_power_db"].values[inside, 0, 0]
    later_m = results["truth_spoofer_offset_m"].values[inside, 0, 0]
    if not np.isfinite(power_db).all():
        return ""
    return f" ({later_m[0]:.0f} to {later_m[-1]:.0f} m late, {power_db[0]:+.1f} to {power_db[-1]:+.1f} dB)"


def _concludes(
    results: xarray.Dataset, belongs: xarray.DataArray, detector: str, inside: np.ndarray, limit_m: float
) -> str:
    """Return in words the results of a detector in an interval.

    The results are the median range offset, the share of epochs whose range offset is nearer to the spoofing signal,
    and the share of epochs with an alarm.
    """
    offset_m = results["range_offset_m"].sel(detector=detector).values[inside, 0]
    signal = belongs.sel(detector=detector).values[inside]
    alarms = np.isnan(offset_m) | (np.abs(offset_m) > limit_m)
    nearer = f", {100 * np.mean(signal == DetectedSignal.SPOOFER):.0f} % nearer to the spoofer"
    return f"range {np.nanmedian(offset_m):+5.1f} m (median){nearer}; alarms in {100 * np.mean(alarms):.0f} %"


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "lift_off")
