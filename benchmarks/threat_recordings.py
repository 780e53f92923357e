"""Measure the threat table on recordings: simulate each scene as samples, track it, and run `vestige process`.

python benchmarks/threat_recordings.py                   # all scenes that have a recording: docs/threats.md
python benchmarks/threat_recordings.py A11 A12           # some attacks
python benchmarks/threat_recordings.py --keep recordings --seed 1

A scene is simulated and tracked once, and judged at levels 1 to 3 with the options of `vestige process`. As in the
threat table, the receiver knows its usual power and C/N0. The usual power is measured in a second without the attack.

The words of the table in docs/threats.md are the expectation, with seed 0. The script ends with exit status 1 if a
measured word differs from the table, and names scene, level, expected word and found word.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vestige.campaign.range_errors import window_of
from vestige.campaign.run_outcome import RunOutcome, outcome_word
from vestige.cli.recordings.process import command, prepared
from vestige.recording.recorded_block import OtherChannels
from vestige.recording.recording import Recording, open_recording
from vestige.recording.tracked.track_recording import TrackedRecording, track_recording
from vestige.records import Band, Status
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated
from vestige.threats.matrix import measure_scenes
from vestige.threats.recorded_outcome import (
    RecordedVerdicts,
    TrackedErrors,
    recorded_outcome,
    recorded_verdicts,
    tracked_errors,
)
from vestige.threats.recorded_scenes import RecordedScene, recorded_scenes
from vestige.threats.scenes import LEVEL_NUMBERS

CALIBRATED_S = 1.0  # length of the samples without the attack that give the usual power
LEAST_FLOOR_M = 1.0  # noise of the loops; the receiver of the threat table computes it from its C/N0
SEARCH_WINDOW_S = 0.05  # search on each side; the receiver trusts its clock to 10 ms
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "threats.md"
HEADING = "## The same scenes as recordings"
NOT_MEASURED = "not measured"
WORDS = {NOT_MEASURED} | {outcome_word(*flags) for flags in product((False, True), repeat=4)}


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneWords:
    """Words of a scene, one for each level: of the receiver model, and of the recording."""

    model: tuple[str, ...]
    recording: tuple[str, ...]

    def differences(self, name: str, found: SceneWords) -> list[str]:
        """Return a sentence for each word that differs in `found`; `name` is that of the scene."""
        return [
            f"{name}, level {level}, {source}: expected {expected}, found {word}"
            for source in ("model", "recording")
            for level, expected, word in zip(LEVEL_NUMBERS, getattr(self, source), getattr(found, source), strict=True)
            if word != expected != NOT_MEASURED
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class MadeRecording:
    """A scene as samples, with the observations from tracking."""

    recorded: RecordedScene
    folder: Path
    opened: Recording
    tracked: TrackedRecording
    errors: TrackedErrors
    usual_power_db: dict[Band, float]

    @property
    def options(self) -> tuple[str, ...]:
        """Options of `vestige process` that a user would give for this receiver."""
        scenario = self.recorded.scenario()
        receiver, sky, position = scenario.receiver, scenario.constellation, scenario.position
        return (
            "--track", "--navigation", str(self.folder / "rinex" / "navigation.rnx"),
            "--search-window", str(SEARCH_WINDOW_S),
            "--usual-e1-power-db", repr(self.usual_power_db[Band.E1]),
            "--usual-e6-power-db", repr(self.usual_power_db[Band.E6]),
            "--usual-e1-cn0-dbhz", repr(receiver.cn0_e1_dbhz),
            "--usual-e6-cn0-dbhz", repr(receiver.cn0_dbhz),
            "--cn0-fall-db", repr(sky.cn0_fall_db),
            "--floor-sigma-m", repr(max(position.floor_sigma_m, LEAST_FLOOR_M)),
            "--ionosphere-sigma-m", repr(position.ionosphere_sigma_m),
            "--multipath-sigma-m", repr(position.multipath_sigma_m),
        )  # fmt: skip

    def judged(self, level: int) -> RecordedVerdicts:
        """Return the verdicts of `vestige process` on the recording at a level."""
        arguments = [str(self.folder), "--level", str(level), *self.options]
        options: dict[str, Any] = command.make_context("process", arguments).params
        processor, source, _ = prepared(self.opened, options, self.tracked, OtherChannels())
        steps = list(processor.steps(source, assistance=source.assistance))
        return recorded_verdicts(self.recorded, steps, self.errors)

    def outcome(self, level: int) -> RunOutcome:
        """Return the outcome of the attack at a level."""
        return recorded_outcome(self.recorded, self.judged(level))


@contextmanager
def made(recorded: RecordedScene, kept: Path | None = None, *, attacked: bool = True) -> Iterator[MadeRecording]:
    """Simulate and track a scene; at the end delete the samples, unless a folder is given that keeps them."""
    how = recorded.recording
    with tempfile.TemporaryDirectory() as temporary:
        folder = (kept or Path(temporary)) / recorded.name.replace(" ", "_").replace(",", "")
        if not folder.exists():
            case = AcasTestCase(scenario=recorded.scenario(attacked=attacked), first=how.first_s, end=how.end_s)
            simulated(case).write(folder, scenario_text="", workers=1)
        opened = open_recording(folder)
        tracked = track_recording(opened)
        yield MadeRecording(
            recorded=recorded,
            folder=folder,
            opened=opened,
            tracked=tracked,
            errors=tracked_errors(recorded, tracked.epochs),
            usual_power_db=usual_power_db(recorded),
        )
        if kept is None:
            shutil.rmtree(folder)


def usual_power_db(recorded: RecordedScene) -> dict[Band, float]:
    """Return the power of both bands without the attack, in dB over one unit of the stored numbers."""
    first_s = recorded.recording.first_s
    source = simulated(AcasTestCase(scenario=recorded.scenario(attacked=False), first=first_s, end=first_s + 2))
    found = {}
    for band in Band:
        n = round(CALIBRATED_S * source.sample_rate_hz)
        values = np.concatenate([batch.samples for batch in source.record(band, at_most=n)])
        power = np.mean(np.abs(values) ** 2) * source.scale("int8") ** 2
        found[band] = round(float(10 * np.log10(power)), 2)
    return found


def table_outcomes(recorded: RecordedScene) -> tuple[RunOutcome, ...]:
    """Return the outcomes of the receiver model of the threat table in the same scene, a level each."""
    scenario = recorded.scenario()
    scenario = scenario.replaced(processor=scenario.processor.model_copy(update={"level": max(LEVEL_NUMBERS)}))
    return measure_scenes(scenario, window_of(scenario))


def expected_words() -> dict[str, SceneWords]:
    """Return the words of the table of recordings in docs/threats.md by the name of the scene."""
    section = DOCUMENT.read_text(encoding="utf-8").partition(HEADING)[2].partition("\n## ")[0]
    words = {}
    for row in re.findall(r"^\| (A\d.*) \|$", section, re.MULTILINE):
        name, *cells = (part.strip("* ") for part in row.split("|"))
        found = tuple(word_of(one) for one in cells)
        words[name] = SceneWords(model=found[::2], recording=found[1::2])
    return words


def word_of(text: str) -> str:
    """Return the word at the beginning of a cell of the table, such as `detected` of `detected (clock 2 s)`."""
    plain = text.replace("*", "").strip()
    found = [word for word in WORDS if plain == word or plain.startswith((f"{word} (", f"{word}, "))]
    if not found:
        raise ValueError(f"{DOCUMENT}: the cell {text!r} begins with no word of the threat table")
    return max(found, key=len)


def cell(found: RunOutcome) -> str:
    """Return the word, the first checks that failed, and the largest wrong range."""
    checks = "; ".join(found.checks.split("; ")[:3])
    wrong = f", range off by {found.worst_range_m:.0f} m" if found.missed else ""
    return f"{found.word}{wrong}{' (' + checks + ')' if checks else ''}"


def line(recorded: RecordedScene, kept: Path | None) -> tuple[str, SceneWords]:
    """Return the line of a scene and its words: those of the table's receiver, and of the recording."""
    begin = time.perf_counter()
    table = table_outcomes(recorded)
    with made(recorded, kept) as one:
        simulated_at = time.perf_counter()
        found = [one.judged(level) for level in LEVEL_NUMBERS]
    for level, verdicts in zip(LEVEL_NUMBERS, found, strict=True):
        print(f"  {recorded.name}, level {level}, RECS and what fails")
        for row, time_s in enumerate(verdicts.time_s):
            failed = [str(name) for name, where in verdicts.failed.items() if where[row].any()]
            kind = "RECS" if verdicts.recs[row] else "    "
            statuses = " ".join(tuple(Status)[place].name[:6] for place in verdicts.status[row])
            if verdicts.recs[row] or failed:
                worst = np.round(verdicts.range_error_m[row]).tolist()
                print(f"    {time_s:7.2f} {kind} {statuses} {worst if verdicts.recs[row] else ''} {', '.join(failed)}")
    outcomes = [recorded_outcome(recorded, one) for one in found]
    cells = " | ".join(f"{model.word} | {cell(one)}" for model, one in zip(table, outcomes, strict=True))
    end = time.perf_counter()
    print(f"  {simulated_at - begin:.0f} s to simulate and track, {end - simulated_at:.0f} s to judge", flush=True)
    words = SceneWords(model=tuple(one.word for one in table), recording=tuple(one.word for one in outcomes))
    return f"| {recorded.name} | {cells} |", words


def main() -> None:
    """Measure the scenes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("threats", nargs="*")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="Folder for the recordings, 0.3 to 0.7 GB each.")
    parser.add_argument("-j", "--workers", type=int, default=1)
    options = parser.parse_args()
    all_scenes = tuple(recorded_scenes(options.seed))
    known = {name for one in all_scenes for name in (one.threat.id, one.name)}
    if unknown := set(options.threats) - known:
        parser.error(f"found {', '.join(sorted(unknown))}, expected {', '.join(sorted(known))}")
    scenes = [one for one in all_scenes if not options.threats or {one.threat.id, one.name} & set(options.threats)]
    with ProcessPoolExecutor(options.workers) as pool:
        lines = [pool.submit(line, one, options.keep) for one in scenes]
        print("| scene |" + "".join(f" level {level}: model | recording |" for level in LEVEL_NUMBERS))
        expected, differences = expected_words() if options.seed == 0 else {}, []
        for one, measured in zip(scenes, lines, strict=True):
            row, words = measured.result()
            print(row, flush=True)
            if one.name in expected:
                differences += expected[one.name].differences(one.name, words)
    for difference in differences:
        print(difference, file=sys.stderr)
    sys.exit(bool(differences))


if __name__ == "__main__":
    main()
