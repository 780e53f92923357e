"""`vestige run`: run a campaign scenario into a store."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import xarray

    from vestige.campaign.run import Progress


@click.command()
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", required=True, type=click.Path(path_type=Path), help="Store (zarr) to write or continue."
)
@click.option("-j", "--workers", type=click.IntRange(1, 1024), default=1, show_default=True)
@click.option("--threads/--processes", default=False, help="Kind of workers on this machine.  [default: processes]")
@click.option("--scheduler", metavar="tcp://…", help="Run on a dask.distributed cluster.")
@click.option("--fidelity", type=click.Choice(["samples", "correlators"]), help="In place of the scenario's own.")
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Replace a value, `receiver.cn0_dbhz=37`; `none` removes.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    scenario: Path,
    output: Path,
    workers: int,
    threads: bool,
    scheduler: str | None,
    fidelity: str | None,
    settings: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run the campaign SCENARIO and print what both detectors did.

    A run that was stopped, however it was, is continued by the same command and ends with the same bits.
    """
    from vestige.campaign.run import run
    from vestige.campaign.scenario_plan import ScenarioPlan
    from vestige.errors import VestigeError
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.cautions import cautions
    from vestige.scenario.load import load_scenario

    own = (f'fidelity="{fidelity}"',) if fidelity else ()
    loaded = load_scenario(scenario, (*settings, *own))
    if not isinstance(loaded, CampaignScenario):
        raise VestigeError(
            f"{scenario}: kind: found {loaded.kind!r}, expected 'campaign'; `vestige simulate` writes it"
        )
    for caution in cautions(loaded):
        click.echo(f"vestige: {scenario}: {caution}", err=True)
    executor: Any = "threads" if threads or workers == 1 else "processes"
    if scheduler is not None:
        from vestige.campaign.cluster import connect

        executor = connect(scheduler)
    results = run(
        ScenarioPlan(scenario=loaded), output, workers=workers, executor=executor, progress=_bar(f"{scenario.stem}")
    )
    if as_json:
        click.echo(json.dumps(_without_nan(_summary(results)), allow_nan=False))
    else:
        _print(results, output)


def _bar(name: str) -> Any:
    """Return a progress callback: a line at a terminal that is written over, nothing elsewhere."""
    if not sys.stderr.isatty():
        return None

    def report(progress: Progress) -> None:
        rate, left = progress.rate_epochs_per_s, progress.remaining_s
        end = "\n" if progress.epochs_done == progress.epochs_total else ""
        done = f"{progress.epochs_done} of {progress.epochs_total} epochs"
        text = f"\r{name}: {done}, {rate:.0f} a second, {left:.0f} s left "
        click.echo(text + end, err=True, nl=False)

    return report


def _without_nan(value: Any) -> Any:
    """Return nested results with None for what is not a number, which JSON does not have."""
    if isinstance(value, dict):
        return {str(key): _without_nan(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(inner) for inner in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _summary(results: xarray.Dataset) -> dict[str, Any]:
    from vestige.acas_processor.thresholds import probability_of_detection
    from vestige.campaign.statistics import summarise

    attrs = results.attrs
    theory = probability_of_detection(attrs["cn0_dbhz"], attrs["integration_s"], attrs["p_fa"])
    return {
        "fidelity": attrs["fidelity"],
        "cn0_dbhz": attrs["cn0_dbhz"],
        "p_fa": attrs["p_fa"],
        "p_d_theory": float(theory),
        "detectors": {name: dataclasses.asdict(summarise(results, name)) for name in ("early", "maximum")},
    }


def _print(results: xarray.Dataset, output: Path) -> None:
    from vestige.acas_processor.thresholds import probability_of_detection
    from vestige.campaign.statistics import summarise

    attrs = results.attrs
    theory = float(probability_of_detection(attrs["cn0_dbhz"], attrs["integration_s"], attrs["p_fa"]))
    click.echo(
        f"{output}: {results.sizes['epoch']} epochs, {attrs['fidelity']}, C/N0 {attrs['cn0_dbhz']:g} dBHz, "
        f"P_fa {attrs['p_fa']:g}"
    )
    click.echo(f"theory, noise only, on a tap: P_d {theory:.7f}")
    for name in ("early", "maximum"):
        found = summarise(results, name)
        rate = found.detections
        low_m, high_m = found.cluster_m
        click.echo(
            f"{name:8s} detector: {found.misses} missed, P_d {rate.successes / max(rate.trials, 1):.6f} "
            f"({100 * rate.confidence:g} %: {rate.low:.6f} to {rate.high:.6f})"
        )
        click.echo(
            f"  range offset: mean {found.range_offset_mean_m:+.2f} m, 1σ {found.range_offset_std_m:.2f} m, "
            f"{found.cluster.successes} between {low_m:g} and {high_m:g} m"
        )
        click.echo("  percentiles: " + ", ".join(f"{p:g} % {value:+.1f} m" for p, value in found.percentiles_m.items()))
