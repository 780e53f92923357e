from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.search_outcome import BandSignals, SearchOutcome, outcome, search_draws

N = 50
DRAWS = {k: search_draws(np.random.default_rng(1), N, k) for k in (1, 2, 3)}


def air(*signals: tuple[complex, float], cn0_dbhz: float = 50.0) -> BandSignals:
    """Signals by amplitude and delay in s."""
    return BandSignals(
        amplitude=np.tile(np.array([one for one, _ in signals], complex), (N, 1)),
        delay_m=np.tile([late * SPEED_OF_LIGHT_MPS for _, late in signals], (N, 1)),
        doppler_hz=np.zeros((N, len(signals))),
        cn0_dbhz=np.full(N, cn0_dbhz),
    )


def search(e1: BandSignals, e6: BandSignals, **how: float) -> SearchOutcome:
    return outcome(e1, e6, DRAWS[e1.amplitude.shape[1]], shift_m=np.zeros(N), integration_s=16e-3, **how)


def _handover_count(found: SearchOutcome) -> np.ndarray:
    """Return what the hand-over search counts: the larger of E1's and E6's number."""
    return np.maximum(found.e1_signals, found.handover_carrying)


def test_one_signal_is_one_and_needs_no_handover() -> None:
    found = search(air((1, 0.0)), air((1, 0.0)))
    for counted in (found.e1_signals, _handover_count(found), found.exhaustive_signals):
        assert np.all(counted == 1)
    assert np.all(np.isnan(found.handover_error_m))
    assert np.all(np.isnan(found.exhaustive_error_m))  # one alone does not say that it is the true one


def test_no_signal_is_none() -> None:
    found = search(air((0, 0.0)), air((0, 0.0)))
    assert not found.e1_signals.any()
    assert not found.exhaustive_signals.any()


@given(late_s=st.floats(3e-6, 3.9e-3), power_db=st.floats(-9.0, 9.0))
def test_a_meaconer_is_a_second_signal_and_the_earlier_is_taken(late_s: float, power_db: float) -> None:
    both = air((1, 0.0), (10 ** (power_db / 20), late_s))
    found = search(both, both)
    apart = abs(late_s - 4e-3 * round(late_s / 4e-3)) * SPEED_OF_LIGHT_MPS > 600
    assert np.all(found.e1_signals == (2 if apart else 1))
    assert np.all(_handover_count(found) == found.e1_signals)
    assert np.all(found.exhaustive_signals == 2)
    assert np.all(np.abs(found.exhaustive_error_m) < 15)
    assert np.all(np.abs(found.handover_error_m) < 15) or not apart


@pytest.mark.parametrize(("late_s", "n_e1", "n_e6"), [(0.1e-6, 1, 1), (1e-6, 1, 2), (2.1e-6, 2, 2), (4e-3, 1, 2)])
def test_separation_rules(late_s: float, n_e1: int, n_e6: int) -> None:
    """Two E1 chips are 1.96 µs, modulo 4 ms; an E6 chip, and with the fine search 1¼, is 0.24 µs."""
    both = air((1, 0.0), (1, late_s))
    found = search(both, both)
    assert np.all(found.e1_signals == n_e1)
    assert np.all(found.exhaustive_signals == n_e6)


@pytest.mark.parametrize(
    ("gain_db", "error_rad", "left_db", "seen"), [(-1.0, 0.1745, -14.0, 0.5), (-0.5, 0.07, -21.1, 0.0)]
)
def test_nulling_leaves_what_is_left(gain_db: float, error_rad: float, left_db: float, seen: float) -> None:
    """|1 − g e^{je}|² beside a meaconer of +3 dB: 17 dB apart scatter sometimes helps over the rule of 16 dB."""
    opposite = -(10 ** (gain_db / 20)) * np.exp(1j * error_rad)
    assert 20 * np.log10(abs(1 + opposite)) == pytest.approx(left_db, abs=0.2)
    meaconed = (10 ** (3 / 20), 1e-5)
    found = search(air((1, 0.0), meaconed, (opposite, 0.0)), air((1, 0.0), meaconed, (0, 0.0)))
    assert np.mean(found.e1_signals == 2) <= seen
    assert np.all(found.exhaustive_signals == 2)
    assert np.all(np.abs(found.exhaustive_error_m) < 15)


def test_spoofing_signals_of_e1_alone_leave_one_in_e6() -> None:
    found = search(air((1, 0.0), (2, 1e-4)), air((1, 0.0), (0, 0.0)))
    assert np.all(_handover_count(found) == 2)
    assert np.all(np.abs(found.handover_error_m) < 15)
    assert np.all(found.exhaustive_signals == 1)


def test_a_true_signal_lost_in_noise_is_not_replaced_by_the_spoofing_signal() -> None:
    """Where E1 itself is weak, a signal that E6 does not show may yet be there: no range is given."""
    weak = air((1, 0.0), (4, 1e-4), cn0_dbhz=28.5)
    found = search(weak, air((1, 0.0), (4, 1e-4), cn0_dbhz=25.0))
    assert not np.any(np.abs(found.handover_error_m) > 100)


def test_beyond_the_window_nothing_is_found() -> None:
    both = air((1, 0.0), (2, 16.0))
    assert np.all(search(both, both).exhaustive_signals == 1)
    assert np.all(search(both, both, window_s=17.0).exhaustive_signals == 2)


@pytest.mark.slow
def test_false_alarms_come_with_their_probability() -> None:
    draws = search_draws(np.random.default_rng(3), 200_000, 1)
    quiet = BandSignals(
        amplitude=np.ones((200_000, 1), complex),
        delay_m=np.zeros((200_000, 1)),
        doppler_hz=np.zeros((200_000, 1)),
        cn0_dbhz=np.full(200_000, 60.0),
    )
    found = outcome(quiet, quiet, draws, shift_m=np.zeros(200_000), integration_s=16e-3, exhaustive_p_fa=1e-2)
    assert np.mean(found.exhaustive_signals == 2) == pytest.approx(1e-2, abs=1.2e-3)  # 5σ
    early = found.exhaustive_error_m[found.exhaustive_signals == 2] < -1e3
    assert np.mean(early) == pytest.approx(0.5, abs=0.06)
