from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.recording.observations.interpolation import interpolate
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

WAVELENGTH_M = 299_792_458 / 1575.42e6
START = GalileoTime(1161, 604_799, 0.5)  # the week ends between the epochs

Change = Callable[[int, E1Observation], E1Observation]


def true_observation(t: float, motion: tuple[float, ...]) -> E1Observation:
    """The observation `t` seconds after the start of a range with the given polynomial coefficients, by calculus."""
    range_m = np.polynomial.Polynomial(motion)
    rate, acceleration = range_m.deriv(), range_m.deriv(2)
    return E1Observation(
        svid=5, pseudorange_m=float(range_m(t)), carrier_phase_cycles=float(range_m(t)) / WAVELENGTH_M + 12_345,
        doppler_hz=-float(rate(t)) / WAVELENGTH_M, doppler_rate_hz_per_s=-float(acceleration(t)) / WAVELENGTH_M,
        cn0_dbhz=45.0 + t,
    )  # fmt: skip


def track(motion: tuple[float, ...], times: list[float], change: Change = lambda _, o: o) -> list[ObservationEpoch]:
    return [
        ObservationEpoch(time=START + t, observations={5: change(i, true_observation(t, motion))})
        for i, t in enumerate(times)
    ]


def check(epochs: list[ObservationEpoch], motion: tuple[float, ...], t: float, *, phase: bool = True) -> None:
    got, true = interpolate(epochs, START + t, max_gap_s=2.0)[5], true_observation(t, motion)
    assert got.pseudorange_m == pytest.approx(true.pseudorange_m, abs=2e-6, rel=0)
    assert got.doppler_hz == pytest.approx(true.doppler_hz, abs=1e-5, rel=0)
    assert got.doppler_rate_hz_per_s == pytest.approx(true.doppler_rate_hz_per_s, abs=2e-5, rel=0)
    assert got.cn0_dbhz == pytest.approx(true.cn0_dbhz)
    if phase:
        assert got.carrier_phase_cycles == pytest.approx(true.carrier_phase_cycles, abs=1e-5, rel=0)
    else:
        assert math.isnan(got.carrier_phase_cycles)


motions = st.tuples(st.floats(2e7, 3e7), st.floats(-1000, 1000), st.floats(-20, 20))
moments = st.floats(0, 3)


def without(*names: str) -> Change:
    return lambda _, observation: dataclasses.replace(observation, **dict.fromkeys(names, math.nan))


@given(motions, moments)
def test_constant_acceleration_is_exact(motion: tuple[float, ...], t: float) -> None:
    check(track(motion, [0, 1, 2, 3]), motion, t)


@given(motions, moments)
def test_and_without_doppler_rate(motion: tuple[float, ...], t: float) -> None:
    check(track(motion, [0, 1, 2, 3], without("doppler_rate_hz_per_s")), motion, t)


@given(motions, moments)
def test_and_without_phase(motion: tuple[float, ...], t: float) -> None:
    check(track(motion, [0, 1, 2, 3], without("carrier_phase_cycles")), motion, t, phase=False)


@given(motions, st.floats(1, 2))
def test_and_without_doppler_inside_the_track(motion: tuple[float, ...], t: float) -> None:
    check(track(motion, [0, 1, 2, 3], without("doppler_hz")), motion, t)


@given(motions, st.floats(1, 2), st.floats(-10, 10))
def test_phase_and_range_are_exact_for_constant_jerk(motion: tuple[float, ...], t: float, jerk: float) -> None:
    cubic = (*motion, jerk / 6)
    got = interpolate(track(cubic, [0, 1, 2, 3]), START + t, max_gap_s=2.0)[5]
    assert got.carrier_phase_cycles == pytest.approx(true_observation(t, cubic).carrier_phase_cycles, abs=1e-5, rel=0)
    assert got.pseudorange_m == pytest.approx(true_observation(t, cubic).pseudorange_m, abs=2e-6, rel=0)


MOTION = (2.4e7, 300.0, 0.1)


def test_at_an_epoch_the_observation_is_returned_as_it_is() -> None:
    epochs = track(MOTION, [0, 1, 2])
    for epoch in epochs:
        assert interpolate(epochs, epoch.time, max_gap_s=2.0) == epoch.observations
        assert interpolate([epoch], epoch.time, max_gap_s=0.0) == epoch.observations


def test_a_single_epoch_has_no_doppler_rate() -> None:
    epochs = track(MOTION, [0], without("doppler_rate_hz_per_s"))
    assert interpolate(epochs, START, max_gap_s=0.0)[5].doppler_rate_hz_per_s == 0.0


def test_noise_of_the_code_is_averaged_not_that_of_the_phase() -> None:
    def noisy(index: int, o: E1Observation) -> E1Observation:
        return dataclasses.replace(o, pseudorange_m=o.pseudorange_m + (3.0, -1.0)[index])

    for u in (0.25, 0.5, 0.9):
        got = interpolate(track(MOTION, [0, 1], noisy), START + u, max_gap_s=2.0)[5]
        error = got.pseudorange_m - true_observation(u, MOTION).pseudorange_m
        assert error == pytest.approx((1 - u) * 3.0 - u * 1.0, abs=1e-6)


@pytest.mark.parametrize("t", [-0.5, 1.5, 4.5, 6.5])
def test_no_guess_beyond_the_ends_or_over_a_gap(t: float) -> None:
    epochs = track(MOTION, [0, 1, 4, 6]) if t != 1.5 else track(MOTION, [0, 1, 4.5])
    got = interpolate(epochs, START + t, max_gap_s=2.0)
    assert set(got) == ({5} if t == 4.5 else set())


def test_a_missing_epoch_is_bridged() -> None:
    check(track(MOTION, [0, 2]), MOTION, 0.7)


def slip(epochs: list[ObservationEpoch]) -> list[ObservationEpoch]:
    return [epochs[0], dataclasses.replace(epochs[1], slipped=frozenset({5}))]


def jump(name: str, amount: float) -> Change:
    return lambda i, o: dataclasses.replace(o, **{name: getattr(o, name) + i * amount})


def test_a_flagged_slip_is_not_followed() -> None:
    check(slip(track(MOTION, [0, 1], jump("carrier_phase_cycles", 1e6))), MOTION, 0.4, phase=False)
    check(slip(track(MOTION, [0, 1])), MOTION, 0.4, phase=False)


def test_a_slip_that_is_not_flagged_is_seen_from_the_doppler() -> None:
    check(track(MOTION, [0, 1], jump("carrier_phase_cycles", 100)), MOTION, 0.4, phase=False)


def test_a_phase_of_the_wrong_sign_is_not_used() -> None:
    def turned(_: int, o: E1Observation) -> E1Observation:
        return dataclasses.replace(o, carrier_phase_cycles=-o.carrier_phase_cycles)

    check(track(MOTION, [0, 1], turned), MOTION, 0.4, phase=False)


def test_a_clock_step_between_the_epochs_leaves_the_satellite_out() -> None:
    assert interpolate(track(MOTION, [0, 1], jump("pseudorange_m", 299_792.458)), START + 0.4, max_gap_s=2.0) == {}
    assert interpolate(track(MOTION, [0, 1], jump("pseudorange_m", 30.0)), START + 0.4, max_gap_s=2.0) != {}


def test_nothing_is_made_of_a_code_alone() -> None:
    epochs = track(MOTION, [0, 1], without("doppler_hz", "carrier_phase_cycles"))
    assert interpolate(epochs, START + 0.4, max_gap_s=2.0) == {}
    assert interpolate(epochs, START, max_gap_s=2.0) == {}


def test_strength_of_one_side_is_better_than_none() -> None:
    epochs = track(MOTION, [0, 1], lambda i, o: dataclasses.replace(o, cn0_dbhz=math.nan if i else 40.0))
    assert interpolate(epochs, START + 0.4, max_gap_s=2.0)[5].cn0_dbhz == 40.0
