"""Scenes of the threat table as samples, through the processor of `vestige process`: the words of the table.

`benchmarks/threat_recordings.py` makes the table of docs/threats.md, in which all scenes stand. Here is the one that
samples decide most: A11 with a locked carrier, which the correlators see between two RECS. Five of its satellites are
honest: they are the control.
"""

from __future__ import annotations

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


def _scene(name: str) -> RecordedScene:
    return next(one for one in recorded_scenes() if one.name == name)


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return benchmark("threat_recordings")


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
    """Those of the threat table's receiver on the same scene: missed, detected, detected."""
    recorded = _scene(BETWEEN_RECS)
    words = [recorded_outcome(recorded, found).word for found in between_recs.values()]
    assert words == [one.word for one in script.table_outcomes(recorded)] == ["missed", "detected", "detected"]
