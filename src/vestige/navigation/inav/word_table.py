"""List the fields of the I/NAV words 0 to 10 and 16 to 20, as the interface document does [OS-ICD, 4.3.5].

Encoder and decoder take the positions of the fields from this table. Every word has 128 bits and begins with six bits
of type. Most fields of orbit and clock have the names and units of `Ephemeris`. Angles are in rad instead of
semicircles. By default, spare and reserved bits carry the pattern that satellites send.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vestige.navigation.inav.bit_fields import BitField, BitLayout

WORD_BITS = 128  # [OS-ICD, 4.3.2.3]
TYPE_BITS = 6
EPHEMERIS_WORDS = (1, 2, 3, 4)  # words with IODnav [OS-ICD, 4.3.5]
PARITY_WORDS = (17, 18, 19, 20)  # words of FEC2 [OS-ICD, 4.3.5]
DUMMY_WORD = 63  # word type of a dummy page [OS-ICD, 4.3.5]

_PI = math.pi


def _spare(name: str, length: int) -> dict[str, Any]:
    """Return the row of a spare field, whose bits alternate and begin with 0."""
    pattern = int("".join(str(k % 2) for k in range(length)), 2)
    return {"name": name, "length": length, "fill": pattern}


def _unsigned(name: str, length: int, scale: float = 1.0, unit: str = "") -> dict[str, Any]:
    return {"name": name, "length": length, "scale": scale, "unit": unit}


def _signed(name: str, length: int, scale: float = 1.0, unit: str = "") -> dict[str, Any]:
    return {"name": name, "length": length, "scale": scale, "unit": unit, "signed": True}


def _angle(name: str, length: int, exponent: int) -> dict[str, Any]:
    """Return the row of a signed angle whose last bit is 2^exponent semicircles."""
    return _signed(name, length, 2.0**exponent * _PI, "rad")


def _angle_rate(name: str, length: int, exponent: int) -> dict[str, Any]:
    return _signed(name, length, 2.0**exponent * _PI, "rad/s")


def _layout(kind: int, *rows: dict[str, Any]) -> BitLayout:
    fields = [BitField(name="type", start=0, length=TYPE_BITS, fill=kind)]
    for row in rows:
        fields.append(BitField(start=fields[-1].start + fields[-1].length, **row))
    return BitLayout(WORD_BITS, tuple(fields))


_IOD_NAV = _unsigned("iod_nav", 10)
_IOD_ALMANAC = _unsigned("iod_almanac", 4)
_WEEK, _TOW = _unsigned("week", 12), _unsigned("tow_s", 20, 1.0, "s")
_ALMANAC_TIME = (_unsigned("almanac_week", 2), _unsigned("t0a_s", 10, 600.0, "s"))


def _almanac_orbit(n: int) -> tuple[dict[str, Any], ...]:
    """Return the rows from `svid` to `delta_i_rad` of the nth satellite in the almanac words."""
    return (
        _unsigned(f"svid_{n}", 6),
        _signed(f"delta_sqrt_a_{n}", 13, 2.0**-9, "m^0.5"),
        _unsigned(f"eccentricity_{n}", 11, 2.0**-16),
        _angle(f"omega_rad_{n}", 16, -15),
        _angle(f"delta_i_rad_{n}", 11, -14),
    )


def _almanac_node(n: int) -> tuple[dict[str, Any], ...]:
    return (_angle(f"omega0_rad_{n}", 16, -15), _angle_rate(f"omega_dot_radps_{n}", 11, -33))


def _almanac_anomaly(n: int) -> dict[str, Any]:
    return _angle(f"m0_rad_{n}", 16, -15)


def _almanac_clock(n: int) -> tuple[dict[str, Any], ...]:
    return (
        _signed(f"af0_s_{n}", 16, 2.0**-19, "s"),
        _signed(f"af1_{n}", 13, 2.0**-38),
        _unsigned(f"e5b_health_{n}", 2),
        _unsigned(f"e1b_health_{n}", 2),
    )


def _parity(kind: int) -> BitLayout:
    return _layout(kind, _unsigned("first_octet", 8), _unsigned("iod_nav_low", 2), _unsigned("octets", 112))


WORD_LAYOUTS: Mapping[int, BitLayout] = {
    0: _layout(
        0,
        {"name": "time_set", "length": 2, "fill": 0b10},  # `week` and `tow_s` are valid
        _spare("spare", 88),
        _WEEK,
        _TOW,
    ),
    1: _layout(
        1,
        _IOD_NAV,
        _unsigned("toe_s", 14, 60.0, "s"),
        _angle("m0_rad", 32, -31),
        _unsigned("eccentricity", 32, 2.0**-33),
        _unsigned("sqrt_a", 32, 2.0**-19, "m^0.5"),
        {"name": "reserved", "length": 2, "fill": 0b11},
    ),
    2: _layout(
        2,
        _IOD_NAV,
        _angle("omega0_rad", 32, -31),
        _angle("i0_rad", 32, -31),
        _angle("omega_rad", 32, -31),
        _angle_rate("i_dot_radps", 14, -43),
        _spare("reserved", 2),
    ),
    3: _layout(
        3,
        _IOD_NAV,
        _angle_rate("omega_dot_radps", 24, -43),
        _angle_rate("delta_n_radps", 16, -43),
        _signed("cuc_rad", 16, 2.0**-29, "rad"),
        _signed("cus_rad", 16, 2.0**-29, "rad"),
        _signed("crc_m", 16, 2.0**-5, "m"),
        _signed("crs_m", 16, 2.0**-5, "m"),
        _unsigned("sisa_index", 8),
    ),
    4: _layout(
        4,
        _IOD_NAV,
        _unsigned("svid", 6),
        _signed("cic_rad", 16, 2.0**-29, "rad"),
        _signed("cis_rad", 16, 2.0**-29, "rad"),
        _unsigned("toc_s", 14, 60.0, "s"),
        _signed("af0_s", 31, 2.0**-34, "s"),
        _signed("af1", 21, 2.0**-46),
        _signed("af2_per_s", 6, 2.0**-59, "1/s"),
        _spare("spare", 2),
    ),
    5: _layout(
        5,
        _unsigned("ai0_sfu", 11, 2.0**-2, "sfu"),
        _signed("ai1_sfu_per_deg", 11, 2.0**-8, "sfu/deg"),
        _signed("ai2_sfu_per_deg2", 14, 2.0**-15, "sfu/deg²"),
        _unsigned("ionosphere_disturbance", 5),  # one bit for each region, region 1 first
        _signed("bgd_e1_e5a_s", 10, 2.0**-32, "s"),
        _signed("bgd_e1_e5b_s", 10, 2.0**-32, "s"),
        _unsigned("e5b_health", 2),
        _unsigned("e1b_health", 2),
        _unsigned("e5b_data_invalid", 1),
        _unsigned("e1b_data_invalid", 1),
        _WEEK,
        _TOW,
        _spare("spare", 23),
    ),
    6: _layout(
        6,
        _signed("a0_s", 32, 2.0**-30, "s"),
        _signed("a1", 24, 2.0**-50),
        _signed("leap_seconds", 8, 1.0, "s"),
        _unsigned("t0t_s", 8, 3600.0, "s"),
        _unsigned("utc_week", 8),
        _unsigned("leap_week", 8),
        _unsigned("leap_day", 3),
        _signed("leap_seconds_after", 8, 1.0, "s"),
        _TOW,
        _spare("spare", 3),
    ),
    7: _layout(
        7,
        _IOD_ALMANAC,
        *_ALMANAC_TIME,
        *_almanac_orbit(1),
        *_almanac_node(1),
        _almanac_anomaly(1),
        _spare("reserved", 6),
    ),
    8: _layout(
        8,
        _IOD_ALMANAC,
        *_almanac_clock(1),
        *_almanac_orbit(2),
        *_almanac_node(2),
        _spare("spare", 1),
    ),
    9: _layout(
        9,
        _IOD_ALMANAC,
        *_ALMANAC_TIME,
        _almanac_anomaly(2),
        *_almanac_clock(2),
        *_almanac_orbit(3),
    ),
    10: _layout(
        10,
        _IOD_ALMANAC,
        *_almanac_node(3),
        _almanac_anomaly(3),
        *_almanac_clock(3),
        _signed("a0g_s", 16, 2.0**-35, "s"),
        _signed("a1g", 12, 2.0**-51),
        _unsigned("t0g_s", 8, 3600.0, "s"),
        _unsigned("ggto_week", 6),
    ),
    16: _layout(
        16,
        _signed("delta_a_m", 5, 2.0**8, "m"),
        _signed("ex", 13, 2.0**-22),
        _signed("ey", 13, 2.0**-22),
        _angle("delta_i0_rad", 17, -22),
        _angle("omega0_rad", 23, -22),
        _angle("lambda0_rad", 23, -22),
        _signed("af0_s", 22, 2.0**-26, "s"),
        _signed("af1", 6, 2.0**-35),
    ),
    **{kind: _parity(kind) for kind in PARITY_WORDS},
}


def word_layout(kind: int) -> BitLayout:
    """Return the fields of a word type. An unknown type has a field for the type, and a field of 122 bits of data.

    Parameters
    ----------
    kind
        Word type, 0 to 63.

    Examples
    --------
    >>> [field.name for field in word_layout(17).fields]
    ['type', 'first_octet', 'iod_nav_low', 'octets']
    """
    if not 0 <= kind < 1 << TYPE_BITS:
        raise ValueError(f"word type {kind}, expected 0 to 63")
    return WORD_LAYOUTS.get(kind) or _layout(kind, _unsigned("data", WORD_BITS - TYPE_BITS))
