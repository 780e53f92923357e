"""The checks of one RECS over a sky: what they see, and what they leave alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.sky_builder import CLEAN, sky_scenario

from vestige.campaign.monitoring import Track, tracks
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan


def tracks_of(folder: Path, *settings: str) -> dict[str, Track]:
    results = run(ScenarioPlan(scenario=sky_scenario(*CLEAN, *settings)), folder / "sky")
    return {one.name: one for one in tracks(results)}


def test_a_pull_beyond_the_bank_loses_e6(tmp_path: Path) -> None:
    """Taps reach to 75 m; the early detector wants a peak with a tap on either side, so up to 60 m and half a tap."""
    pull = 'attack=[{{kind="position-push", svids=[7], bands=["E1"], start_s=20, power_db=12, {}}}]'
    for far_m, lost in ((50, False), (80, True)):
        ramp = f'delay_m={{kind="ramp", first=0, last={far_m}, start_s=25, stop_s=60}}'
        found = tracks_of(tmp_path / str(far_m), "epochs=121", "recs.every=10", pull.format(ramp))
        failed = found["E6 power"].failed
        assert failed[70::10, 1].all() == lost
        assert not np.delete(failed, 1, axis=1).any()
        assert not failed[:20].any()


def test_a_jammer_that_hides_e6_is_a_missing_signal_only_while_e1_is_sound(tmp_path: Path) -> None:
    """With 30 dB in 20.46 MHz nothing is found; once E1 has 20 to 27 dBHz, too, it predicts no detection: not run."""
    jam = '{{kind="jamming", bands=["{}"], start_s={}, j_over_n_db={}}}'
    attack = f"attack=[{jam.format('E6', 20, 30)}, {jam.format('E1', 60, 17)}]"
    track = tracks_of(tmp_path, "epochs=121", "recs.every=10", attack)["E6 power"]
    assert track.run[:60:10].all()
    assert not track.failed[:20].any()
    assert track.failed[20:60:10].all()
    assert not track.run[70::10].any()
    assert not track.run[np.arange(121) % 10 > 0].any()
