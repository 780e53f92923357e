"""The troposphere against published numbers and RTKLIB's model."""

from __future__ import annotations

import numpy as np
import pytest

from vestige.navigation.troposphere import SaastamoinenTroposphere


def zenith_m(humidity: float, latitude_deg: float, height_m: float, elevation_deg: float = 90.0) -> float:
    model = SaastamoinenTroposphere(relative_humidity=humidity)
    where = (np.radians([elevation_deg]), np.radians([latitude_deg]), np.array([height_m]))
    return float(model.delay_m(*where)[0])


def test_the_dry_zenith_delay_at_sea_level() -> None:
    """2.2768 mm/hPa · 1013.25 hPa = 2.3070 m at 45°, where the gravity of the equation is the mean one."""
    assert zenith_m(0.0, 45.0, 0.0) == pytest.approx(2.3070, abs=1e-4)
    assert zenith_m(0.0, 90.0, 0.0) < zenith_m(0.0, 0.0, 0.0)


def test_the_wet_part_at_15_degrees() -> None:
    """17.0 hPa saturate: 2.277 mm · (1255/288.15 + 0.05) · 17.0 = 0.171 m."""
    assert zenith_m(1.0, 45.0, 0.0) - zenith_m(0.0, 45.0, 0.0) == pytest.approx(0.171, abs=5e-4)
    assert zenith_m(0.5, 45.0, 0.0) - zenith_m(0.0, 45.0, 0.0) == pytest.approx(0.0855, abs=5e-4)


def test_the_mapping_is_niells_to_a_percent() -> None:
    """Niell's dry and wet mapping at 5° are 10.15 and 10.75; 1/sin would be 11.47."""
    assert zenith_m(0.0, 45.0, 0.0, 5.0) / zenith_m(0.0, 45.0, 0.0) == pytest.approx(10.15, rel=0.01)
    assert zenith_m(0.0, 45.0, 0.0, 30.0) / zenith_m(0.0, 45.0, 0.0) == pytest.approx(2.0, rel=0.005)
    assert zenith_m(0.0, 45.0, 0.0, -5.0) == zenith_m(0.0, 45.0, 0.0, 0.0)


@pytest.mark.parametrize("height_m", [0.0, 500.0, 3000.0, 9000.0])
@pytest.mark.parametrize("humidity", [0.0, 0.7])
def test_zenith_delays_are_those_of_rtklib(height_m: float, humidity: float) -> None:
    rtklib = pytest.importorskip("pyrtklib", reason="pyrtklib is not installed: pip install pyrtklib")
    position, direction = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(2)
    position[0], position[1], position[2] = np.radians(48.0), 0.2, height_m
    direction[0], direction[1] = 0.0, np.pi / 2
    theirs_m = rtklib.tropmodel(rtklib.gtime_t(), position, direction, humidity)
    assert zenith_m(humidity, 48.0, height_m) == pytest.approx(theirs_m, abs=3e-3)


@pytest.mark.parametrize("humidity", [-0.1, 1.1, float("nan")])
def test_a_humidity_that_is_none(humidity: float) -> None:
    with pytest.raises(ValueError, match="relative_humidity from 0 to 1"):
        SaastamoinenTroposphere(relative_humidity=humidity)
