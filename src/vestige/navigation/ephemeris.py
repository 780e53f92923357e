"""The broadcast ephemeris of a Galileo satellite, and its way out of the I/NAV words 1 to 5.

Fields, lengths and units are those of the words [OS-ICD, 4.3.5]; angles, there in semicircles, are in rad here. A toe
or toc in the message counts minutes of a week that the message does not name: it is the one nearest to transmission.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from vestige.constants import SECONDS_PER_WEEK
from vestige.time import GalileoTime

NO_ACCURACY = float("nan")  # SISA "no accuracy prediction available" [OS-ICD, SISA]
FIT_INTERVAL_S = 4 * 3600.0  # an ephemeris is not to be used longer after its toe [OS-SDD]

_WORD_BITS = 128
_SEMICIRCLE = np.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class Ephemeris:
    """Orbit, clock and health of one satellite as it broadcasts them on I/NAV.

    Attributes
    ----------
    iod_nav
        Issue of data.
    toe, toc
        Times to which orbit and clock refer.
    sqrt_a
        √A in √m.
    eccentricity
        e.
    m0_rad, delta_n_radps
        Mean anomaly at toe and correction of the mean motion.
    omega0_rad, omega_dot_radps
        Ω0, longitude of the ascending node at the *start of toe's week*, and its rate in space.
    i0_rad, i_dot_radps
        Inclination at toe and its rate.
    omega_rad
        ω, argument of perigee.
    cuc_rad, cus_rad, crc_m, crs_m, cic_rad, cis_rad
        Second harmonics of argument of latitude, radius and inclination.
    af0_s, af1, af2_per_s
        Clock polynomial about toc, of the pair (E1, E5b).
    bgd_e1_e5a_s, bgd_e1_e5b_s
        Broadcast group delays.
    sisa_m
        Predicted signal-in-space accuracy, NaN if none is predicted.
    e1b_health
        Status of E1-B: 0 OK, 1 out of service, 2 extended operations, 3 in test [OS-ICD, signal health status].
    e1b_data_valid
        Whether the data validity status says that it is.
    """

    svid: int
    iod_nav: int
    toe: GalileoTime
    toc: GalileoTime
    sqrt_a: float
    eccentricity: float
    m0_rad: float
    delta_n_radps: float
    omega0_rad: float
    omega_dot_radps: float
    i0_rad: float
    i_dot_radps: float
    omega_rad: float
    cuc_rad: float = 0.0
    cus_rad: float = 0.0
    crc_m: float = 0.0
    crs_m: float = 0.0
    cic_rad: float = 0.0
    cis_rad: float = 0.0
    af0_s: float = 0.0
    af1: float = 0.0
    af2_per_s: float = 0.0
    bgd_e1_e5a_s: float = 0.0
    bgd_e1_e5b_s: float = 0.0
    sisa_m: float = NO_ACCURACY
    e1b_health: int = 0
    e1b_data_valid: bool = True

    @property
    def healthy(self) -> bool:
        """Whether E1-B may be used: signal OK and data valid."""
        return self.e1b_health == 0 and self.e1b_data_valid


# field -> (word type, first bit, bits, signed, value of the last bit) [OS-ICD, 4.3.5]
_FIELDS: Mapping[str, tuple[int, int, int, bool, float]] = {
    "m0_rad": (1, 30, 32, True, 2.0**-31 * _SEMICIRCLE),
    "eccentricity": (1, 62, 32, False, 2.0**-33),
    "sqrt_a": (1, 94, 32, False, 2.0**-19),
    "omega0_rad": (2, 16, 32, True, 2.0**-31 * _SEMICIRCLE),
    "i0_rad": (2, 48, 32, True, 2.0**-31 * _SEMICIRCLE),
    "omega_rad": (2, 80, 32, True, 2.0**-31 * _SEMICIRCLE),
    "i_dot_radps": (2, 112, 14, True, 2.0**-43 * _SEMICIRCLE),
    "omega_dot_radps": (3, 16, 24, True, 2.0**-43 * _SEMICIRCLE),
    "delta_n_radps": (3, 40, 16, True, 2.0**-43 * _SEMICIRCLE),
    "cuc_rad": (3, 56, 16, True, 2.0**-29),
    "cus_rad": (3, 72, 16, True, 2.0**-29),
    "crc_m": (3, 88, 16, True, 2.0**-5),
    "crs_m": (3, 104, 16, True, 2.0**-5),
    "cic_rad": (4, 22, 16, True, 2.0**-29),
    "cis_rad": (4, 38, 16, True, 2.0**-29),
    "af0_s": (4, 68, 31, True, 2.0**-34),
    "af1": (4, 99, 21, True, 2.0**-46),
    "af2_per_s": (4, 120, 6, True, 2.0**-59),
    "bgd_e1_e5a_s": (5, 47, 10, True, 2.0**-32),
    "bgd_e1_e5b_s": (5, 57, 10, True, 2.0**-32),
}
_IOD_WORDS = (1, 2, 3, 4)
_MINUTE_S = 60  # last bit of toe and toc


def ephemeris_from_words(words: Mapping[int, int], received: GalileoTime) -> Ephemeris | None:
    """Return the ephemeris in the navigation words 1 to 5 of one satellite, None if they are not all of one issue.

    Parameters
    ----------
    words
        Word type -> word of 128 bits, its first bit the most significant.
    received
        Time of reception, which tells the week of toe and toc.
    """
    if any(word not in words for word in (*_IOD_WORDS, 5)) or len({_bits(words, t, 6, 10) for t in _IOD_WORDS}) > 1:
        return None
    return Ephemeris(
        svid=_bits(words, 4, 16, 6),
        iod_nav=_bits(words, 1, 6, 10),
        toe=_nearest(_bits(words, 1, 16, 14) * _MINUTE_S, received),
        toc=_nearest(_bits(words, 4, 54, 14) * _MINUTE_S, received),
        sisa_m=sisa_m(_bits(words, 3, 120, 8)),
        e1b_health=_bits(words, 5, 69, 2),
        e1b_data_valid=_bits(words, 5, 72, 1) == 0,
        **{name: _value(words, *place) for name, place in _FIELDS.items()},
    )


def sisa_m(index: int) -> float:
    """Return the signal-in-space accuracy in m of its index, NaN for "no prediction" and spare values.

    Steps of 1, 2, 4 and 16 cm up to 0.5, 1, 2 and 6 m [OS-ICD, SISA].
    """
    for first, low, step in ((0, 0.0, 0.01), (50, 0.5, 0.02), (75, 1.0, 0.04), (100, 2.0, 0.16)):
        if first <= index < {0: 50, 50: 75, 75: 100, 100: 126}[first]:
            return low + (index - first) * step
    return NO_ACCURACY


def _bits(words: Mapping[int, int], word: int, start: int, length: int) -> int:
    return (words[word] >> (_WORD_BITS - start - length)) & ((1 << length) - 1)


def _value(words: Mapping[int, int], word: int, start: int, length: int, signed: bool, unit: float) -> float:
    raw = _bits(words, word, start, length)
    return (raw - (1 << length) if signed and raw >> (length - 1) else raw) * unit


def _nearest(second: int, received: GalileoTime) -> GalileoTime:
    """Return the time with this second of the week that is nearest to another time."""
    half = SECONDS_PER_WEEK // 2
    return received + float((second - received.second + half) % SECONDS_PER_WEEK - half) + -received.fraction


def nearest_ephemerides(ephemerides: Iterable[Ephemeris], time: GalileoTime) -> dict[int, Ephemeris]:
    """Return for each satellite the ephemeris whose toe is nearest to a time, if that is within the fit interval.

    Parameters
    ----------
    ephemerides
        Of any satellites, in any order; of equally near ones the later wins.
    time
        When they are to be used.
    """
    chosen: dict[int, Ephemeris] = {}
    for ephemeris in ephemerides:
        age_s, best = abs(time - ephemeris.toe), chosen.get(ephemeris.svid)
        if age_s <= FIT_INTERVAL_S and (best is None or age_s <= abs(time - best.toe)):
            chosen[ephemeris.svid] = ephemeris
    return dict(sorted(chosen.items()))


def why_no_orbits(ephemerides: Iterable[Ephemeris], time: GalileoTime, needed: int) -> str | None:
    """Return why fewer than `needed` satellites have an ephemeris for a time, as text; None if they have.

    Parameters
    ----------
    ephemerides
        At least one.
    time
        When they are to be used.
    needed
        How many satellites a fix needs.
    """
    known = tuple(ephemerides)
    usable = nearest_ephemerides(known, time)
    if len(usable) >= needed:
        return None
    toes = sorted(one.toe for one in known)
    return (
        f"{len(usable) or 'no'} satellites have an ephemeris within {FIT_INTERVAL_S / 3600:g} h of {time}, and a "
        f"position needs {needed}; those found are of {toes[0]} to {toes[-1]}"
    )
