from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.navigation.earth import GRAVITATION_M3PS2
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.orbit import RELATIVITY_S_PER_SQRT_M, eccentric_anomaly, satellite_position, satellite_state
from vestige.receiver.sky.constellation import (
    LATITUDE_RATE_DEG_PER_DAY,
    ORBIT_SEMI_MAJOR_AXIS_M,
    walker_ephemerides,
)
from vestige.time import GalileoTime

TOE = GalileoTime(1372, 604_000)

# every term of the model at work, larger than any satellite has it
BENT = Ephemeris(
    svid=1, iod_nav=1, toe=TOE, toc=TOE + -60.0, sqrt_a=5440.6, eccentricity=0.2, m0_rad=0.3, delta_n_radps=3e-9,
    omega0_rad=1.1, omega_dot_radps=-6e-9, i0_rad=0.97, i_dot_radps=2e-10, omega_rad=-0.7, cuc_rad=3e-6, cus_rad=6e-6,
    crc_m=220.0, crs_m=-66.0, cic_rad=1e-6, cis_rad=6e-6, af0_s=2e-4, af1=1e-9, af2_per_s=1e-15, bgd_e1_e5b_s=4e-9,
)  # fmt: skip


@given(mean=st.floats(-10, 10), eccentricity=st.floats(0, 0.9))
def test_kepler(mean: float, eccentricity: float) -> None:
    anomaly = eccentric_anomaly(np.array([mean]), eccentricity)
    assert anomaly - eccentricity * np.sin(anomaly) == pytest.approx(mean, abs=1e-13)


@given(elapsed=st.floats(-2e4, 2e4))
def test_velocity_acceleration_and_drift_are_derivatives(elapsed: float) -> None:
    """Central differences over ± 1 s: fourth derivatives of 2e-8 m/s⁴ leave 1e-8, cancellation 1e-8."""
    state = satellite_state(BENT, TOE, elapsed + np.array([-1.0, 0.0, 1.0]))
    np.testing.assert_allclose(np.diff(state.position_m[::2], axis=0)[0] / 2, state.velocity_mps[1], atol=1e-4)
    np.testing.assert_allclose(np.diff(state.velocity_mps[::2], axis=0)[0] / 2, state.acceleration_mps2[1], atol=1e-7)
    assert np.diff(state.clock_s[::2])[0] / 2 == pytest.approx(state.clock_drift[1], abs=1e-17)


@pytest.mark.parametrize("n", [0, 1, 3, 100])
def test_the_position_alone_has_the_same_bits(n: int) -> None:
    elapsed_s = np.linspace(-2e4, 2e4, n)
    state, (position_m, clock_s) = satellite_state(BENT, TOE, elapsed_s), satellite_position(BENT, TOE, elapsed_s)
    np.testing.assert_array_equal(position_m, state.position_m)
    np.testing.assert_array_equal(clock_s, state.clock_s)


def test_a_kepler_orbit_keeps_energy_and_falls_freely() -> None:
    """Without harmonics, seen from space: a circle of Kepler's period whose acceleration is μ/r²."""
    orbit = replace(BENT, eccentricity=0.0, delta_n_radps=0.0, i_dot_radps=0.0, cuc_rad=0.0, cus_rad=0.0, crc_m=0.0,
                    crs_m=0.0, cic_rad=0.0, cis_rad=0.0, omega_dot_radps=0.0)  # fmt: skip
    state = satellite_state(orbit, TOE, np.linspace(0, 5e4, 7))
    radius = np.linalg.norm(state.position_m, axis=1)
    np.testing.assert_allclose(radius, orbit.sqrt_a**2, rtol=1e-14)
    omega = np.array([0, 0, 7.2921151467e-5])
    inertial = (
        state.acceleration_mps2
        + 2 * np.cross(omega, state.velocity_mps)
        + np.cross(omega, np.cross(omega, state.position_m))
    )
    np.testing.assert_allclose(inertial, -GRAVITATION_M3PS2 * state.position_m / radius[:, None] ** 3, atol=1e-12)


def test_the_end_of_a_week_is_a_time_like_any_other() -> None:
    """The same orbit and clock asked from both sides of the week's end."""
    across = np.array([900.0, 1000.0, 5000.0])  # 300 s, 400 s, 4400 s into week 1373
    before = satellite_state(BENT, TOE, across)
    after = satellite_state(BENT, GalileoTime(1373, 0), across - 800.0)
    np.testing.assert_array_equal(before.position_m, after.position_m)
    np.testing.assert_array_equal(before.clock_s, after.clock_s)


def test_ephemerides_of_both_weeks_describe_one_orbit() -> None:
    """The message counts the node from the start of its week; the orbit does not jump there."""
    times = np.linspace(-3600.0, 3600.0, 9)
    for old, new in zip(
        walker_ephemerides(GalileoTime(1372, 604_200)), walker_ephemerides(GalileoTime(1373, 600)), strict=True
    ):
        a, b = (satellite_state(e, GalileoTime(1373, 0), times) for e in (old, new))
        np.testing.assert_allclose(a.position_m, b.position_m, atol=2e-3)  # phase of nine years, 2e5 rad, in floats
        np.testing.assert_allclose(a.velocity_mps, b.velocity_mps, atol=1e-6)


def test_relativity_and_group_delay() -> None:
    assert pytest.approx(-4.442807309e-10, rel=1e-9) == RELATIVITY_S_PER_SQRT_M  # as printed
    anomaly = eccentric_anomaly(np.array([BENT.m0_rad]), BENT.eccentricity)
    clock = 2e-4 + 60e-9 + 3600e-15 - 4.442807309e-10 * 0.2 * 5440.6 * np.sin(anomaly) - 4e-9
    np.testing.assert_allclose(satellite_state(BENT, TOE, np.zeros(1)).clock_s, clock, atol=1e-15)


def test_the_reference_constellation_repeats_its_ground_track() -> None:
    """17 revolutions in ten sidereal days [GSC-ORBITS]; the satellite is then where it was."""
    assert pytest.approx(29_599_800) == ORBIT_SEMI_MAJOR_AXIS_M
    slot = walker_ephemerides(TOE)[10]
    node_rate = np.degrees(7.2921151467e-5) * 86400 + 0.02764398  # of the Earth against the node
    days = 17 * 360 / LATITUDE_RATE_DEG_PER_DAY
    assert days * node_rate / 360 == pytest.approx(10, abs=2e-5)
    state = satellite_state(slot, TOE, np.array([0.0, days * 86400]))
    assert np.linalg.norm(state.position_m[1] - state.position_m[0]) < 5e3
