from __future__ import annotations

from math import erfc, sqrt

import pytest

from vestige.acas_processor.levels import LEVELS
from vestige.acas_processor.monitoring.alarm_budget import Cadence, false_alarm_budget, set_kappa
from vestige.errors import VestigeError

EIGHT = Cadence(satellites=8)


BANK_P_FA = 46e-7


@pytest.mark.parametrize("level", sorted(LEVELS))
def test_chosen_shares_add_up_to_the_budget(level: int) -> None:
    shares = false_alarm_budget(level, EIGHT)
    assert list(shares) == [row.name for row in LEVELS[level]]
    chosen = [share.alarms_a_day for share in shares.values() if share.chosen]
    assert sum(chosen) == pytest.approx(1.0 if level > 1 else 0.0)
    assert max(chosen, default=0.0) == pytest.approx(min(chosen, default=0.0))


@pytest.mark.parametrize("alarms", [0.2, 1.0, 50.0])
@pytest.mark.parametrize("level", sorted(LEVELS))
def test_a_whole_level_keeps_the_alarms_that_are_set(level: int, alarms: float) -> None:
    """All checks together; only power–distortion leaves some unused, as its confirmations are whole numbers."""
    shares = false_alarm_budget(level, EIGHT, alarms_per_day=alarms, bank_p_fa=BANK_P_FA)
    assert list(shares) == [row.name for row in LEVELS[level]]
    unused = 0.0
    if level == 3:
        unused = shares["RAIM"].alarms_a_day - shares["power-distortion"].alarms_a_day
        assert unused >= 0
    assert sum(share.alarms_a_day for share in shares.values()) + unused == pytest.approx(alarms)
    equal = [share.alarms_a_day for name, share in shares.items() if share.chosen and name != "E1-E6 range"]
    assert max(equal) == pytest.approx(min(equal))


def test_the_range_limit_follows_from_the_alarms_a_day() -> None:
    """Noise in 46 correlators is 0.106 a day of eight satellites; half of the rest: erfc(κ/√2) = 1.94e-5, κ = 4.27."""
    share = false_alarm_budget(1, EIGHT, alarms_per_day=1.0, bank_p_fa=BANK_P_FA)["E1-E6 range"]
    assert share.p_fa == pytest.approx((1 - 0.105984) / 2 / 23_040 + BANK_P_FA)
    assert set_kappa(share, BANK_P_FA) == pytest.approx(4.272, abs=1e-3)
    assert erfc(set_kappa(share, BANK_P_FA) / sqrt(2)) == pytest.approx(share.p_fa - BANK_P_FA)


def test_confirmations_follow_from_the_alarms_a_day() -> None:
    """0.006⁴ of 691,200 are 0.0009 a day; three in a row would be 0.15, more than a share of one alarm a day."""
    assert false_alarm_budget(3, EIGHT, alarms_per_day=1.0)["power-distortion"].confirm == 4
    assert false_alarm_budget(3, EIGHT, alarms_per_day=50.0)["power-distortion"].confirm == 3


def test_fewer_alarms_than_noise_in_the_correlators_brings_are_refused() -> None:
    with pytest.raises(VestigeError, match=r"alarms_per_day: found 0\.1, expected more than 0\.11"):
        false_alarm_budget(1, EIGHT, alarms_per_day=0.1, bank_p_fa=BANK_P_FA)


def test_a_share_is_spread_over_the_tests_of_a_day() -> None:
    """Eight satellites: 8 × 86,400 C/N0s, 8 × 2880 hand-over searches, and the receiver's clock 86,400 times a day."""
    shares = false_alarm_budget(2, EIGHT)
    share = 1 / 12  # of twelve checks: fourteen of the level without the two of level 1
    assert shares["C/N0"].p_fa == pytest.approx(share / 691_200)
    assert shares["E1 vestigial search"].p_fa == pytest.approx(share / 23_040)
    assert shares["clock slope"].p_fa == pytest.approx(share / 86_400)


def test_checks_with_a_budget_of_their_own_are_bounds() -> None:
    """3 σ: 0.27 %; power–distortion three times in a row: 0.006³ of 691,200."""
    shares = false_alarm_budget(3, EIGHT)
    assert shares["E1-E6 range"].p_fa == pytest.approx(0.0026998, rel=1e-4)
    assert not shares["E1-E6 range"].chosen
    assert shares["power-distortion"].alarms_a_day == pytest.approx(0.149, abs=1e-3)
