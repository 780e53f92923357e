from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sky_builder import sky_scenario
from vestige.records import Band
from vestige.signal_generator.waveform import open_component
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.scer import Scer, against
from vestige.theory.scer.code_estimation import Estimation, estimation_noise, replayed_mean

T = np.array([0.0, 10.0, 20.0])
RISING = Ramp(first=-10.0, last=10.0, start_s=0.0, stop_s=20.0)


def test_scer_is_a_chip_behind_on_e6() -> None:
    scer = Scer(delay_m=RISING, power_db=0.0)
    e1, e6 = scer.spoofing_signal(Band.E1, T), scer.spoofing_signal(Band.E6, T)
    assert e1 is not None
    assert e6 is not None
    assert e1.delay_m == pytest.approx([-10.0, 0.0, 10.0])
    assert e6.delay_m - e1.delay_m == pytest.approx(np.full(3, 58.6105), abs=1e-3)
    assert e6.delay_rate_mps == pytest.approx([1.0, 1.0, 0.0])
    assert not np.any(scer.noise_over_n0(Band.E1, T))  # its E1 is made, only E6 is repeated
    assert scer.noise_over_n0(Band.E6, T) == pytest.approx(np.full(3, 0.01))


def test_decisions_on_chips_leave_less_noise() -> None:
    """25 dB: −25 dB repeated, −31.9 dB hard, −33.2 dB soft; as the power rises, so does the noise."""
    decided: tuple[tuple[Estimation, float], ...] = (("repeated", -25.0), ("hard", -31.9), ("soft", -33.2))
    for chips, at_0_db in decided:
        scer = Scer(delay_m=0.0, power_db=RISING, reception_gain_db=25.0, chips=chips)
        noise_db = 10 * np.log10(scer.noise_over_n0(Band.E6, T))
        assert noise_db == pytest.approx([at_0_db - 10, at_0_db, at_0_db + 10], abs=0.06)
    off = Scer(delay_m=0.0, power_db=0.0, start_s=5.0, stop_s=15.0, chips="hard").noise_over_n0(Band.E6, T)
    assert (off > 0).tolist() == [False, True, False]


@pytest.mark.parametrize("chips", ["repeated", "hard", "soft"])
def test_e1_is_made_without_noise(chips: Estimation) -> None:
    assert not np.any(Scer(delay_m=0.0, power_db=3.0, chips=chips).noise_over_n0(Band.E1, T))


@pytest.mark.parametrize(
    ("attack", "head_start_s"),
    [
        (Scer(delay_m=0.0, power_db=0.0, symbols="hard", reception_gain_db=5.0), 0.0),
        (Scer(delay_m=0.0, power_db=0.0, symbols="hard", reception_gain_db=0.0, latency_s=2e-6), -2e-6),
        (Scer(delay_m=300.0, power_db=0.0, symbols="hard", reception_gain_db=5.0), 1.0007e-6),
        (Scer(delay_m=0.0, power_db=0.0, symbols="soft", reception_gain_db=5.0), 0.0),
        (Scer(delay_m=300.0, power_db=0.0, symbols="soft", reception_gain_db=5.0, latency_s=3e-6), -1.9993e-6),
    ],
)
def test_drawn_symbols_get_better_as_they_arrive(attack: Scer, head_start_s: float) -> None:
    """1200 symbols: the mean of each chip is that of the theory, within 4.5 standard deviations, for its decision."""
    true, n = open_component(E1B, 11, seed=2), 1200
    replayed = attack.replayed(true, 11, seed=5)
    assert replayed.symbol is None
    period, place = np.divmod(np.arange(n * 40), 40)
    number = period * E1B.code_length + place
    assert true.symbol is not None
    right = replayed.chip(number) * primary_code(E1B, 11)[place] * true.symbol(period)
    mean = right.reshape(n, 40).mean(axis=0)
    expected = replayed_mean(attack.attacker_cn0_dbhz, head_start_s, 40, "soft" if attack.symbols == "soft" else "hard")
    assert np.abs(mean - expected).max() < 4.5 / np.sqrt(n)
    assert np.array_equal(right, replayed.chip(number[::-1])[::-1] * primary_code(E1B, 11)[place] * true.symbol(period))


def test_who_replays_what() -> None:
    """The pilot stays, and so does E1-B of an attacker who knows the symbols; satellites have draws of their own."""
    attack = Scer(delay_m=0.0, power_db=0.0, symbols="hard", reception_gain_db=-40.0)
    pilot, data = open_component(E1C, 11), open_component(E1B, 11)
    assert attack.replayed(pilot, 11, 0) is pilot
    assert Scer(delay_m=0.0, power_db=0.0).replayed(data, 11, 0) is data
    number = np.arange(100)
    drawn = [
        attack.replayed(data, svid, seed).chip(number) * primary_code(E1B, svid)[:100]
        for svid, seed in ((11, 0), (12, 0), (11, 1))
    ]
    assert not any(np.array_equal(one, other) for one, other in pairwise([*drawn, drawn[0]]))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"symbols": "estimated"}, "symbols are one of known, hard, soft, found 'estimated'"),
        ({"chips": "linear"}, "chips are one of repeated, hard, soft, found 'linear'"),
        ({"victim_cn0_dbhz": "measured"}, "a number of dBHz or received, found 'measured'"),
        ({"victim_cn0_dbhz": 450.0}, "victim_cn0_dbhz: found 450 dBHz, expected 0 to 70 dBHz"),
        ({"latency_s": 1.0}, "latency_s: found 1 s, expected 0 to 0.004 s"),
    ],
)
def test_impossible_keys_are_refused(wrong: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Scer(delay_m=0.0, power_db=0.0, **wrong)  # type: ignore[arg-type]


def test_each_satellite_has_the_strength_that_the_victim_has_of_it() -> None:
    """A patch antenna loses 9 dB to the horizon: decisions on the chips of a low satellite are worse by so much."""
    attack = '{kind="scer", delay_m=0.0, power_db=3.0, chips="hard", victim_cn0_dbhz='
    fall = "constellation.cn0_fall_db=9.0"
    received = sky_scenario(fall, f'attack=[{attack}"received"}}]').simulations
    found = {one.svid: one.spoofer.attacks[0].victim_cn0_dbhz for one in received}
    assert found == {one.svid: one.cn0_dbhz for one in received}
    assert max(found.values()) - min(found.values()) > 3.0
    low = min(received, key=lambda one: one.cn0_dbhz)
    same = sky_scenario(fall, f"attack=[{attack}{low.cn0_dbhz}}}]").simulations
    (alike,) = (one for one in same if one.svid == low.svid)
    weakest = estimation_noise(low.cn0_dbhz, 20.0, "hard") * 10**0.3
    assert alike.spoofer.effects(Band.E6, alike.svid, T).white == pytest.approx(len(same) * weakest)
    assert {one.spoofer.attacks[0].victim_cn0_dbhz for one in same} == {low.cn0_dbhz}


def test_a_single_line_of_sight_has_the_strength_of_the_receiver() -> None:
    attack = Scer(delay_m=0.0, power_db=3.0, victim_cn0_dbhz="received")
    assert against((attack, 1), 11, {11: 38.5}) == (replace(attack, victim_cn0_dbhz=38.5), 1)
    with pytest.raises(ValueError, match="depends on the satellite"):
        _ = attack.attacker_cn0_dbhz


def test_decisions_on_the_chips_of_several_satellites_add_their_noise() -> None:
    """Satellites that are not attacked have the noise of those that are, and add none."""
    attack = Scer(delay_m=0.0, power_db=3.0, chips="soft", victim_cn0_dbhz="received", svids=(3, 5, 8))
    cn0_dbhz = {3: 45.0, 5: 41.0, 7: 44.0, 8: 36.0}
    expected = 10**0.3 * sum(estimation_noise(cn0_dbhz[svid], 20.0, "soft") for svid in (3, 5, 8))
    for svid, dbhz in cn0_dbhz.items():
        (found,) = against((attack,), svid, cn0_dbhz)
        assert found.noise_over_n0(Band.E6, T) == pytest.approx(np.full(T.size, expected))
        assert found.attacker_cn0_dbhz == dbhz + 20.0
    (alone,) = against((replace(attack, svids=()),), 5, {5: 41.0})
    assert np.array_equal(
        alone.noise_over_n0(Band.E6, T), replace(attack, victim_cn0_dbhz=41.0).noise_over_n0(Band.E6, T)
    )
    (absent,) = against((attack,), 7, {7: 44.0})
    assert not np.any(absent.noise_over_n0(Band.E6, T))
