"""`vestige run`: run a campaign scenario, or a sweep of campaigns, and write the results into stores."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import PATH, WidthType, json_option, parts_option, scheduler_option, set_option, workers_option
from vestige.cli.pool import MAX_THREADS, pool
from vestige.cli.terminal import echo, warn
from vestige.errors import VestigeError
from vestige.output import check_output

if TYPE_CHECKING:
    from vestige.scenario.campaign import CampaignScenario


@click.command()
@click.argument("scenario", type=PATH)
@click.option("-o", "--output", required=True, type=PATH, help="Store (zarr) to write or continue.")
@workers_option
@click.option(
    "--threads/--processes",
    default=None,
    help=f"Kind of workers.  [default: up to {MAX_THREADS} threads, else processes]",
)
@scheduler_option
@click.option(
    "--chunk",
    "chunk_epochs",
    type=click.IntRange(1, 1_000_000),
    help="Epochs in a chunk of the store.  [default: 2000; 10000 for a single satellite without samples]",
)
@click.option(
    "--fidelity", type=click.Choice(["samples", "correlators"]), help="Fidelity, used in place of the scenario's own."
)
@set_option
@click.option(
    "--sweep",
    "sweeps",
    multiple=True,
    metavar="KEY=A:B:STEP",
    help="Run a campaign for each value from A to B, B included, or for each value in KEY=a,b,c. Several --sweep run "
    "every combination. OUTPUT is then a folder of stores.",
)
@click.option(
    "--width",
    type=WidthType(),
    help="End each campaign of a sweep when its 95 % interval is this narrow, for example 0.01 or 20%.",
)
@json_option
@parts_option
def command(
    scenario: Path,
    output: Path,
    workers: int | None,
    threads: bool | None,
    scheduler: str | None,
    chunk_epochs: int | None,
    fidelity: str | None,
    settings: tuple[str, ...],
    sweeps: tuple[str, ...],
    width: tuple[float, bool] | None,
    as_json: bool,
) -> None:
    """Run the campaign SCENARIO and print the results of each detector.

    The same command continues a run that was stopped in any way. The results have the same bits as the results of a run
    without interruption.
    """
    from vestige.campaign.execution.executors import ONE_THREAD

    if width is not None and not sweeps:
        raise click.UsageError("--width needs --sweep: a single campaign runs all epochs of its scenario")
    if scheduler is not None and (workers, threads) != (None, None):
        raise click.UsageError("--scheduler uses the workers of the cluster; leave out -j, --threads and --processes")
    check_output(output, (scenario,), folder=True)
    os.environ.update(ONE_THREAD)  # these variables must be set before numpy is loaded; they change no bit of results
    own = (f'fidelity="{fidelity}"',) if fidelity else ()
    how = {} if chunk_epochs is None else {"chunk_epochs": chunk_epochs}
    if sweeps:
        campaigns = _campaigns(scenario, (*settings, *own), sweeps)
        _caution(scenario, [one for _, one in campaigns])
        from vestige.campaign.sweep.sweep_axes import store_name

        _caution_chunks([output / store_name(values) for values, _ in campaigns], chunk_epochs)
        with pool(workers, threads, scheduler) as (executor, calls):
            _run_sweep(campaigns, output, width, as_json, {**how, "executor": executor, "workers": calls})
        return

    from vestige.campaign.run import run
    from vestige.campaign.scenario_plan import ScenarioPlan
    from vestige.cli.campaigns.campaign_report import campaign_json, campaign_text
    from vestige.cli.progress import campaign_progress

    plan = ScenarioPlan(scenario=_load(scenario, (*settings, *own)))
    _caution(scenario, [plan.scenario])
    _caution_chunks([output], chunk_epochs)
    with pool(workers, threads, scheduler) as (executor, calls), campaign_progress() as report:
        results = run(
            plan,
            output,
            workers=calls,
            executor=executor,
            chunk_epochs=plan.chunk_epochs if chunk_epochs is None else chunk_epochs,
            progress=lambda now: report(scenario.stem, now),
        )
    echo(*(campaign_json(results) if as_json else campaign_text(results, output)).split("\n"))


def _load(path: Path, settings: tuple[str, ...]) -> CampaignScenario:
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.load import load_scenario

    scenario = load_scenario(path, settings)
    if not isinstance(scenario, CampaignScenario):
        raise VestigeError(
            f"{path}: kind: found {scenario.kind!r}, expected 'campaign'; for a recording use `vestige simulate`"
        )
    return scenario


def _caution(path: Path, scenarios: list[CampaignScenario]) -> None:
    """Print the warnings about the scenarios of a run on stderr; each warning is printed once."""
    from vestige.scenario.warnings import scenario_warnings

    for line in dict.fromkeys(line for scenario in scenarios for line in scenario_warnings(scenario)):
        warn(f"{path}: {line}")


def _caution_chunks(stores: list[Path], chunk_epochs: int | None) -> None:
    """Warn on stderr if `--chunk` has no effect, because the store exists."""
    from vestige.campaign.store.store import kept_chunk_epochs

    for store in stores:
        if chunk_epochs is not None and (kept := kept_chunk_epochs(store, chunk_epochs)) is not None:
            line = f"--chunk {chunk_epochs} has no effect: the store was made with chunks of {kept} epochs"
            warn(f"{store}: {line}")


def _campaigns(path: Path, settings: tuple[str, ...], sweeps: tuple[str, ...]) -> list[tuple[Any, CampaignScenario]]:
    """Return settings and scenario of every campaign of a sweep; errors of scenarios are raised before the first run.

    The function raises `VestigeError` if an axis or a scenario is invalid, or if an axis has a key of `settings`.
    """
    from vestige.campaign.sweep.sweep_axes import as_settings, grid, parse_axis

    axes = [parse_axis(text) for text in sweeps]
    fixed = {setting.partition("=")[0].strip() for setting in settings}
    for axis in axes:
        if axis.key in fixed:
            raise VestigeError(f"--sweep {axis.key}: found --set or --fidelity of the same key, expected one of them")
    return [(values, _load(path, (*settings, *as_settings(values)))) for values in grid(axes)]


def _run_sweep(
    campaigns: list[tuple[Any, CampaignScenario]],
    folder: Path,
    width: tuple[float, bool] | None,
    as_json: bool,
    how: dict[str, Any],
) -> None:
    from vestige.campaign.sweep.sweep import SWEEP_TABLE, Width, run_sweep
    from vestige.cli.campaigns.campaign_report import sweep_json, sweep_table
    from vestige.cli.progress import campaign_progress
    from vestige.folder_lock import only_writer

    narrow = None if width is None else Width(width=width[0], relative=width[1])
    with only_writer(folder), campaign_progress() as report:
        rows = list(run_sweep(campaigns, folder, width=narrow, progress=report, **how))
    echo(*(sweep_json(rows) if as_json else sweep_table(rows, folder / SWEEP_TABLE)).split("\n"))
