"""`vestige threats`: the threat table, its expectations beside what is measured."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

    from vestige.campaign.threat_matrix import Case, Cell
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.threats import Threat

QUICK_SEEDS, SEEDS = 20, 100


@click.command()
@click.option("--level", type=click.IntRange(1, 3), help="Mitigation level to show.  [default: all]")
@click.option(
    "--quick", is_flag=True, help=f"{QUICK_SEEDS} runs of each scene in place of {SEEDS}: less than a minute."
)
@click.option("--seeds", "n_seeds", type=click.IntRange(1, 100_000), help="Runs of each scene.")
@click.option("--only", "ids", multiple=True, metavar="ID", help="Rows to measure: A5. Several times for several.")
@click.option(
    "--attack",
    "files",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A campaign scenario of your own, in place of the table.",
)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder for runs.csv and threats.csv.")
@click.option("-j", "--workers", type=click.IntRange(1, 1024), default=1, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    level: int | None,
    quick: bool,
    n_seeds: int | None,
    ids: tuple[str, ...],
    files: tuple[Path, ...],
    output: Path | None,
    workers: int,
    as_json: bool,
) -> None:
    """Measure what comes of each attack of the threat table, and print it beside what is expected.

    Level 1 is measured, with exact intervals over many seeds; of levels 2 and 3 the expectation is shown. With -o a
    run that was stopped is continued by the same command.
    """
    if quick and n_seeds is not None:
        raise click.UsageError("--quick and --seeds say different numbers of runs")
    if ids and files:
        raise click.UsageError("--only chooses rows of the table, and --attack takes its place")
    if level in (2, 3) and files:
        raise click.UsageError(f"level {level} is not measured yet")

    from vestige.campaign.executors import ONE_THREAD

    os.environ.update(ONE_THREAD)  # before numpy is loaded: runs are what is parallel

    from vestige.campaign.threat_matrix import TABLE, case_of, cases, write_table
    from vestige.cli.threats_report import expectations_text, threats_json, threats_text
    from vestige.scenario.threats import read_threats

    threats = _chosen(read_threats(), ids)
    if level in (2, 3):
        click.echo(threats_json([], threats) if as_json else expectations_text(threats, level))
        return
    chosen = tuple(case_of(path.stem, _load(path, quick)) for path in files) or cases(threats)
    seeds = range(n_seeds or (QUICK_SEEDS if quick else SEEDS))
    cells = list(_measured(chosen, seeds, output, workers))
    if output is not None:
        write_table(output / TABLE, cells)
    rows = () if files else threats
    click.echo(threats_json(cells, rows) if as_json else threats_text(cells, rows, level))
    if output is not None and not as_json:
        click.echo(f"table: {output / TABLE}")


def _chosen(threats: tuple[Threat, ...], ids: tuple[str, ...]) -> tuple[Threat, ...]:
    known = {threat.id: threat for threat in threats}
    for one in ids:
        if one not in known:
            raise click.BadParameter(f"{one}: expected one of {', '.join(known)}", param_hint="--only")
    return tuple(threat for threat in threats if not ids or threat.id in ids)


def _load(path: Path, quick: bool) -> CampaignScenario:
    from vestige.errors import VestigeError
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.load import load_scenario

    scenario = load_scenario(path, ('fidelity="correlators"',) if quick else ())
    if not isinstance(scenario, CampaignScenario):
        raise VestigeError(f"{path}: kind: found {scenario.kind!r}, expected 'campaign'")
    return scenario


def _measured(chosen: tuple[Case, ...], seeds: range, output: Path | None, workers: int) -> Iterator[Cell]:
    """Yield the cells; runs are kept as they end."""
    from vestige.campaign.executors import local_executor
    from vestige.campaign.threat_matrix import measure_threats
    from vestige.cli.progress import progress

    try:
        with local_executor("processes" if workers > 1 else "threads", workers) as pool, progress() as report:
            yield from measure_threats(chosen, seeds, pool, workers=workers, folder=output, progress=report)
    except KeyboardInterrupt as stop:
        if output is not None:
            stop.add_note(f"what was measured is stored in {output}; the same command again continues there")
        raise
