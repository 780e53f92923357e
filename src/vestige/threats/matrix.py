"""Measure the threat table: run every scene with many seeds, and write the outcomes of each run to a file.

A run can be repeated in about a second, so only its outcome is kept. A line of `runs.csv` has the outcome of a run at a
mitigation level. Threat, scene, seed, attack or no attack, level and a digest of the scenario identify the line. A
later call adds the missing runs to the file. If the scenario or the version of vestige has changed, the run is measured
again.

All levels of a run are evaluated with the same simulation. Each attacked run is measured a second time without its
attack. Alarms of the second run are false alarms. The worker of the attacked run also measures the second run. If two
scenes differ only in their attacks, and the attacks begin and end at the same times, the scenes share the second run.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from itertools import chain, islice, product
from pathlib import Path

from vestige.campaign.execution.direct import direct_results
from vestige.campaign.range_errors import window_of
from vestige.campaign.run_outcome import RunOutcome, outcomes_of
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.output import naming
from vestige.scenario.campaign import CampaignScenario
from vestige.source_version import vestige_version
from vestige.threats.runs import RUNS, RunKey, line_of, read_runs, write_runs
from vestige.threats.scene_outcome import Agreement, SceneOutcome, agreement, scene_outcome
from vestige.threats.scenes import LEVEL_NUMBERS, Scene, Threat, scene_scenario

_IN_FLIGHT = 6  # number of runs per worker that are submitted in advance, including runs that are already measured
_SEEDS_TOGETHER = 6  # number of seeds whose `undisturbed_truth` a worker keeps for all scenes
Outcomes = tuple[RunOutcome, ...]  # outcomes of a run, in the order of LEVEL_NUMBERS


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Scene that is measured: a scene of the threat table, or a user's own scenario."""

    threat: str  # number of the attack, such as `A3`; – for the user's own scenario
    scene: str  # name of the scene
    # Function that returns the campaign of a seed. The second argument says whether the campaign has the attack.
    scenario: Callable[[int, bool], CampaignScenario]
    row: Threat | None = None  # row of the threat table; None for the user's own scenario
    notes: tuple[str, str, str] = ("", "", "")  # reasons why levels 1, 2 and 3 differ from the expectation
    settings: tuple[str, ...] = ()  # values of `--set`, which replace values of the scene


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneCell:
    """Cell of the threat table: outcome of a case at a level, and agreement of the outcome with the expectation."""

    case: Case
    level: int
    found: SceneOutcome
    attacked: bool

    @property
    def agreement(self) -> Agreement:
        """Agreement of the measured outcome with the expected outcome."""
        return agreement(self.expected, self.found)

    @property
    def expected(self) -> str:
        """Expected outcome; empty for the user's own scenario."""
        return self.case.row.outcome(self.level)[0] if self.case.row else ""

    @property
    def note(self) -> str:
        """Reason why the outcome differs from the expectation or is undecided; empty if no reason applies."""
        differs = self.agreement in (Agreement.DIFFERS, Agreement.UNDECIDED)
        return self.case.notes[self.level - 1] if differs else ""


def cases(threats: Sequence[Threat], settings: tuple[str, ...] = ()) -> tuple[Case, ...]:
    """Return the scenes of the threats as cases; `settings` replace values in every scene, as with `--set`."""
    return tuple(
        Case(
            threat=threat.id,
            scene=scene.name,
            scenario=_scenarios(threat, scene, settings),
            row=threat,
            notes=(scene.notes.get("1", ""), scene.notes.get("2", ""), scene.notes.get("3", "")),
            settings=settings,
        )
        for threat in threats
        for scene in threat.scene
    )


def _scenarios(threat: Threat, scene: Scene, settings: tuple[str, ...]) -> Callable[[int, bool], CampaignScenario]:
    return lambda seed, attacked: scene_scenario(threat, scene, seed, attacked=attacked, settings=settings)


def case_of(name: str, scenario: CampaignScenario, settings: tuple[str, ...] = ()) -> Case:
    """Return a case that measures a user's own scenario with every seed, with and without its attack.

    `settings` are the values of `--set` with which the scenario was loaded. The table shows these values beside the
    results.
    """
    all_columns = scenario.processor.model_copy(update={"level": max(LEVEL_NUMBERS)})

    def seeded(seed: int, attacked: bool) -> CampaignScenario:
        return scenario.replaced(seed=seed, processor=all_columns, **({} if attacked else {"attack": ()}))

    return Case(threat="–", scene=name, scenario=seeded, settings=settings)


def measure_scenes(scenario: CampaignScenario, window_s: tuple[float, float]) -> Outcomes:
    """Return the outcome of a campaign at every level, counted in a window of time.

    The outcome of a campaign without an attack counts false alarms. The scenario must have a constellation, or a
    processor of level 2 or 3. `window_s` is the start and the end of the window in s after the scenario's start. The
    end is excluded.
    """
    plan = ScenarioPlan(scenario=scenario, with_phases=False)  # carrier phases do not affect an outcome
    return outcomes_of(scenario, direct_results(plan, judge=False), LEVEL_NUMBERS, window_s)


def measure_together(scenarios: Sequence[CampaignScenario], window_s: tuple[float, float]) -> tuple[Outcomes, ...]:
    """Return the outcomes of campaigns in one window of time.

    Campaigns that differ only in their attacks can share the simulated truth without attacks.
    """
    return tuple(measure_scenes(one, window_s) for one in scenarios)


def measure_threats(
    chosen: Sequence[Case],
    seeds: Sequence[int],
    pool: Executor,
    *,
    workers: int = 1,
    folder: Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Iterator[SceneCell]:
    """Yield a cell for each case and level, after all runs of all cases have ended.

    The workers of the pool measure the runs in parallel. New runs are added to `runs.csv` in `folder`. Without
    `folder`, no run is stored. `progress` is called with a text, the number of completed runs, and the number of all
    runs. The second runs, without the attack, are not counted.

    The function raises `InputFileError` if `runs.csv` is not a file of runs.
    """
    known = {} if folder is None else read_runs(folder / RUNS)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        write_runs(folder / RUNS, known)
    total, done = len(chosen) * len(seeds), 0
    runs = _runs(chosen, seeds, pool, workers, known, folder)
    found: list[dict[bool, list[Outcomes]]] = [{True: [], False: []} for _ in chosen]
    for number, attacked, outcomes in runs:
        found[number][attacked].append(outcomes)
        done += attacked
        if progress is not None:
            progress("attacked runs", done, total)
    for case, of_case in zip(chosen, found, strict=True):
        yield from _cells(case, of_case, attacked=bool(case.scenario(seeds[0], True).attack))


def _cells(case: Case, found: dict[bool, list[Outcomes]], *, attacked: bool) -> Iterator[SceneCell]:
    for place, level in enumerate(LEVEL_NUMBERS):
        measured = scene_outcome([run[place] for run in found[True]], [run[place] for run in found[False]])
        yield SceneCell(case=case, level=level, found=measured, attacked=attacked)


def _runs(
    chosen: Sequence[Case],
    seeds: Sequence[int],
    pool: Executor,
    workers: int,
    known: dict[RunKey, RunOutcome],
    folder: Path | None,
) -> Iterator[tuple[int, bool, Outcomes]]:
    """Yield case number, presence of an attack, and outcomes at all levels of each run; write new runs to the file.

    The runs of all cases with a group of seeds are submitted before the runs with the next group. The runs of a case
    may begin before the runs of the previous case have ended, so that no worker waits.
    """
    # call that measures a run, and position of the run in the results of this call, by digest of the scenario
    measured: dict[str, tuple[Future[tuple[Outcomes, ...]], int]] = {}

    def submitted() -> Iterator[tuple[int, bool, tuple[RunKey, ...], str]]:
        together = [seeds[first : first + _SEEDS_TOGETHER] for first in range(0, len(seeds), _SEEDS_TOGETHER)]
        for (number, case), seed in chain.from_iterable(product(enumerate(chosen), some) for some in together):
            scenario = case.scenario(seed, True)
            window_s = window_of(scenario)
            both = {True: scenario} | ({False: case.scenario(seed, False)} if scenario.attack else {})
            digests = {attacked: _digest(one, window_s) for attacked, one in both.items()}
            keys = {
                attacked: tuple(
                    (case.threat, case.scene, str(seed), str(int(attacked)), str(level), digest)
                    for level in LEVEL_NUMBERS
                )
                for attacked, digest in digests.items()
            }
            missing = [
                attacked
                for attacked in both
                if digests[attacked] not in measured and not all(key in known for key in keys[attacked])
            ]
            if missing:
                future = pool.submit(measure_together, [both[attacked] for attacked in missing], window_s)
                measured.update((digests[attacked], (future, place)) for place, attacked in enumerate(missing))
            for attacked in both:
                yield number, attacked, keys[attacked], digests[attacked]

    runs = submitted()
    pending = deque(islice(runs, _IN_FLIGHT * workers))
    try:
        while pending:
            number, attacked, keys, digest = pending.popleft()
            if not all(key in known for key in keys):
                future, place = measured[digest]
                known.update(zip(keys, future.result()[place], strict=True))
                if folder is not None:
                    runs_file = folder / RUNS
                    with naming(runs_file), runs_file.open("a", encoding="utf-8", newline="") as file:
                        file.write("".join(line_of(key, known[key]) for key in keys))
            pending.extend(islice(runs, 1))
            yield number, attacked, tuple(known[key] for key in keys)
    finally:
        for future, _ in measured.values():
            future.cancel()


def _digest(scenario: CampaignScenario, window_s: tuple[float, float]) -> str:
    text = " ".join([vestige_version(), str(window_s), scenario.model_dump_json(), *scenario.own_parts])
    return hashlib.sha256(text.encode()).hexdigest()[:16]
