"""The threat table, measured: every scene with many seeds, run by run into a file that a later run continues.

A run is short (some hundredths of a second), so it is not kept as a store: one line of `runs.csv` says what came of it.
A line is known again by threat, scene, seed and a digest of the scenario; lines of another scenario or version are
measured anew. Each attacked run is measured a second time without its attack: alarms there are chance.
"""

from __future__ import annotations

import csv
import hashlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from importlib.metadata import version
from itertools import islice
from pathlib import Path

import numpy as np

from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.threat_outcome import Agreement, RunOutcome, SceneOutcome, agreement, run_outcome, scene_outcome
from vestige.campaign.threat_runs import RUNS, Key, line_of, read_runs, write_runs
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.threats import LEVELS, Scene, Threat, scenario_of

TABLE = "threats.csv"
LEVEL = 1  # what the processor of a campaign does
_IN_FLIGHT = 3  # runs for each worker


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A scene to measure.

    Attributes
    ----------
    threat, scene
        Names.
    scenario
        Gives the campaign of a seed, with or without its attack.
    row
        The row of the table it belongs to; None for a scenario of the user's.
    note
        Why it may differ.
    """

    threat: str
    scene: str
    scenario: Callable[[int, bool], CampaignScenario]
    row: Threat | None = None
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A case, what came of it at level 1, and how that compares with what was expected."""

    case: Case
    found: SceneOutcome
    attacked: bool
    agreement: Agreement


def cases(threats: Sequence[Threat]) -> tuple[Case, ...]:
    """Return the scenes of threats."""
    return tuple(
        Case(
            threat=threat.id,
            scene=scene.name,
            scenario=_scenarios(threat, scene),
            row=threat,
            note=scene.note or threat.note,
        )
        for threat in threats
        for scene in threat.scene
    )


def _scenarios(threat: Threat, scene: Scene) -> Callable[[int, bool], CampaignScenario]:
    return lambda seed, attacked: scenario_of(threat, scene, seed, attacked=attacked)


def case_of(name: str, scenario: CampaignScenario) -> Case:
    """Return a scenario as a case; its seeds are those of the others."""

    def seeded(seed: int, attacked: bool) -> CampaignScenario:
        return scenario.model_copy(update={"seed": seed} | ({} if attacked else {"attack": ()}))

    return Case(threat="–", scene=name, scenario=seeded)


def measure(scenario: CampaignScenario, window_s: tuple[float, float]) -> RunOutcome:
    """Return what came of one campaign in a window of time: of the attack, or, without any, of chance."""
    plan = ScenarioPlan(scenario=scenario)
    results = plan.measure(0, plan.prepare().advance(0, plan.n_epochs))
    time_s = results["time_s"]
    limit_m = scenario.processor.kappa * scenario.processor.budget.sigma_m
    return run_outcome(results, (time_s >= window_s[0]) & (time_s < window_s[1]), limit_m)


def window_of(scenario: CampaignScenario) -> tuple[float, float]:
    """Return when the attacks of a scenario act, from the first start to the last stop; always if there are none."""
    starts_s = [attack.start_s for attack in scenario.attack]
    stops_s = [attack.stop_s for attack in scenario.attack]
    return min(starts_s, default=0.0), max(stops_s, default=np.inf)


def measure_threats(
    chosen: Sequence[Case],
    seeds: Sequence[int],
    pool: Executor,
    *,
    workers: int = 1,
    folder: Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Iterator[Cell]:
    """Yield one cell for each case as soon as all its runs are measured.

    Parameters
    ----------
    chosen
        What to measure.
    seeds
        Of the runs of each case.
    pool, workers
        Where runs are measured, and how many at the same time.
    folder
        Where `runs.csv` is kept and continued; without it nothing is.
    progress
        Called with the number of runs that are known, and of all.

    Raises
    ------
    InputFileError
        If `runs.csv` is something else.
    """
    known = {} if folder is None else read_runs(folder / RUNS)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        write_runs(folder / RUNS, known)
    total, done = len(chosen) * len(seeds), 0
    for case in chosen:
        first = case.scenario(seeds[0], True)
        found: dict[bool, list[RunOutcome]] = {True: [], False: []}
        for attacked, outcome in _runs(case, seeds, pool, workers, known, folder):
            found[attacked].append(outcome)
            done += attacked
            if progress is not None:
                progress("attacked runs", done, total)
        measured = scene_outcome(found[True], found[False], interval_s=first.interval_s, kappa=first.processor.kappa)
        expected = case.row.outcome(LEVEL)[0] if case.row else ""
        attacked = bool(first.attack)
        yield Cell(case=case, found=measured, attacked=attacked, agreement=agreement(expected, measured))


def _runs(
    case: Case,
    seeds: Sequence[int],
    pool: Executor,
    workers: int,
    known: dict[Key, RunOutcome],
    folder: Path | None,
) -> Iterator[tuple[bool, RunOutcome]]:
    """Yield whether attacked, and outcome, of each run of a case in order; new ones go into the file."""

    def submitted() -> Iterator[tuple[bool, Key, Future[RunOutcome] | None]]:
        for seed in seeds:
            scenario = case.scenario(seed, True)
            window_s = window_of(scenario)
            both = {True: scenario} | ({False: case.scenario(seed, False)} if scenario.attack else {})
            for attacked, one in both.items():
                key = (case.threat, case.scene, str(seed), str(int(attacked)), _digest(one, window_s))
                yield attacked, key, None if key in known else pool.submit(measure, one, window_s)

    runs = submitted()
    pending = deque(islice(runs, _IN_FLIGHT * workers))
    try:
        while pending:
            attacked, key, future = pending.popleft()
            if future is not None:
                known[key] = future.result()
                if folder is not None:
                    with (folder / RUNS).open("a", encoding="utf-8", newline="") as file:
                        file.write(line_of(key, known[key]))
            pending.extend(islice(runs, 1))
            yield attacked, known[key]
    finally:
        for _, _, future in pending:
            if future is not None:
                future.cancel()


def _digest(scenario: CampaignScenario, window_s: tuple[float, float]) -> str:
    text = f"{version('vestige')} {window_s} {scenario.model_dump_json()}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def write_table(path: Path, cells: Sequence[Cell]) -> None:
    """Write the table as CSV, one row a cell; the file is there as a whole or not at all."""
    rows = [row_of(cell) for cell in cells]
    part = path.with_name(f".{path.name}")
    with part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else ["threat"])
        writer.writeheader()
        writer.writerows(rows)
    part.replace(path)


def row_of(cell: Cell) -> dict[str, object]:
    """Return everything about a cell under the names of the table's columns."""
    row, found = cell.case.row, cell.found
    expected = {f"expected_level_{level}": row.expected[str(level)] if row else "" for level in LEVELS}  # type: ignore[index]
    counts = {
        name: getattr(found, name) for name in ("detected", "mitigated", "missed", "denied", "by_chance", "alarms")
    }
    intervals = {
        f"{name}{part}": value
        for name, one in counts.items()
        for part, value in (("", one.successes), ("_of", one.trials), ("_low", one.low), ("_high", one.high))
    }
    a_day = dict(zip(("alarms_a_day", "alarms_a_day_low", "alarms_a_day_high"), found.alarms_a_day, strict=True))
    return {
        "threat": cell.case.threat,
        "attack": row.name if row else "",
        "scene": cell.case.scene,
        "e1": row.e1 if row else "",
        "e6": row.e6 if row else "",
        "source": row.source if row else "",
        **expected,
        "level_1": cell.agreement.value,
        **intervals,
        **a_day,
        "time_to_detect_s": found.time_to_detect_s,
        "worst_accepted_m": found.worst_accepted_m,
        "shows": row.shows if row else "",
        "note": cell.case.note if cell.agreement in (Agreement.DIFFERS, Agreement.UNDECIDED) else "",
    }
