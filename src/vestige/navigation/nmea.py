"""Write positions as the NMEA 0183 sentences GGA and RMC of the talker GA (Galileo).

A sentence has no field for the authenticity of a position, so the validity fields state the authenticity. Only an
authentic position is a fix (GGA quality 1, RMC status A). Without an authentic position the position fields are empty,
so a program that ignores the status finds no position.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

TALKER = "GA"
_MAX_SATELLITES = 12  # largest number of satellites that GGA can state
_ROUNDED = 5  # decimals of the minutes of an angle; a step of the last decimal is 2 cm


@dataclass(frozen=True, slots=True, kw_only=True)
class NmeaFix:
    """An authentic position, which the sentences state as a valid fix.

    Attributes
    ----------
    latitude_deg, longitude_deg
        Geodetic position in degrees, north and east positive.
    height_m
        Height over the ellipsoid in m.
    n_satellites
        Number of satellites whose ranges the position uses.
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float
    n_satellites: int


def sentences(utc: datetime, fix: NmeaFix | None) -> tuple[str, str]:
    """Return the sentences GGA and RMC for a time, without line ends.

    vestige has no model of the geoid, so the altitude is the height over the ellipsoid, and the geoid separation is 0.
    The sum of altitude and separation is therefore the true height over the ellipsoid. Dilution of precision, speed and
    course are empty. RMC ends with the mode, as before NMEA 0183 4.1. A navigational status after the mode could only
    be V (not provided), and readers such as pynmea2 take V as no fix.

    Parameters
    ----------
    utc
        Time in UTC.
    fix
        Authentic position; None without an authentic position.

    Examples
    --------
    >>> from datetime import UTC
    >>> for line in sentences(datetime(2026, 11, 22, 21, 59, 42, tzinfo=UTC), None):
    ...     print(line)
    $GAGGA,215942.00,,,,,0,00,,,M,,M,,*50
    $GARMC,215942.00,V,,,,,,,221126,,,N*61
    """
    tenths = round(utc.microsecond / 1e4)
    clock = f"{utc:%H%M%S}.{min(tenths, 99):02d}"
    if fix is None:
        return (
            _sentence(f"{TALKER}GGA,{clock},,,,,0,00,,,M,,M,,"),
            _sentence(f"{TALKER}RMC,{clock},V,,,,,,,{utc:%d%m%y},,,N"),
        )
    place = f"{_angle(fix.latitude_deg, 2, 'NS')},{_angle(fix.longitude_deg, 3, 'EW')}"
    used = min(fix.n_satellites, _MAX_SATELLITES)
    return (
        _sentence(f"{TALKER}GGA,{clock},{place},1,{used:02d},,{fix.height_m:.2f},M,0.0,M,,"),
        _sentence(f"{TALKER}RMC,{clock},A,{place},,,{utc:%d%m%y},,,A"),
    )


def _angle(degrees: float, width: int, signs: str) -> str:
    """Return an angle as degrees and minutes without a separator, and its hemisphere."""
    scale = 60 * 10**_ROUNDED
    whole, rest = divmod(round(abs(degrees) * scale), scale)
    minutes = f"{rest / 10**_ROUNDED:0{_ROUNDED + 3}.{_ROUNDED}f}"
    return f"{whole:0{width}d}{minutes},{signs[degrees < 0]}"


def _sentence(body: str) -> str:
    """Return a sentence with its checksum, the exclusive OR of all characters between $ and *."""
    checksum = 0
    for character in body.encode("ascii"):
        checksum ^= character
    return f"${body}*{checksum:02X}"
