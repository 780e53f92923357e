from __future__ import annotations

import numpy as np
import pytest

from vestige.navigation.orbit import satellite_state
from vestige.receiver.sky.constellation import ElevationCn0, walker_ephemerides
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.time import GalileoTime
from whole_sky import sky

TOE = GalileoTime(1372, 604_200)
SATELLITES = walker_ephemerides(TOE)
PLACE = StaticTrajectory(latitude_deg=52.2, longitude_deg=4.4)


def test_walker_24_3_1() -> None:
    """Planes 120° apart, slots of 45°, the next plane 15° ahead."""
    node = np.degrees([satellite.omega0_rad for satellite in SATELLITES]).reshape(3, 8)
    latitude = np.degrees([satellite.m0_rad for satellite in SATELLITES]).reshape(3, 8)
    assert np.ptp(node, axis=1) == pytest.approx(0.0)
    np.testing.assert_allclose(np.diff(node[:, 0]) % 360, 120.0, atol=1e-6)
    np.testing.assert_allclose(np.diff(latitude, axis=1) % 360, 45.0, atol=1e-6)
    np.testing.assert_allclose(np.diff(latitude[:, 0]) % 360, 15.0, atol=1e-6)
    radius = [np.linalg.norm(satellite_state(one, TOE, np.zeros(1)).position_m) for one in SATELLITES]
    np.testing.assert_allclose(radius, 29_599_800.0, rtol=1e-12)


@pytest.mark.parametrize("hours", [4, 24, 24 * 30])
def test_orbits_do_not_depend_on_the_toe_that_they_are_given_at(hours: int) -> None:
    """Node and latitude move at constant rates, through a week's end too; rates of the other sign are km in 4 h."""
    toe = TOE + hours * 3600.0
    times = np.array([-3600.0, 0.0, 14_400.0])
    for one, later in zip(SATELLITES, walker_ephemerides(toe), strict=True):
        state, same = (satellite_state(each, toe, times) for each in (one, later))
        np.testing.assert_allclose(same.position_m, state.position_m, rtol=0, atol=1e-3)
        np.testing.assert_allclose(same.velocity_mps, state.velocity_mps, rtol=0, atol=1e-6)


def test_the_sky() -> None:
    times = np.arange(0.0, 86_400.0, 600.0)
    view = sky(SATELLITES, TOE, times, PLACE.motion(times), mask_deg=5.0)
    in_view = view.in_view.sum(axis=1)
    assert (in_view.min(), in_view.max()) == (6, 10)
    assert view.svids == tuple(sorted(view.svids))
    np.testing.assert_array_equal(view.in_view, np.degrees(view.elevation_rad) >= 5.0)
    seen = view.range_m[view.in_view]
    assert 23.2e6 < seen.min() < seen.max() < 29.2e6  # overhead, and tangential at 5°
    assert np.abs(view.rate_mps[view.in_view]).max() < 700.0


def test_satellites_that_never_rise_are_left_out() -> None:
    times = np.zeros(1)
    view = sky(SATELLITES, TOE, times, PLACE.motion(times), mask_deg=5.0)
    assert view.in_view.all()
    assert len(view.svids) < len(SATELLITES)
    nothing = sky(SATELLITES, TOE, times, PLACE.motion(times), mask_deg=90.0)
    assert nothing.svids == ()
    assert nothing.range_m.shape == (1, 0)
    with pytest.raises(ValueError, match="one ephemeris"):
        sky(SATELLITES[:1] * 2, TOE, times, PLACE.motion(times))


def test_cn0_against_elevation() -> None:
    model = ElevationCn0(zenith_dbhz=45.0, fall_db=9.0)
    np.testing.assert_allclose(model.cn0_dbhz(np.radians([90.0, 30.0, 0.0, -10.0])), [45.0, 40.5, 36.0, 36.0])
