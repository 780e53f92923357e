"""Encode and decode reduced clock and ephemeris data, the coarse orbit and clock in word 16 [OS-ICD, reduced CED].

A receiver that has just started can compute a first fix from word 16 before words 1 to 4 are complete. The error of the
first fix is tens to hundreds of metres. The word contains six orbital elements relative to a nominal orbit, and a
clock::

    A = 29 600 km + ΔA,   e = √(ex² + ey²),   ω = atan2(ey, ex),   M0 = λ0 − ω,   i0 = 56° + Δi0

The elements and the clock refer to the start of the first page of the subframe that carries the word. Only the
longitude of the ascending node is given for the start of the week. The elements are computed anew for each subframe. An
orbit that is too eccentric for the fields has no word 16.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, fields, replace
from typing import Self

import numpy as np
from jaxtyping import Float

from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S
from vestige.navigation.inav.word_table import WORD_LAYOUTS
from vestige.navigation.inav.words import InavWord
from vestige.navigation.orbit import satellite_state
from vestige.navigation.reissue import referred_to
from vestige.time import GalileoTime

REDUCED_CED_WORD = 16
NOMINAL_AXIS_M = 29_600_000.0  # [OS-ICD, reduced CED]
NOMINAL_INCLINATION_RAD = math.radians(56.0)  # [OS-ICD, reduced CED]

# Times of the fit in s after the reference time. A receiver gets the next word 16 long before the last of these times.
_FIT_S = np.linspace(0.0, 600.0, 7)
_STEPS = 4  # number of Gauss–Newton steps; the elements start within 1e-5 (rad, or plain number) of the solution
# Change of an element for the derivatives, in rad or as a plain number. The change moves the satellite by 30 m.
_DIFFERENCE = 1e-6


def reference_time(time: GalileoTime) -> GalileoTime:
    """Return the time to which word 16 of a subframe refers, which is the start of the first page of the subframe.

    Parameters
    ----------
    time
        Any time in the subframe that carries the word.
    """
    return time.subframe + float(FIRST_PAGE_OFFSET_S)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedCed:
    """The content of a word 16.

    Attributes
    ----------
    delta_a_m
        Semi-major axis minus the nominal axis, in m.
    ex, ey
        Eccentricity vector: e cos ω and e sin ω.
    delta_i0_rad
        Inclination minus the nominal inclination, in rad.
    omega0_rad
        Longitude of the ascending node at the start of the week of the reference time, in rad.
    lambda0_rad
        Mean anomaly plus argument of perigee, M0 + ω, in rad.
    af0_s, af1
        Offset in s and drift of the satellite clock for the signal pair (E1, E5b).
    """

    delta_a_m: float
    ex: float
    ey: float
    delta_i0_rad: float
    omega0_rad: float
    lambda0_rad: float
    af0_s: float
    af1: float

    @classmethod
    def from_word(cls, word: int) -> Self:
        """Return the content of a word 16 of 128 bits."""
        decoded = InavWord.decode(word)
        return cls(**{field.name: decoded.value(field.name) for field in fields(cls)})

    @classmethod
    def from_ephemeris(cls, ephemeris: Ephemeris, time: GalileoTime) -> Self | None:
        """Return the content of word 16 that fits an ephemeris best in the 10 min after the reference time.

        The semi-major axis is first rounded to its coarse steps of 256 m. The other elements are then fitted for the
        rounded axis.

        Parameters
        ----------
        ephemeris
            Orbit and clock of the satellite.
        time
            Any time in the subframe that will carry the word.

        Returns
        -------
        ReducedCed or None
            Orbit and clock of word 16; None if the orbit or clock does not fit into the word.
        """
        start = reference_time(time)
        orbit = referred_to(ephemeris, start)
        clock_s = start - orbit.toc
        step_m = WORD_LAYOUTS[REDUCED_CED_WORD].by_name["delta_a_m"].scale
        guess = cls(
            delta_a_m=round((orbit.sqrt_a**2 - NOMINAL_AXIS_M) / step_m) * step_m,
            ex=orbit.eccentricity * math.cos(orbit.omega_rad),
            ey=orbit.eccentricity * math.sin(orbit.omega_rad),
            delta_i0_rad=orbit.i0_rad - NOMINAL_INCLINATION_RAD,
            omega0_rad=orbit.omega0_rad,
            lambda0_rad=orbit.m0_rad + orbit.omega_rad,
            af0_s=orbit.af0_s + (orbit.af1 + orbit.af2_per_s * clock_s) * clock_s,
            af1=orbit.af1 + 2 * orbit.af2_per_s * clock_s,
        )
        if not guess._fits:
            return None
        found = guess._fitted(orbit, start)
        return found if found._fits else None

    @property
    def word(self) -> int:
        """Word 16 with each field rounded to its step. A value that does not fit raises `VestigeError`."""
        return InavWord.from_values(
            REDUCED_CED_WORD, dict(zip((field.name for field in fields(self)), astuple(self), strict=True))
        ).encode()

    def ephemeris(self, svid: int, time: GalileoTime) -> Ephemeris:
        """Return the orbit and clock as an ephemeris, which is accurate only for some minutes after reception.

        Parameters
        ----------
        svid
            SVID of the satellite, 1 to 36. The word does not name the satellite.
        time
            Any time in the subframe that carried the word.
        """
        start = reference_time(time)
        perigee = math.atan2(self.ey, self.ex)
        return Ephemeris(
            svid=svid,
            iod_nav=0,
            toe=start,
            toc=start,
            sqrt_a=math.sqrt(NOMINAL_AXIS_M + self.delta_a_m),
            eccentricity=math.hypot(self.ex, self.ey),
            m0_rad=self.lambda0_rad - perigee,
            delta_n_radps=0.0,
            omega0_rad=self.omega0_rad,
            omega_dot_radps=0.0,
            i0_rad=NOMINAL_INCLINATION_RAD + self.delta_i0_rad,
            i_dot_radps=0.0,
            omega_rad=perigee,
            af0_s=self.af0_s,
            af1=self.af1,
        )

    @property
    def _fits(self) -> bool:
        try:
            _ = self.word
        except VestigeError:
            return False
        return True

    def _fitted(self, orbit: Ephemeris, start: GalileoTime) -> Self:
        """Return the content with unchanged axis, and with all other elements fitted to the positions of an orbit."""
        names = ("ex", "ey", "delta_i0_rad", "omega0_rad", "lambda0_rad")
        wanted = satellite_state(orbit, start, _FIT_S).position_m
        found = self
        for _ in range(_STEPS):
            at = found._positions(start)
            columns = [
                (replace(found, **{name: getattr(found, name) + _DIFFERENCE})._positions(start) - at).reshape(-1)
                for name in names
            ]
            jacobian = np.stack(columns, axis=1) / _DIFFERENCE
            step = np.linalg.lstsq(jacobian, (wanted - at).reshape(-1), rcond=None)[0]
            moved = {name: getattr(found, name) + float(change) for name, change in zip(names, step, strict=True)}
            found = replace(found, **moved)
        return found

    def _positions(self, start: GalileoTime) -> Float[np.ndarray, "n 3"]:
        return satellite_state(self.ephemeris(1, start), start, _FIT_S).position_m
