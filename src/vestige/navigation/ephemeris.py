"""Define the broadcast ephemeris of a Galileo satellite, and choose the ephemeris for a time.

The fields of an ephemeris correspond to fields of the I/NAV words 1 to 5 [OS-ICD, 4.3.5]. Angles are in rad instead of
semicircles. `vestige.navigation.inav.ephemeris_words` reads and writes the words.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vestige.time import GalileoTime

NO_ACCURACY = float("nan")  # SISA "no accuracy prediction available" [OS-ICD, SISA]
FIT_INTERVAL_S = 4 * 3600.0  # largest time in s between toe and the use of an ephemeris [OS-SDD]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ephemeris:
    """Orbit, clock and health of one satellite from its I/NAV broadcast.

    Attributes
    ----------
    iod_nav
        Issue number of the ephemeris (IODnav).
    toe, toc
        Times to which orbit and clock refer.
    sqrt_a
        √A, the square root of the semi-major axis, in √m.
    eccentricity
        Eccentricity e.
    m0_rad, delta_n_radps
        Mean anomaly at toe and correction of the mean motion.
    omega0_rad, omega_dot_radps
        Ω0, longitude of the ascending node at the *start of toe's week*, and its rate in space.
    i0_rad, i_dot_radps
        Inclination at toe and its rate.
    omega_rad
        ω, argument of perigee.
    cuc_rad, cus_rad, crc_m, crs_m, cic_rad, cis_rad
        Cosine and sine amplitudes of the corrections to argument of latitude, radius and inclination.
    af0_s, af1, af2_per_s
        Coefficients of the polynomial in time after toc that gives the clock error for the signal pair (E1, E5b).
    bgd_e1_e5a_s, bgd_e1_e5b_s
        Broadcast group delays of the signal pairs (E1, E5a) and (E1, E5b).
    sisa_m
        Predicted signal-in-space accuracy in m, NaN without a prediction.
    e1b_health
        Status of E1-B: 0 OK, 1 out of service, 2 extended operations, 3 in test [OS-ICD, signal health status].
    e1b_data_valid
        Whether the data validity status is "valid".
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
        """Whether the status of E1-B is OK and its data are valid, so that E1-B may be used."""
        return self.e1b_health == 0 and self.e1b_data_valid


def nearest_ephemerides(ephemerides: Iterable[Ephemeris], time: GalileoTime) -> dict[int, Ephemeris]:
    """Return for each satellite the ephemeris whose toe is nearest to a time, if the toe is at most 4 h from the time.

    Parameters
    ----------
    ephemerides
        Ephemerides of any satellites, in any order. If the toes of two ephemerides of a satellite are equally near, the
        second of the two ephemerides is used.
    time
        Time at which the ephemerides are used.
    """
    chosen: dict[int, Ephemeris] = {}
    for ephemeris in ephemerides:
        age_s, best = abs(time - ephemeris.toe), chosen.get(ephemeris.svid)
        if age_s <= FIT_INTERVAL_S and (best is None or age_s <= abs(time - best.toe)):
            chosen[ephemeris.svid] = ephemeris
    return dict(sorted(chosen.items()))


def why_no_orbits(ephemerides: Iterable[Ephemeris], time: GalileoTime, needed: int) -> str | None:
    """Return why fewer than `needed` satellites have an ephemeris for a time; None if there are enough satellites.

    Parameters
    ----------
    ephemerides
        One or more ephemerides.
    time
        Time at which the ephemerides are used.
    needed
        Number of satellites that a fix needs.
    """
    known = tuple(ephemerides)
    usable = nearest_ephemerides(known, time)
    if len(usable) >= needed:
        return None
    toes = sorted(one.toe for one in known)
    return (
        f"{len(usable) or 'no'} satellites have an ephemeris within {FIT_INTERVAL_S / 3600:g} h of {time}, and a "
        f"position needs {needed}; the given ephemerides are of {toes[0]} to {toes[-1]}"
    )
