"""`vestige threats`: measure the outcome of each attack at each level, and compare it with the expected outcome."""

from __future__ import annotations

import os
import tomllib
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from vestige.cli.options import PATH, json_option, parts_option, scheduler_option, workers_option
from vestige.cli.pool import pool
from vestige.cli.terminal import echo, warn
from vestige.errors import VestigeError
from vestige.folder_lock import only_writer

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Executor

    from vestige.scenario.campaign import CampaignScenario
    from vestige.threats.matrix import Case, SceneCell
    from vestige.threats.scenes import Threat

QUICK_SEEDS, SEEDS = 6, 100  # 6 of 6 runs prove a share above ½ (exact 95 % interval); 5 of 5 runs do not
FIGURE = "threats.png"
# modules that every worker needs; without this list, most of these modules are loaded only when a run begins
_PRELOAD = ("vestige.threats.matrix", "dask.array", "numba.typed", "scipy.interpolate", "scipy.ndimage")


def _begun_ids(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Return the attacks of the threat table whose IDs begin with the typed text, for completion with Tab.

    In a list with commas, the ID after the last comma is completed. The table is read as TOML only, because the modules
    that validate the table load too slowly for a completion.
    """
    before, comma, last = begun.rpartition(",")
    table = tomllib.loads((files("vestige") / "threats" / "threats.toml").read_text("utf-8"))
    ids = {threat["id"]: threat["name"] for threat in table["threat"]}
    return [CompletionItem(f"{before}{comma}{one}", help=name) for one, name in ids.items() if one.startswith(last)]


@click.command()
@click.option(
    "--level", "levels", multiple=True, type=click.IntRange(1, 3), help="Mitigation level to show.  [default: all]"
)
@click.option(
    "--quick",
    is_flag=True,
    help=f"Make {QUICK_SEEDS} runs of each scene in place of {SEEDS}: about a minute with -j 2 on two idle cores.",
)
@click.option(
    "--seeds", "n_seeds", type=click.IntRange(1, 100_000), help="Number of runs of each scene. [default: 100]"
)
@click.option(
    "--only",
    "ids",
    multiple=True,
    metavar="ID[,ID...]",
    shell_complete=_begun_ids,
    help="Measure these attacks only, for example A5 or A15,A17. May be given several times.",
)
@click.option(
    "--attack",
    "files",
    multiple=True,
    type=PATH,
    help="Measure this campaign scenario of your own in place of the table.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Replace a value in every scene, as in `processor.detector=my_module:MyDetector`; `none` removes the value.",
)
@click.option("--expected", is_flag=True, help="Print the expected outcomes with reasons; measure nothing.")
@click.option("-o", "--output", type=PATH, help="Folder for runs.csv, threats.csv, threats.zarr and threats.png.")
@workers_option
@scheduler_option
@json_option
@parts_option
def command(
    levels: tuple[int, ...],
    quick: bool,
    n_seeds: int | None,
    ids: tuple[str, ...],
    files: tuple[Path, ...],
    settings: tuple[str, ...],
    expected: bool,
    output: Path | None,
    workers: int | None,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Measure the outcome of each attack of the threat table at each level, and compare it with the expected outcome.

    The verdicts of all levels come from the same runs. Runs with many seeds give the share of each outcome, and its
    exact confidence interval. With -o the same command continues a measurement that was stopped.
    """
    if quick and n_seeds is not None:
        raise click.UsageError("--quick and --seeds both set the number of runs; leave one of the two out")
    if ids and files:
        raise click.UsageError("--only chooses rows of the table, which --attack replaces; leave one of the two out")
    if expected and files:
        raise click.UsageError(
            "--expected prints the outcomes of the table, which has none for --attack; leave one of the two out"
        )
    if expected and settings:
        raise click.UsageError(
            "--expected prints the outcomes of the table, which --set does not change; leave one of the two out"
        )
    for one in settings:
        if one.partition("=")[0].strip() in ("seed", "kind", "processor.level"):
            raise click.BadParameter(
                f"{one}: this key cannot be set, because every seed and every level is measured", param_hint="--set"
            )
    if scheduler is not None and workers is not None:
        raise click.UsageError("--scheduler uses the workers of the cluster; leave out -j")

    from vestige.campaign.execution.executors import ONE_THREAD

    os.environ.update(ONE_THREAD)  # these variables must be set before numpy is loaded, because runs are parallel

    if expected:
        _echo_expectations(ids, levels, as_json)
        return
    # The pool starts before the imports below, so that its workers load their modules at the same time.
    with pool(workers, False if (workers or 1) > 1 else None, scheduler, _PRELOAD) as (executor, calls):
        from vestige.cli.campaigns.threats_report import threats_json, threats_text
        from vestige.threats.matrix import case_of, cases
        from vestige.threats.scenes import LEVEL_NUMBERS, read_threats

        threats, shown = _chosen(read_threats(), ids), levels or LEVEL_NUMBERS
        mine = tuple(case_of(path.stem, _load(path, quick, settings), settings) for path in files)
        chosen = mine or cases(threats, settings)
        seeds = range(n_seeds or (QUICK_SEEDS if quick else SEEDS))
        with nullcontext() if output is None else only_writer(output):
            if output is not None:
                import vestige.plots  # noqa: F401  (loaded while the workers start)
            cells = list(_measured(chosen, seeds, output, executor, calls))
            text = threats_json(cells, () if files else threats, shown) if as_json else threats_text(cells, shown)
            echo(*text.split("\n"))
            if output is not None:
                for path in _written(output, cells):
                    echo(f"written: {path}", err=as_json)


def _echo_expectations(ids: tuple[str, ...], levels: tuple[int, ...], as_json: bool) -> None:
    from vestige.cli.campaigns.threats_report import expectations_text, threats_json
    from vestige.threats.scenes import LEVEL_NUMBERS, read_threats

    threats = _chosen(read_threats(), ids)
    tables = (
        [threats_json([], threats)] if as_json else [expectations_text(threats, one) for one in levels or LEVEL_NUMBERS]
    )
    echo(*"\n".join(tables).split("\n"))


def _chosen(threats: tuple[Threat, ...], ids: tuple[str, ...]) -> tuple[Threat, ...]:
    known = {threat.id: threat for threat in threats}
    wanted = [one.strip() for given in ids for one in given.split(",")]
    for one in wanted:
        if one not in known:
            raise click.BadParameter(f"{one or 'nothing'}: expected one of {', '.join(known)}", param_hint="--only")
    return tuple(threat for threat in threats if not wanted or threat.id in wanted)


def _load(path: Path, quick: bool, settings: tuple[str, ...]) -> CampaignScenario:
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.load import load_scenario
    from vestige.scenario.warnings import scenario_warnings

    scenario = load_scenario(path, (*settings, *(('fidelity="correlators"',) if quick else ())))
    if not isinstance(scenario, CampaignScenario):
        raise VestigeError(f"{path}: kind: found {scenario.kind!r}, expected 'campaign'")
    for line in scenario_warnings(scenario):
        warn(f"{path}: {line}")
    return scenario


def _measured(
    chosen: tuple[Case, ...], seeds: range, output: Path | None, executor: Executor, calls: int
) -> Iterator[SceneCell]:
    """Yield the cells of the threat table; with `output`, each run is stored when the run ends."""
    from vestige.cli.progress import progress
    from vestige.threats.matrix import measure_threats

    kept = "" if output is None else f"the results so far are stored in {output}; the same command continues there"
    try:
        with progress() as report:
            yield from measure_threats(chosen, seeds, executor, workers=calls, folder=output, progress=report)
    except BrokenExecutor as error:
        raise VestigeError(f"workers were lost ({error})" + (f"; {kept}" if kept else "")) from error
    except KeyboardInterrupt as stop:
        if kept:
            stop.add_note(kept)
        raise


def _written(folder: Path, cells: list[SceneCell]) -> Iterator[Path]:
    """Write the files of the table and its figure, and yield the name of each file after it is written."""
    from vestige import plots
    from vestige.threats.table import STORE, TABLE, threat_dataset, write_table

    write_table(folder, cells)
    yield folder / TABLE
    yield folder / STORE
    plots.write(plots.threat_map(threat_dataset(cells)), folder / FIGURE)
    yield folder / FIGURE
