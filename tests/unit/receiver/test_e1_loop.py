from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vestige.receiver.correlators.e1_loop import E1Loop, E1Tracking
from vestige.receiver.correlators.e1_multipath import e1_multipath_error_m
from vestige.records import Band
from vestige.spoofer.attack import Attack
from vestige.spoofer.interference import Jam
from vestige.spoofer.phase import Coherent, Locked, Phase, Slipping
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import E1Asynchronous, LiftOff, Meaconing, Nulling
from vestige.spoofer.spoofer import Spoofer

E1 = (Band.E1,)
PULL = Ramp(first=0.0, last=700.0, start_s=60.0, stop_s=410.0)  # 2 m/s, to 2.4 chips of E1
NAMES = ("error_m", "worst_error_m", "rate_error_mps", "gain", "acquiring", "captured")


def _tracked(
    *attacks: Attack, epochs: int = 480, interval_s: float = 1.0, cn0_dbhz: float = 40.0, reacquisition_s: float = 1.0
) -> E1Tracking:
    spoofer = Spoofer(attacks=attacks)  # type: ignore[arg-type]
    loop = E1Loop(spoofer, 11, interval_s=interval_s, cn0_dbhz=cn0_dbhz, reacquisition_s=reacquisition_s)
    return loop.advance(0, epochs)


def _lift_off(power_db: float, phase: Phase) -> LiftOff:
    power = Ramp(first=-30.0, last=power_db, start_s=0.0, stop_s=50.0)
    return LiftOff(delay_m=PULL, power_db=power, phase=phase, bands=E1)


PHASES = [
    *(Locked(phase_rad=float(phase)) for phase in np.arange(0, 2 * np.pi, np.pi / 4)),
    *(Coherent(phase_rad=phase) for phase in (0.0, 1.0, 2.0)),
    *(Slipping(slip_hz=slip_hz) for slip_hz in (0.1, -0.37, 2.0)),
]


@pytest.mark.parametrize("phase", PHASES)
def test_capture_from_an_aligned_start(phase: Phase) -> None:
    """At most 0 dB never takes the loop along, at least 0.5 dB always does, whatever the phase [JWCN18, Eq. 4-6]."""
    for power_db in (-6.0, -0.5, 0.0):
        tracked = _tracked(_lift_off(power_db, phase))
        assert abs(tracked.error_m[-1]) < 0.01, power_db
        assert not tracked.captured[-1]
    for power_db in (0.5, 3.0, 10.0):
        tracked = _tracked(_lift_off(power_db, phase))
        assert tracked.error_m[-1] == pytest.approx(700.0, abs=0.01), power_db
        assert tracked.captured[-1]


@settings(max_examples=20, deadline=None)
@given(power_db=st.floats(-3.0, 0.0), phase_rad=st.floats(0.0, 6.28), slip_hz=st.floats(-2.0, 2.0))
def test_never_at_most_0_db(power_db: float, phase_rad: float, slip_hz: float) -> None:
    tracked = _tracked(_lift_off(power_db, Slipping(slip_hz=slip_hz, phase_rad=phase_rad)))
    assert abs(tracked.error_m[-1]) < 0.01


def test_a_loop_in_lock_does_not_see_what_is_a_chip_away() -> None:
    tracked = _tracked(E1Asynchronous(delay_m=600.0, power_db=20.0, acquired=False), epochs=20)
    assert np.all(tracked.error_m == 0)
    assert np.all(tracked.gain == 1)


def test_a_receiver_that_acquires_takes_the_strongest() -> None:
    for power_db, expected_m in ((10.0, 5000.0), (-3.0, 0.0)):
        tracked = _tracked(E1Asynchronous(delay_m=5000.0, power_db=power_db, start_s=10.0, stop_s=20.0), epochs=30)
        assert tracked.error_m[10:20] == pytest.approx(np.full(10, expected_m), abs=1e-6)
        assert tracked.error_m[[9, 20]] == pytest.approx(0.0, abs=1e-6)


def test_jamming_first_lets_an_asynchronous_spoofer_in() -> None:
    """Both attacks know nothing of each other; the receiver loses lock, and then acquires the stronger signal."""
    jam = Jam(j_over_n_db=40.0, start_s=5.0, stop_s=10.0, bands=E1)
    spoof = E1Asynchronous(delay_m=5000.0, power_db=6.0, start_s=7.0, acquired=False)
    tracked = _tracked(jam, spoof, epochs=20)
    assert tracked.error_m[4] == 0
    assert tracked.error_m[-1] == pytest.approx(5000.0, abs=1e-6)


def _acquiring(tracked: E1Tracking, interval_s: float = 1.0) -> list[float]:
    """Return the times of the epochs without measurements."""
    return (np.flatnonzero(tracked.acquiring) * interval_s).round(9).tolist()


@pytest.mark.parametrize(("interval_s", "reacquisition_s", "steps"), [(1.0, 1.0, 1), (0.1, 1.0, 10), (0.1, 0.25, 3)])
def test_a_restarted_receiver_has_nothing_until_it_has_acquired(
    interval_s: float, reacquisition_s: float, steps: int
) -> None:
    attack = E1Asynchronous(delay_m=5000.0, power_db=10.0, start_s=10.0)
    epochs = round(12 / interval_s)
    tracked = _tracked(attack, epochs=epochs, interval_s=interval_s, reacquisition_s=reacquisition_s)
    first = round(10 / interval_s)
    assert np.flatnonzero(tracked.acquiring).tolist() == list(range(first, first + steps))
    assert tracked.captured.tolist() == [False] * (first + steps) + [True] * (epochs - first - steps)
    assert np.all(tracked.worst_error_m[: first + steps] == 0.0), "no measurement, no error"
    assert tracked.worst_error_m[first + steps] == pytest.approx(5000.0, abs=1e-6)


def test_who_is_locked_or_has_acquired_before_has_no_gap() -> None:
    """A locked receiver; one that was switched on under an attack from the start; one that acquires at once."""
    for start_s, acquired, reacquisition_s, expected_m in (
        (10.0, False, 1.0, 0.0),
        (0.0, True, 5.0, 5000.0),
        (10.0, True, 0.0, 5000.0),
    ):
        attack = E1Asynchronous(delay_m=5000.0, power_db=10.0, start_s=start_s, acquired=acquired)
        tracked = _tracked(attack, epochs=15, reacquisition_s=reacquisition_s)
        assert not tracked.acquiring.any()
        assert tracked.error_m[10] == pytest.approx(expected_m, abs=1e-6)


def test_a_jammed_receiver_acquires_once_there_is_a_signal() -> None:
    """40 dB over the noise leaves 0 dBHz from 5 to 10 s; what comes to the receiver in between does not help."""
    jam = Jam(j_over_n_db=40.0, start_s=5.0, stop_s=10.0, bands=E1)
    restart = E1Asynchronous(delay_m=5000.0, power_db=-10.0, start_s=9.0)
    for attacks in ((jam,), (jam, restart)):
        assert _acquiring(_tracked(*attacks, epochs=15)) == [5.0, 6.0, 7.0, 8.0, 9.0, 10.0]
        slow = _tracked(*attacks, epochs=150, interval_s=0.1, reacquisition_s=2.05)
        assert _acquiring(slow, 0.1) == pytest.approx(np.arange(5.0, 12.0, 0.1))
    assert _acquiring(_tracked(jam, epochs=15, reacquisition_s=0.0)) == []


def test_gain_and_rate_of_what_is_tracked() -> None:
    tracked = _tracked(_lift_off(3.0, Coherent()))
    late = slice(250, 400)  # a chip of BOC(1,1) apart and on the move
    assert tracked.rate_error_mps[late] == pytest.approx(np.full(150, 2.0), abs=1e-9)
    assert 10 * np.log10(tracked.gain[-1]) == pytest.approx(3.0, abs=1e-6)
    locked = _tracked(_lift_off(3.0, Locked()))
    assert np.all(locked.rate_error_mps == 0)  # the carrier stays, whatever the code does


def test_repeated_noise_costs_gain() -> None:
    """A repeater of equal C/N0 and twice the power repeats twice the noise."""
    tracked = _tracked(Meaconing(delay_s=1e-4, power_db=3.0103, reception_gain_db=0.0), epochs=5)
    assert tracked.gain[-1] == pytest.approx(2 / 3, rel=1e-4)


def test_a_nulled_signal_is_weaker_by_what_the_attacker_left() -> None:
    """g = −1 dB, e = 10°: −14.1 dB; nearly in phase opposition the place of the peak does not move."""
    tracked = _tracked(Nulling(gain_db=-1.0, phase_error_rad=np.radians(10.0)), epochs=5, cn0_dbhz=45.0)
    left = abs(1 - 10 ** (-1 / 20) * np.exp(1j * np.radians(10.0))) ** 2
    assert 10 * np.log10(left) == pytest.approx(-14.1, abs=0.05)
    assert tracked.gain == pytest.approx(np.full(5, left), rel=1e-9)
    assert np.all(np.abs(tracked.error_m) < 1e-6)


def test_a_weak_spoofing_signal_pulls_like_a_ray() -> None:
    """The loop's zero is that of the multipath model: two programs, one discriminator."""
    delay_m, power_db, phase_rad = 25.0, -10.0, 0.8
    attack = LiftOff(delay_m=delay_m, power_db=power_db, phase=Locked(phase_rad=phase_rad), bands=E1)
    amplitude = 10 ** (power_db / 20) * np.exp(1j * phase_rad)
    expected_m = e1_multipath_error_m(np.array([[delay_m]]), np.array([[amplitude]]))
    assert _tracked(attack, epochs=3).error_m == pytest.approx(np.repeat(expected_m, 3), abs=1e-6)


@pytest.mark.parametrize("interval_s", [0.1, 1.0, 30.0])
@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, 40), max_size=4))
def test_pieces_are_the_whole(interval_s: float, cuts: list[int]) -> None:
    attacks = (_lift_off(2.0, Coherent()), Meaconing(delay_s=1e-4, power_db=6.0, start_s=20.0, stop_s=30.0))
    whole = _tracked(*attacks, epochs=40, interval_s=interval_s)
    loop, first, parts = E1Loop(Spoofer(attacks=attacks), 11, interval_s=interval_s, cn0_dbhz=40.0), 0, []
    for until in [*sorted(cuts), 40]:
        parts.append(loop.advance(first, until - first))
        first = until
    for name in NAMES:
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert joined.tobytes() == getattr(whole, name).tobytes(), name


def test_what_happens_between_epochs_is_not_forgotten() -> None:
    """An attack that is over at every epoch: the error is 0 there, and the worst in between is known."""
    brief = LiftOff(
        delay_m=Ramp(first=0.0, last=60.0, start_s=5.0, stop_s=25.0), power_db=3.0, start_s=2.0, stop_s=28.0, bands=E1
    )
    tracked = _tracked(brief, epochs=3, interval_s=30.0)
    assert np.all(np.abs(tracked.error_m) < 1e-6)
    assert tracked.worst_error_m[1] == pytest.approx(60.0, abs=15.0)
    assert abs(tracked.worst_error_m[2]) < 1e-6
