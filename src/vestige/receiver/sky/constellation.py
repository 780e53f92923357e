"""Make a sky of satellites on nominal orbits, and compute the C/N0 of each satellite.

The nominal constellation is Galileo's Walker 24/3/1 as the service publishes it [GSC-ORBITS]. The constellation has
circular orbits in three planes 120° apart. Each plane has eight slots at intervals of 45°. The slots of the next plane
are ahead by 360°/24 = 15°. The satellites are given as ephemerides, so that simulator, navigation file and receiver
work with the same orbits. The satellites with SVID 1 to 8 have the slots A01 to A08, SVID 9 to 16 have B01 to B08, and
SVID 17 to 24 have C01 to C08. The real satellites are not numbered in this order.

Orbit and clock of an ephemeris are taken as true, so the model has no errors of the broadcast message.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import DAY_S
from vestige.navigation.earth import GRAVITATION_M3PS2, ROTATION_RADPS
from vestige.navigation.ephemeris import Ephemeris
from vestige.time import GalileoTime

# reference epoch of the nominal constellation [GSC-ORBITS]
REFERENCE_EPOCH = GalileoTime.parse("2016-11-21T00:00:00 UTC")
ORBIT_SEMI_MAJOR_AXIS_M = 29_599_800.0
INCLINATION_DEG = 56.0
NODE_DEG = {"A": 317.632, "B": 77.632, "C": 197.632}  # right ascension of the ascending node of each plane
LATITUDE_DEG = {"A": 180.153, "B": 195.153, "C": 210.153}  # argument of latitude of slot 1 in each plane
NODE_RATE_DEG_PER_DAY = -0.02764398
LATITUDE_RATE_DEG_PER_DAY = 613.72253566
SLOTS, SLOT_DEG = 8, 45.0

# SISA that nearly all satellites broadcast, needed because a receiver uses no satellite without a SISA
TYPICAL_SISA_M = 3.12
_REFERENCE_DAYS = 6168.5  # days from 2000-01-01T12:00 UTC to REFERENCE_EPOCH


def walker_ephemerides(toe: GalileoTime) -> tuple[Ephemeris, ...]:
    """Return the ephemerides of the 24 satellites of the reference constellation at `toe`, without clock errors."""
    elapsed_s = toe - REFERENCE_EPOCH
    axis = ORBIT_SEMI_MAJOR_AXIS_M
    node_rate = np.radians(NODE_RATE_DEG_PER_DAY) / DAY_S
    latitude_rate = np.radians(LATITUDE_RATE_DEG_PER_DAY) / DAY_S
    # the message gives the longitude of the node with the Earth's orientation at the start of the week
    earth = _earth_rotation_angle() + ROTATION_RADPS * (elapsed_s - toe.second - toe.fraction)
    return tuple(
        Ephemeris(
            svid=1 + plane * SLOTS + slot,
            iod_nav=toe.second // 600 % 128,
            toe=toe,
            toc=toe,
            sqrt_a=float(np.sqrt(axis)),
            eccentricity=0.0,
            m0_rad=_wrapped(np.radians(LATITUDE_DEG[name] + SLOT_DEG * slot) + latitude_rate * elapsed_s),
            delta_n_radps=float(latitude_rate - np.sqrt(GRAVITATION_M3PS2 / axis**3)),
            omega0_rad=_wrapped(np.radians(NODE_DEG[name]) + node_rate * elapsed_s - earth),
            omega_dot_radps=float(node_rate),
            i0_rad=float(np.radians(INCLINATION_DEG)),
            i_dot_radps=0.0,
            omega_rad=0.0,
            sisa_m=TYPICAL_SISA_M,
        )
        for plane, name in enumerate(NODE_DEG)
        for slot in range(SLOTS)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ElevationCn0:
    """C/N0 that falls from zenith to horizon by `fall_db`, linearly with the sine of the elevation.

    Attributes
    ----------
    zenith_dbhz
        C/N0 of each component at the zenith, in dBHz.
    fall_db
        Loss at the horizon relative to the zenith, in dB. A typical patch antenna has 5 dBi at the zenith and −3
        to −5 dBi at low elevation. The pattern of the satellite's antenna compensates the loss on the longer path at
        low elevation.
    """

    zenith_dbhz: float = 45.0
    fall_db: float = 9.0
    kind: Literal["elevation"] = "elevation"

    def cn0_dbhz(self, elevation_rad: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the C/N0 in dBHz at an elevation, or the C/N0 at the horizon for negative elevations."""
        return self.zenith_dbhz - self.fall_db * (1 - np.maximum(np.sin(elevation_rad), 0.0))


def _earth_rotation_angle() -> float:
    """Return the Earth rotation angle at the reference epoch in rad, with UTC in place of UT1 [IERS-2010, Eq. 5.15]."""
    turns = 0.7790572732640 + 1.00273781191135448 * _REFERENCE_DAYS
    return float(2 * np.pi * (turns % 1.0))


def _wrapped(angle: float) -> float:
    """Return an angle in rad, wrapped to [−π, π)."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
