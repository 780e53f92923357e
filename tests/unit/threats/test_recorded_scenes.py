from __future__ import annotations

from dataclasses import replace

import pytest

from vestige.spoofer.between_recs import BetweenRecs
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import LiftOff
from vestige.threats.recorded_scenes import RecordedScene, recorded_scenes
from vestige.threats.scenes import scene_scenario

RECORDED = tuple(recorded_scenes())


def _named(name: str) -> RecordedScene:
    return next(one for one in RECORDED if one.name == name)


def test_the_threats_that_have_recordings() -> None:
    assert {one.threat.id for one in RECORDED} == {"A1", "A2", "A3", "A5", "A8", "A9", "A11", "A12"}
    assert len({one.name for one in RECORDED}) == len(RECORDED)


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
