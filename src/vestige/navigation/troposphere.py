"""Compute the slant delay of the troposphere from Saastamoinen's zenith delays in a standard atmosphere.

The delay is the same for all frequencies, and for code and carrier. The formulas use the pressure p in hPa, the
temperature T in K, and the pressure e of water vapour in hPa. The receiver has the height h in km and the latitude φ,
and the satellite has the elevation E:

    dry    2.2768 mm · p / (1 − 0.00266 cos 2φ − 0.00028 h)         [SAAST72]
    wet    2.277 mm · (1255/T + 0.05) · e
    slant  (dry + wet) · 1.001/√(0.002001 + sin² E)                  [DO-229, A.4.2.4]

Pressure and temperature come from the standard atmosphere at the receiver's height [ISA]. The mapping function is valid
for elevations from 4° on. At an elevation of 5° the mapping function differs by less than 1 % from Niell's mapping
function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

_SEA_LEVEL_HPA, _SEA_LEVEL_K, _LAPSE_K_PER_M, _EXPONENT = 1013.25, 288.15, 6.5e-3, 5.2559
_FREEZING_K = 273.15
_TROPOPAUSE_M = 11_000.0
_LOWEST_M = -1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SaastamoinenTroposphere:
    """Troposphere whose delay follows from Saastamoinen's formulas in a standard atmosphere.

    Parameters
    ----------
    relative_humidity
        Relative humidity at the receiver, 0 to 1.

    Raises
    ------
    ValueError
        If the humidity is not in the range from 0 to 1.

    Examples
    --------
    >>> model = SaastamoinenTroposphere()
    >>> zenith = np.array([np.pi / 2])
    >>> round(float(model.delay_m(zenith, np.array([np.pi / 4]), np.array([0.0]))[0]), 2)
    2.39
    """

    relative_humidity: float = 0.5
    kind: Literal["saastamoinen"] = "saastamoinen"

    def __post_init__(self) -> None:
        if not 0.0 <= self.relative_humidity <= 1.0:
            raise ValueError("relative_humidity from 0 to 1")

    def delay_m(
        self,
        elevation_rad: Float[np.ndarray, " n"],
        latitude_rad: Float[np.ndarray, " n"],
        height_m: Float[np.ndarray, " n"],
    ) -> Float[np.ndarray, " n"]:
        """Return the delay of the troposphere in m along the line of sight.

        Parameters
        ----------
        elevation_rad
            Elevation of the satellite in rad. Below the horizon the delay equals the delay at the horizon.
        latitude_rad, height_m
            Latitude in rad and height in m of the receiver. The height is limited to the range from −1 km to 11 km.
        """
        height_m = np.clip(height_m, _LOWEST_M, _TROPOPAUSE_M)
        temperature_k = _SEA_LEVEL_K - _LAPSE_K_PER_M * height_m
        pressure_hpa = _SEA_LEVEL_HPA * (temperature_k / _SEA_LEVEL_K) ** _EXPONENT
        celsius = temperature_k - _FREEZING_K
        vapour_hpa = self.relative_humidity * 6.1094 * np.exp(17.625 * celsius / (celsius + 243.04))  # Magnus formula
        gravity = 1 - 0.00266 * np.cos(2 * latitude_rad) - 0.00028e-3 * height_m
        zenith_m = 2.2768e-3 * pressure_hpa / gravity + 2.277e-3 * (1255 / temperature_k + 0.05) * vapour_hpa
        return zenith_m * 1.001 / np.sqrt(0.002001 + np.sin(np.maximum(elevation_rad, 0.0)) ** 2)
