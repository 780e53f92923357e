"""NTCM-G against official vectors, and against what its equations say by themselves."""

from __future__ import annotations

import numpy as np
import pytest

from vestige.constants import E1_CARRIER_HZ
from vestige.navigation.earth import azimuth_elevation, ecef_from_geodetic, local_axes
from vestige.navigation.inav.ephemeris_words import status_word
from vestige.navigation.inav.ionosphere import BroadcastIonosphere
from vestige.navigation.ntcm_g import delay_e1_m, ntcm_slant_tecu
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

# Official vectors: Az, UT, receiver and satellite (longitude, latitude in degrees, height in m), STEC; day 105
HIGH = (236.831641, -0.39362878, 0.00402826613)
MEDIUM = (121.129893, 0.351254133, 0.0134635348)
LOW = (2.580271, 0.127628236, 0.0252748384)
VECTORS = [
    (HIGH, 0, (-62.34, 82.49, 78.11), (8.23, 54.29, 20281546.18), 33.7567),
    (HIGH, 20, (-52.81, 5.25, -25.76), (10.94, 44.72, 20450566.19), 252.0204),
    (MEDIUM, 0, (40.19, -3.00, -23.32), (76.65, -41.43, 20157673.93), 28.3208),
    (LOW, 0, (141.13, 39.14, 117.00), (165.14, -13.93, 20181976.50), 51.5270),
]


def place(longitude_deg: float, latitude_deg: float, height_m: float) -> tuple[np.ndarray, ...]:
    return np.radians([latitude_deg]), np.radians([longitude_deg]), np.array([height_m])


@pytest.mark.parametrize(("az", "ut", "receiver", "satellite", "expected"), VECTORS)
def test_official_vectors(
    az: tuple[float, float, float], ut: int, receiver: tuple, satellite: tuple, expected: float
) -> None:
    latitude, longitude, height = place(*receiver)
    apart = ecef_from_geodetic(*place(*satellite)) - ecef_from_geodetic(latitude, longitude, height)
    azimuth, elevation = azimuth_elevation(np.einsum("nij,nj->ni", local_axes(latitude, longitude), apart))
    ionosphere = BroadcastIonosphere(ai0_sfu=az[0], ai1_sfu_per_deg=az[1], ai2_sfu_per_deg2=az[2])
    hours = np.array([float(ut)])
    found = ntcm_slant_tecu(ionosphere, 105, hours, latitude, longitude, azimuth, elevation)
    assert found == pytest.approx([expected], abs=1e-4)
    later = ntcm_slant_tecu(ionosphere, 105, hours + 24, latitude, longitude, azimuth, elevation)
    assert later == pytest.approx(found, rel=1e-12)


def test_delay_is_that_of_the_plasma() -> None:
    """40.3 · 10¹⁶ m³/s² over the square of the carrier: 16.2 cm per TECU on E1."""
    assert delay_e1_m(np.array([1.0])) == pytest.approx([40.3e16 / (1575.42e6) ** 2])
    assert pytest.approx(1575.42e6) == E1_CARRIER_HZ


def test_no_coefficients_stand_for_the_default_activity() -> None:
    one = np.ones(1)
    where = (105, 12 * one, 0.8 * one, 0.2 * one, 0 * one, 0.5 * one)
    none = ntcm_slant_tecu(BroadcastIonosphere(), *where)
    assert none == pytest.approx(ntcm_slant_tecu(BroadcastIonosphere(ai0_sfu=63.7), *where))


def test_what_is_sent_is_what_word_5_gives_back() -> None:
    typed = BroadcastIonosphere(ai0_sfu=121.129893, ai1_sfu_per_deg=0.351254133, ai2_sfu_per_deg2=0.0134635348)
    sent = typed.as_sent()
    assert sent == sent.as_sent()
    assert (sent.ai0_sfu, typed.ai0_sfu) == (pytest.approx(121.25), pytest.approx(sent.ai0_sfu, abs=0.125))
    start = GalileoTime(1400, 3600)
    word = status_word(walker_ephemerides(start)[0], start + 25, typed)
    assert BroadcastIonosphere.from_word(word) == sent
