"""Scenes of the threat table as samples, through the processor of `vestige process`: the words of the table.

`benchmarks/threat_recordings.py` measures all scenes of the table of docs/threats.md and compares the words. Here is
the scene that samples decide most: A11 with a locked carrier, which the correlators see between two RECS. Five of its
satellites are honest: they are the control.

Five more scenes have three satellites, and four of them are shorter than in the table. Each scene needs another
defence: the search on E1 (A3), E6 power and received power (A8 CW), the search on E1 where a thousand code phases
exceed its threshold (A8 chirp), the key of OSNMA and received power (A9), the range check (A2).
"""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from script_loader import benchmark
from vestige.acas_processor.levels import POSITION
from vestige.records import Status
from vestige.records.checks import CheckName
from vestige.threats.recorded_outcome import RecordedVerdicts, recorded_outcome, svids_of
from vestige.threats.recorded_scenes import RecordedScene, recorded_scenes
from vestige.threats.scenes import LEVEL_NUMBERS

BETWEEN_RECS = "A11 three satellites, carrier locked"
SPOOFED = (6, 12, 23)
# for each short scene its end in s, and for each of its levels a check that must fail; empty if no check fails
SHORT = {
    "A2 lift-off": (313, {1: "E1-E6 range"}),
    "A3 repeater, receiver already tracking": (304, {1: "", 2: "E1 vestigial search"}),
    "A8 CW": (304, {1: "E6 power", 2: "E6 received power"}),
    "A8 chirp": (304, {1: "", 2: "E1 vestigial search"}),
    "A9 noise on E1": (304, {1: "", 2: "E1 received power"}),
}


def _scene(name: str) -> RecordedScene:
    return next(one for one in recorded_scenes() if one.name == name)


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return benchmark("threat_recordings")


@pytest.mark.parametrize("name", SHORT)
def test_the_words_of_short_scenes(name: str, script: ModuleType) -> None:
    """They are those of the table in docs/threats.md, and the check that makes the word fails."""
    end_s, checks = SHORT[name]
    one = _scene(name)
    changes = {"first_s": 298, "end_s": end_s, "svids": (6, 13, 23)}
    short = replace(one, recording=one.recording.model_copy(update=changes))
    expected = script.expected_words()[name].recording
    with script.made(short) as made:
        for level, check in checks.items():
            found = made.outcome(level)
            assert found.word == expected[level - 1], f"level {level}: {found}"
            failed = {text.rpartition(" ")[0] for text in found.checks.split("; ")}
            assert check in failed, f"level {level}: {found}"


@pytest.mark.parametrize("recorded", [pytest.param(one, id=one.name) for one in recorded_scenes()])
def test_the_words_of_the_model(recorded: RecordedScene, script: ModuleType) -> None:
    """Those of the receiver model in the same short scene are in the table, too."""
    words = tuple(one.word for one in script.table_outcomes(recorded))
    assert words == script.expected_words()[recorded.name].model


@pytest.fixture(scope="module")
def between_recs(script: ModuleType) -> dict[int, RecordedVerdicts]:
    """What each level says of the recording, which is tracked once."""
    with script.made(_scene(BETWEEN_RECS)) as one:
        return {level: one.judged(level) for level in LEVEL_NUMBERS}


def test_power_distortion_sees_a_lift_off_between_two_recs(between_recs: dict[int, RecordedVerdicts]) -> None:
    """It makes satellites SUSPECT between the two RECS, and no satellite that is not spoofed."""
    found = between_recs[3]
    failed = found.failed[CheckName.POWER_DISTORTION]
    between = ~found.recs
    assert found.time_s[found.recs].size == 2
    rows = failed.any(axis=1)
    assert np.count_nonzero(rows & between) >= 3
    assert np.all(np.diff(found.time_s[rows]) < 1.5)
    assert found.time_s[rows][0] > found.time_s[found.recs][0]
    assert np.all(found.status[failed & between[:, None]] == POSITION[Status.SUSPECT])
    svids = np.array(svids_of(_scene(BETWEEN_RECS)))
    assert set(svids[failed.any(axis=0)].tolist()) <= set(SPOOFED)


@pytest.mark.judged(
    by="threat table on samples",
    what="threat table",
    figure="the same outcomes: missed, detected, detected",
)
def test_the_words_of_a_lift_off_between_two_recs(
    between_recs: dict[int, RecordedVerdicts], script: ModuleType
) -> None:
    """They are those of the table in docs/threats.md: missed, detected, detected."""
    recorded = _scene(BETWEEN_RECS)
    words = tuple(recorded_outcome(recorded, found).word for found in between_recs.values())
    assert words == script.expected_words()[BETWEEN_RECS].recording == ("missed", "detected", "detected")
