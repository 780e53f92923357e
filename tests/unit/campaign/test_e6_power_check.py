"""The check for E6 over a sky: what it sees, and what it leaves alone."""

from __future__ import annotations

import numpy as np

from campaign_checks import checks_of, results_of
from sky_builder import CLEAN
from vestige.records.checks import CheckName, CheckSeries


def power_check(*settings: str) -> CheckSeries:
    return checks_of(results_of(*CLEAN, *settings))[CheckName.E6_POWER]


def test_a_pull_beyond_the_bank_loses_e6() -> None:
    """On the late side taps reach to 75 m. The early detector wants a peak with a tap on either side, so up to 67 m.

    E1 that is pulled to the early side predicts E6 too early. On the other side the bank reaches 600 m.
    """
    pull = 'attack=[{{kind="position-push", svids=[7], bands=["E1"], start_s=20, power_db=12, {}}}]'
    for far_m, lost in ((-50, False), (-80, True), (80, False), (570, False), (630, True)):
        ramp = f'delay_m={{kind="ramp", first=0, last={far_m}, start_s=25, stop_s=60}}'
        failed = power_check("epochs=121", "recs.every=10", pull.format(ramp)).failed
        assert failed[70::10, 1].all() == lost
        assert not np.delete(failed, 1, axis=1).any()
        assert not failed[:20].any()


def test_a_jammer_that_hides_e6_is_a_missing_signal_only_while_e1_is_sound() -> None:
    """With 30 dB in 20.46 MHz nothing is found; once E1 has 20 to 27 dBHz, too, it predicts no detection: not run."""
    jam = '{{kind="jamming", bands=["{}"], start_s={}, j_over_n_db={}}}'
    attack = f"attack=[{jam.format('E6', 20, 30)}, {jam.format('E1', 60, 17)}]"
    check = power_check("epochs=121", "recs.every=10", attack)
    assert check.run[:60:10].all()
    assert not check.failed[:20].any()
    assert check.failed[20:60:10].all()
    assert not check.run[70::10].any()
    assert not check.run[np.arange(121) % 10 > 0].any()
