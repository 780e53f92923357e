from __future__ import annotations

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.navigation.earth import (
    ROTATION_RADPS,
    azimuth_elevation,
    carried_by_earth,
    ecef_from_geodetic,
    geodetic_from_ecef,
    local_axes_at,
    turned_with_earth,
)

latitudes = st.floats(-90, 90)
longitudes = st.floats(-180, 180)
heights = st.floats(-1e4, 3e7)


@given(latitude=latitudes, longitude=longitudes, height=heights)
def test_ecef_agrees_with_pymap3d_and_comes_back(latitude: float, longitude: float, height: float) -> None:
    ours = ecef_from_geodetic(*np.radians([[latitude], [longitude]]), np.array([height]))
    np.testing.assert_allclose(ours[0], pymap3d.geodetic2ecef(latitude, longitude, height), atol=1e-6)
    (back_latitude,), (back_longitude,), (back_height,) = geodetic_from_ecef(ours)
    assert abs(back_latitude - np.radians(latitude)) * 6.4e6 < 1e-6
    assert abs(back_height - height) < 1e-6
    turn = back_longitude - np.radians(longitude)
    assert abs(np.sin(turn / 2)) * np.hypot(*ours[0, :2]) < 1e-6


@given(latitude=latitudes, longitude=longitudes, height=st.floats(-100, 1e4), target=st.tuples(latitudes, longitudes))
def test_azimuth_and_elevation_agree_with_pymap3d(
    latitude: float, longitude: float, height: float, target: tuple[float, float]
) -> None:
    receiver = ecef_from_geodetic(*np.radians([[latitude], [longitude]]), np.array([height]))
    satellite = ecef_from_geodetic(*np.radians(np.array([target]).T), np.array([2.3e7]))
    local = local_axes_at(receiver)[0] @ (satellite - receiver)[0]
    (azimuth,), (elevation,) = azimuth_elevation(local[None])
    expected_azimuth, expected_elevation, _ = pymap3d.ecef2aer(*satellite[0], latitude, longitude, height)
    assert np.degrees(elevation) == pytest.approx(expected_elevation, abs=1e-8)
    off = np.radians(np.degrees(azimuth) - expected_azimuth)
    assert abs(np.sin(off / 2)) * np.cos(elevation) < 1e-9


def test_axes_are_orthonormal_at_the_pole_too() -> None:
    axes = local_axes_at(np.array([[0.0, 0.0, 6.4e6], [6.4e6, 0.0, 0.0], [1e6, -3e6, 5e6]]))
    np.testing.assert_allclose(axes @ np.swapaxes(axes, 1, 2), np.broadcast_to(np.eye(3), (3, 3, 3)), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(axes), 1.0)
    np.testing.assert_allclose(axes[1], [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)


def test_the_earth_turns_east() -> None:
    """What stands still in space moves west over the ground: a quarter of a turn takes x to −y."""
    quarter_s = np.array([np.pi / 2 / ROTATION_RADPS])
    np.testing.assert_allclose(turned_with_earth(np.array([[1.0, 0.0, 2.0]]), quarter_s), [[0, -1, 2]], atol=1e-15)


def test_what_the_rotation_carries_is_the_cross_product() -> None:
    vectors = np.random.default_rng(3).standard_normal((4, 7, 3)) * 1e7
    expected = np.cross([0.0, 0.0, ROTATION_RADPS], vectors)
    assert np.array_equal(carried_by_earth(vectors), expected)


def test_local_axes_of_one_place_are_those_of_each_of_its_repetitions() -> None:
    places = np.array([[4.2e6, 0.8e6, 4.7e6], [-2.1e6, 5.0e6, -3.3e6]])
    for place in places:
        np.testing.assert_array_equal(
            local_axes_at(np.repeat(place[None], 5, axis=0)), local_axes_at(place[None])[[0] * 5]
        )
    both = local_axes_at(places)
    assert not np.array_equal(both[0], both[1])
    np.testing.assert_array_equal(both[1], local_axes_at(places[1:])[0])
