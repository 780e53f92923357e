from __future__ import annotations

from dataclasses import replace

import pytest

from script_loader import benchmark
from vestige.spoofer.between_recs import BetweenRecs
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import LiftOff
from vestige.threats.recorded_scenes import RecordedScene, recorded_scenes
from vestige.threats.scenes import LEVEL_NUMBERS, scene_scenario

RECORDED = tuple(recorded_scenes())


def _named(name: str) -> RecordedScene:
    return next(one for one in RECORDED if one.name == name)


def test_the_threats_that_have_recordings() -> None:
    assert {one.threat.id for one in RECORDED} == {"A1", "A2", "A3", "A5", "A8", "A9", "A11", "A12"}
    assert len({one.name for one in RECORDED}) == len(RECORDED)


def test_the_table_of_the_documentation_has_all_recordings_and_marks_what_differs() -> None:
    """It has a row for each recording, in the same order; a word that differs from the model is bold."""
    script = benchmark("threat_recordings")
    words = script.expected_words()
    assert list(words) == [one.name for one in RECORDED]
    different = [
        f"{name} level {level}"
        for name, row in words.items()
        for level, model, recording in zip(LEVEL_NUMBERS, row.model, row.recording, strict=True)
        if model != recording != script.NOT_MEASURED
    ]
    text = script.DOCUMENT.read_text(encoding="utf-8")
    rows = [row.split(" | ") for row in text.splitlines() if row.startswith("| A") and row[2:].split(" | ")[0] in words]
    bold = [f"{row[0][2:]} level {k // 2}" for row in rows for k, cell in enumerate(row) if cell.startswith("**")]
    assert different == bold
    n = sum(word != script.NOT_MEASURED for row in words.values() for word in row.recording)
    assert f"in {n - len(different)} of the {n} pairs of cells" in " ".join(text.split())


def test_a_word_that_differs_is_named() -> None:
    words = benchmark("threat_recordings").SceneWords
    expected = words(model=("missed", "detected", "detected"), recording=("missed", "detected", "detected"))
    found = words(model=("missed", "detected", "detected"), recording=("missed", "no alarm, no harm", "detected"))
    assert expected.differences("A0 none", expected) == []
    assert expected.differences("A0 none", found) == [
        "A0 none, level 2, recording: expected detected, found no alarm, no harm"
    ]


@pytest.mark.parametrize("recorded", RECORDED, ids=lambda one: one.name)
def test_a_recording_is_the_scene_of_the_table(recorded: RecordedScene) -> None:
    """The attack is that of the table's scene and seed; where nothing is faster, to the bit.

    A receiver that tracks before the attack begins is locked, and is not restarted.
    """
    short = recorded.scenario()
    whole = scene_scenario(recorded.threat, recorded.scene, 0)
    assert [type(one) for one in short.attack] == [type(one) for one in whole.attack]
    if recorded.recording.faster == 1:
        before = recorded.recording.first_s < min(one.start_s for one in whole.attack)
        locked = {"acquired": False} if before else {}
        assert short.attack == tuple(
            replace(one, **locked) if hasattr(one, "acquired") else one for one in whole.attack
        )
    assert recorded.scenario(attacked=False).attack == ()
    assert short.receiver.cn0_e1_dbhz == whole.receiver.cn0_e1_dbhz
    assert {svid for one in short.attack for svid in getattr(one, "svids", None) or ()} <= set(recorded.recording.svids)
    assert recorded.recording.first_s < recorded.recording.end_s == short.epochs


def test_ten_times_faster() -> None:
    """A2 rises for 60 s and leaves with 1 m/s: here for 6 s and with 10 m/s, to the same power and delay."""
    (attack,) = _named("A2 lift-off").scenario().attack
    (whole,) = scene_scenario(_named("A2 lift-off").threat, _named("A2 lift-off").scene, 0).attack
    assert isinstance(attack, LiftOff)
    assert isinstance(whole, LiftOff)
    assert attack.start_s == 300
    assert attack.delay_m == Ramp(first=0, last=540, start_s=306, stop_s=360)
    assert isinstance(attack.power_db, Ramp)
    assert isinstance(whole.power_db, Ramp)
    assert (attack.power_db.start_s, attack.power_db.stop_s) == (300, 306)
    assert attack.power_db.last == whole.power_db.last


def test_a_duration_is_shorter() -> None:
    (attack,) = _named("A11 all satellites").scenario().attack
    assert isinstance(attack, BetweenRecs)
    assert (attack.period_s, attack.top_m) == (15, 100)
