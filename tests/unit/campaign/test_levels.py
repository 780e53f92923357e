"""Levels over campaigns of a sky and of a single line of sight: which checks speak, and what is in use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario
from vestige.acas_processor.levels import LEVELS
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import LevelVerdicts, level_verdicts
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.errors import VestigeError
from vestige.records import Status

ALL = np.ones(600, bool)
MEACONER = 'attack=[{kind="meaconing", start_s=330, delay_s=1e-5, power_db=3}]'
NULLED = (
    'attack=[{kind="meaconing", start_s=330, delay_s=1e-5, power_db=3, reception_gain_db=20},'
    '{kind="nulling", start_s=330, gain_db=-0.5, phase_error_rad=0.07}]'
)


def verdicts(*settings: str) -> dict[int, LevelVerdicts]:
    scenario = sky_scenario(*CLEAN, "epochs=600", *settings)
    return {one.level: one for one in level_verdicts(direct_results(ScenarioPlan(scenario=scenario)))}


@pytest.fixture(scope="module")
def meaconed() -> dict[int, LevelVerdicts]:
    return verdicts(MEACONER)


def test_without_an_attack_all_is_authentic() -> None:
    for level, found in verdicts().items():
        assert not found.first_failures(ALL)
        assert not found.alarm.any()
        assert np.all(found.state[30:] == list(Status).index(Status.AUTHENTIC))
        assert np.all(found.range_error_m[::30] == 0)
        assert not found.earlier.any()
        assert set(found.failed) | set(found.not_run) == {row.name for row in LEVELS[level]}


def test_level_1_takes_the_meaconer_and_level_2_the_earlier_signal(meaconed: dict[int, LevelVerdicts]) -> None:
    after = slice(360, None, 30)
    assert np.all(meaconed[1].range_error_m[after] > 2900)
    assert not meaconed[1].alarm.any()
    for level in (2, 3):
        error_m = meaconed[level].range_error_m[after]
        assert np.isfinite(error_m).mean() > 0.8
        assert np.nanmax(np.abs(error_m)) < 30
        assert np.all(meaconed[level].earlier[after] == np.isfinite(error_m))
        assert meaconed[level].alarm[331:].all()
    assert dict(meaconed[2].first_failures(ALL))["E1 vestigial search"] == 360


def test_a_restarted_receiver_has_no_e1_until_it_has_acquired() -> None:
    """With a RECS in the gap: NOT_AVAILABLE without a reason to accuse anybody; a locked receiver has no gap."""

    def statuses(attack: str, *settings: str) -> list[set[str]]:
        found = verdicts(f'attack=[{{kind="e1-asynchronous", start_s=60, delay_m=5000, {attack}}}]', *settings)[1]
        shown = found.seen[::30]
        return [
            {list(Status)[one].name for one in row[seen]} for row, seen in zip(found.status[::30], shown, strict=True)
        ]

    authentic, unknown, missing = {"AUTHENTIC"}, {"NOT_AVAILABLE"}, {"NOT_DETECTED"}
    short = "epochs=121", "constellation.svids=[6, 24]"
    assert statuses("power_db=10", *short) == [authentic, authentic, unknown, missing, missing]
    long = "receiver.reacquisition_s=30.1"
    assert statuses("power_db=10", *short, long) == [authentic, authentic, unknown, unknown, missing]
    assert statuses("power_db=10, acquired=false", *short) == [authentic] * 5
    assert statuses("power_db=-10", *short) == [authentic, authentic, unknown, authentic, authentic]


def test_nothing_is_judged_by_what_comes_later() -> None:
    """An attack from 200 s on leaves all before as it was, also what is learned from the RECS, of which there were 7.

    But the searches: their chance is drawn for as many signals as a run has at all.
    """
    attack = 'attack=[{kind="meaconing", start_s=200, delay_s=2e-6, power_db=3, acquired=true}]'
    later, quiet = (
        direct_results(ScenarioPlan(scenario=sky_scenario(*CLEAN, "epochs=400", *own))) for own in ((attack,), ())
    )
    for found, usual in zip(level_verdicts(later), level_verdicts(quiet), strict=True):
        for name, without in usual.checks.items():
            if name.endswith("search"):
                continue
            with_attack = found.checks[name]
            np.testing.assert_array_equal(with_attack.statistic[:200], without.statistic[:200], err_msg=name)
            np.testing.assert_array_equal(with_attack.threshold[:200], without.threshold[:200], err_msg=name)
        np.testing.assert_array_equal(found.state[:200], usual.state[:200])
        assert found.alarm[200:].any() == (found.level > 1)


def test_nothing_is_in_use_between_recs(meaconed: dict[int, LevelVerdicts]) -> None:
    between = np.arange(600) % 30 != 0
    assert np.all(np.isnan(meaconed[2].range_error_m[between]))


@pytest.mark.parametrize(("j_over_n_db", "seen"), [(-5.0, False), (-3.0, True)])
def test_a_front_end_that_may_drift_hides_a_rise_below_its_limit(j_over_n_db: float, seen: bool) -> None:
    """One alarm a day of twelve checks is 4.8 σ, of 0.3 dB 1.4 dB: noise adds 1.19 dB, or 1.76 dB."""
    attack = f'attack=[{{kind="osnma-denial", start_s=330, j_over_n_db={j_over_n_db}}}]'
    failures = dict(verdicts(attack)[2].first_failures(ALL))
    assert ("E1 received power" in failures) is seen


def test_nulling_needs_the_exhaustive_search() -> None:
    found = verdicts(NULLED)
    assert "E1 vestigial search" not in dict(found[2].first_failures(ALL))
    assert dict(found[3].first_failures(ALL))["E6 exhaustive search"] >= 330
    assert found[3].searched[0]
    after = slice(360, None, 30)
    assert np.nanmax(np.abs(found[2].range_error_m[after])) > 2900
    assert found[3].earlier[after].mean() > 0.8
    assert np.nanmax(np.abs(found[3].range_error_m[after][found[3].earlier[after]])) < 30


def test_what_a_search_would_find_counts_only_where_one_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vestige.acas_processor.assess.search_due", lambda since_s, *_, **__: since_s is None)
    found = verdicts(NULLED)[3]
    assert np.flatnonzero(found.searched).tolist() == [0]
    assert found.tests["E6 exhaustive search"].any(axis=1).tolist() == found.searched.tolist()
    assert not found.failed["E6 exhaustive search"].any()
    assert not found.earlier.any()


def test_the_earlier_of_two_signals_in_the_correlators_stays_in_use() -> None:
    """E6 alone is repeated, 80 m behind: an alarm, and the earlier signal is where E1 says."""
    attack = 'attack=[{kind="lift-off", bands=["E6"], start_s=300, power_db=3, delay_m=80}]'
    found = verdicts(attack)[2]
    seen = found.failed["E6 second signal"] & found.recs[:, None]
    assert seen[300:].sum() > 40
    assert not np.any(found.state[seen] == list(Status).index(Status.AUTHENTIC))
    assert np.mean(found.range_error_m[seen] == 0.0) > 0.9
    assert not found.earlier[seen].any()


def test_the_error_in_use_is_the_largest_since_the_recs_before() -> None:
    """A lift-off and return between two RECS: 0 at each RECS, 100 m in between, which level 1 takes."""
    attack = 'attack=[{kind="between-recs", start_s=300, top_m=100, power_db=3, period_s=30}]'
    found = verdicts(attack)[1]
    assert np.all(found.range_error_m[330::30] > 80)
    assert np.all(found.range_error_m[:300:30] == 0)


def test_the_verdict_of_a_recs_is_the_gravest_since_the_one_before(meaconed: dict[int, LevelVerdicts]) -> None:
    """What is suspicious between two RECS is in the verdict of the RECS that follows."""
    any_status = np.random.default_rng(7).choice(5, (600, 8), p=(0.5, 0.02, 0.01, 0.02, 0.45)).astype(np.int8)
    gravest = replace(meaconed[2], status=any_status).of_recs()
    order = ["not available", "authentic", "suspect", "not detected", "spoofed"]
    words = [status.value for status in Status]
    worst: dict[int, str] = {}
    for epoch in range(600):
        for satellite in range(8):
            worst[satellite] = max(worst.get(satellite, order[0]), words[any_status[epoch, satellite]], key=order.index)
            expected = worst.pop(satellite) if epoch % 30 == 0 else order[0]
            assert words[gravest[epoch, satellite]] == expected


def test_a_single_line_of_sight_says_what_it_cannot_run() -> None:
    settings = (
        "epochs=60",
        "receiver.accelerometers=none",
        "constellation=none",
        "trajectory=none",
        "position=none",
        "recs.every=1",
        "interval_s=30",
    )
    scenario = sky_scenario(*CLEAN, *settings, "processor.level=3")
    found = {one.level: one for one in level_verdicts(direct_results(ScenarioPlan(scenario=scenario)))}
    assert {"clock slope", "RAIM", "solution separation"} <= set(found[2].not_run)
    assert not {"E6 C/N0", "E1 vestigial search", "C/N0"} & set(found[2].not_run)
    assert not found[3].alarm.any()
    plain = sky_scenario(*CLEAN, *settings)
    with pytest.raises(VestigeError, match="level 2 or 3"):
        level_verdicts(direct_results(ScenarioPlan(scenario=plain)))


def test_each_check_is_made_with_its_share_of_the_level() -> None:
    """Whose budget is free; the searches of a campaign were drawn before the level was known, with less than that."""
    results = direct_results(ScenarioPlan(scenario=sky_scenario(*CLEAN, "epochs=120", "processor.level=3")))
    for found in level_verdicts(results, (2, 3)):
        shares = {name: share.p_fa for name, share in found.budget.items()}
        made = {name: check.p_fa for name, check in found.checks.items()}
        free = {name for name, share in found.budget.items() if share.chosen}
        drawn = {"E1 vestigial search", "E6 exhaustive search"} & free
        assert free <= set(made)
        assert {name: made[name] for name in free - drawn} == pytest.approx(
            {name: shares[name] for name in free - drawn}
        )
        assert all(made[name] < shares[name] for name in drawn)
