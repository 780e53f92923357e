"""Checks over a campaign of a sky: false alarms meet their budget where the world is as supposed, attacks are seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from tests.sky_builder import CLEAN, sky_scenario

from vestige.campaign.monitoring import Track, tracks
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test
from vestige.errors import VestigeError

P_FA = 0.01
PUSH = (
    'attack=[{kind="time-push", start_s=100, '
    'delay_m={kind="ramp", first=0, last=600, start_s=150, stop_s=250}, power_db=6}]'
)


def tracks_of(folder: Path, *settings: str, p_fa: float = P_FA) -> dict[str, Track]:
    results = run(ScenarioPlan(scenario=sky_scenario(*CLEAN, *settings)), folder / "sky")
    return {one.name: one for one in tracks(results, p_fa=p_fa, cn0_model_sigma_db=0.0)}


def test_false_alarms_meet_their_budget_in_a_clean_world(tmp_path: Path) -> None:
    found = tracks_of(tmp_path, "epochs=3600", "recs.every=5")
    assert len(found) == 13
    for name, track in found.items():
        alarms = track.alarms
        assert alarms.trials > (100 if name.startswith("OSNMA") else 3500), name
        if name == "C/N0":  # the loop's noise and the skew of the logarithm: 1.4 times the budget at most
            assert alarms.value < 1.4 * track.p_fa
        elif name.startswith("clock"):  # neighbouring epochs share a drift: half as many independent trials
            assert binomial_test(alarms.successes // 2, alarms.trials // 2, track.p_fa) > 1e-6, name
        elif track.exact:
            assert binomial_test(alarms.successes, alarms.trials, track.p_fa) > 1e-6, name
        else:
            assert alarms.low <= track.p_fa, name


def test_a_time_push_is_seen_by_the_clock_and_by_power_and_not_by_raim(tmp_path: Path) -> None:
    found = tracks_of(tmp_path, "epochs=300", "recs.every=4", PUSH, p_fa=1e-5)
    during = slice(155, 250)
    assert found["E1 received power"].failed[during].all()
    assert found["clock innovation"].failed[150:156].any()
    assert not found["RAIM"].failed.any()
    for track in found.values():
        assert not track.failed[:100].any() or track.name == "power-distortion"


def test_other_results_are_refused() -> None:
    with pytest.raises(VestigeError, match="constellation"):
        tracks(xarray.Dataset({"time_s": ("epoch", np.zeros(3))}))
