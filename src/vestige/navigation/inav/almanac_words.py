"""Encode and decode the almanac, coarse orbits in sets of up to three satellites in words 7 to 10 [OS-ICD, 5.1.10].

The almanac shows a receiver which satellites are in view. Satellite positions from the almanac have errors of some
kilometres. A satellite whose orbit or clock does not fit into the fields is not in the almanac. Examples are the two
satellites in eccentric orbits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields

from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.reduced_ced import NOMINAL_AXIS_M, NOMINAL_INCLINATION_RAD
from vestige.navigation.inav.timing_words import NO_GPS_TIME, GpsTimeOffset
from vestige.navigation.inav.word_table import WORD_LAYOUTS
from vestige.navigation.inav.words import InavWord
from vestige.navigation.reissue import referred_to
from vestige.time import GalileoTime

ALMANAC_WORDS = (7, 8, 9, 10)
SATELLITES_PER_SET = 3
ALMANAC_STEP_S = 600  # step of t0a in s [OS-ICD, 4.3.5]
_WEEKS = 1 << WORD_LAYOUTS[7].by_name["almanac_week"].length


@dataclass(frozen=True, slots=True, kw_only=True)
class AlmanacEntry:
    """Almanac of one satellite. SVID 0 means an empty entry.

    Attributes
    ----------
    delta_sqrt_a
        √A minus √(29 600 km), in √m.
    eccentricity
        Eccentricity e.
    omega_rad, omega0_rad, m0_rad
        Argument of perigee, longitude of the ascending node at the start of the week of t0a, and mean anomaly at t0a.
    delta_i_rad
        Inclination minus 56°.
    omega_dot_radps
        Rate of the longitude of the ascending node.
    af0_s, af1
        Offset in s and drift of the satellite clock at t0a.
    e5b_health, e1b_health
        Status of the signals E5b and E1-B; 0 is OK.
    """

    svid: int = 0
    delta_sqrt_a: float = 0.0
    eccentricity: float = 0.0
    omega_rad: float = 0.0
    delta_i_rad: float = 0.0
    omega0_rad: float = 0.0
    omega_dot_radps: float = 0.0
    m0_rad: float = 0.0
    af0_s: float = 0.0
    af1: float = 0.0
    e5b_health: int = 0
    e1b_health: int = 0

    @classmethod
    def from_ephemeris(cls, ephemeris: Ephemeris, t0a: GalileoTime) -> AlmanacEntry | None:
        """Return the almanac entry of a satellite; None if orbit or clock does not fit into the fields.

        Parameters
        ----------
        ephemeris
            Orbit, clock and health of the satellite.
        t0a
            Time to which the almanac refers, a multiple of 600 s.
        """
        orbit = referred_to(ephemeris, t0a)
        clock_s = t0a - orbit.toc
        entry = cls(
            svid=orbit.svid,
            delta_sqrt_a=orbit.sqrt_a - math.sqrt(NOMINAL_AXIS_M),
            eccentricity=orbit.eccentricity,
            omega_rad=orbit.omega_rad,
            delta_i_rad=orbit.i0_rad - NOMINAL_INCLINATION_RAD,
            omega0_rad=orbit.omega0_rad,
            omega_dot_radps=orbit.omega_dot_radps,
            m0_rad=orbit.m0_rad,
            af0_s=orbit.af0_s + (orbit.af1 + orbit.af2_per_s * clock_s) * clock_s,
            af1=orbit.af1 + 2 * orbit.af2_per_s * clock_s,
            e5b_health=orbit.e1b_health,
            e1b_health=orbit.e1b_health,
        )
        try:
            AlmanacSet(issue=0, t0a=t0a, entries=(entry,)).words()
        except VestigeError:
            return None
        return entry

    def ephemeris(self, t0a: GalileoTime) -> Ephemeris:
        """Return the coarse orbit and clock of the entry as an ephemeris.

        Parameters
        ----------
        t0a
            Time to which the almanac refers.
        """
        return Ephemeris(
            svid=self.svid,
            iod_nav=0,
            toe=t0a,
            toc=t0a,
            sqrt_a=math.sqrt(NOMINAL_AXIS_M) + self.delta_sqrt_a,
            eccentricity=self.eccentricity,
            m0_rad=self.m0_rad,
            delta_n_radps=0.0,
            omega0_rad=self.omega0_rad,
            omega_dot_radps=self.omega_dot_radps,
            i0_rad=NOMINAL_INCLINATION_RAD + self.delta_i_rad,
            i_dot_radps=0.0,
            omega_rad=self.omega_rad,
            af0_s=self.af0_s,
            af1=self.af1,
            e1b_health=self.e1b_health,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AlmanacSet:
    """Almanac set: the content of words 7 to 10.

    Attributes
    ----------
    issue
        Issue number of the almanac (IODa), 0 to 15.
    t0a
        Time to which the entries refer, a multiple of 600 s.
    entries
        One to three entries, of which some may be empty. The words carry three entries, so missing entries are sent
        empty.
    gps_time
        Offset between Galileo and GPS time in word 10; None without an offset.
    """

    issue: int
    t0a: GalileoTime
    entries: tuple[AlmanacEntry, ...]
    gps_time: GpsTimeOffset | None = None

    def __post_init__(self) -> None:
        if not 1 <= len(self.entries) <= SATELLITES_PER_SET or self.t0a.second % ALMANAC_STEP_S or self.t0a.fraction:
            raise ValueError(f"{len(self.entries)} almanac entries at {self.t0a}, expected 1 to 3 at whole 10 minutes")

    def words(self) -> dict[int, int]:
        """Return the words 7 to 10, each field rounded to its step.

        Returns
        -------
        dict
            Word type 7 to 10 -> word of 128 bits.

        Raises
        ------
        VestigeError
            If a value does not fit into its field.
        """
        values: dict[str, float] = {
            "iod_almanac": self.issue,
            "almanac_week": self.t0a.week % _WEEKS,
            "t0a_s": self.t0a.second,
        }
        empty = (AlmanacEntry(),) * (SATELLITES_PER_SET - len(self.entries))
        for place, entry in enumerate((*self.entries, *empty), start=1):
            values |= {f"{name}_{place}": value for name, value in asdict(entry).items()}
        values |= _gps_time_values(self.gps_time)
        return {kind: InavWord.from_values(kind, _of_word(kind, values)).encode() for kind in ALMANAC_WORDS}

    @classmethod
    def from_words(cls, words: Mapping[int, int], received: GalileoTime) -> AlmanacSet | None:
        """Return the set in words 7 to 10; None if a word is missing, or the words have different IODa or t0a.

        Parameters
        ----------
        words
            Word type -> word of 128 bits.
        received
            Time of reception, from which the full week of t0a is found. The full week is between two weeks before and
            one week after the week of reception.
        """
        if any(kind not in words for kind in ALMANAC_WORDS):
            return None
        decoded = {kind: InavWord.decode(words[kind]) for kind in ALMANAC_WORDS}
        if (
            len({word.raw["iod_almanac"] for word in decoded.values()}) > 1
            or decoded[7].raw["t0a_s"] != decoded[9].raw["t0a_s"]
        ):
            return None
        values = {name: value for word in decoded.values() for name, value in word.values.items()}
        week = received.week + (decoded[7].raw["almanac_week"] - received.week + 2) % _WEEKS - 2
        return cls(
            issue=decoded[7].raw["iod_almanac"],
            t0a=GalileoTime(week, int(values["t0a_s"])),
            entries=tuple(_entry(values, place) for place in range(1, SATELLITES_PER_SET + 1)),
            gps_time=GpsTimeOffset.from_word(words[10], received),
        )


def almanac_sets(
    ephemerides: Sequence[Ephemeris], t0a: GalileoTime, *, issue: int = 0, gps_time: GpsTimeOffset | None = None
) -> tuple[AlmanacSet, ...]:
    """Return the almanac sets of a constellation, with up to three satellites in a set.

    Satellites whose orbit or clock does not fit into the fields are left out.

    Parameters
    ----------
    ephemerides
        One ephemeris of each satellite.
    t0a
        Time to which the almanac refers, a multiple of 600 s.
    issue
        Issue number of the almanac (IODa), 0 to 15.
    gps_time
        Offset between Galileo and GPS time; None without an offset.
    """
    found = (AlmanacEntry.from_ephemeris(ephemeris, t0a) for ephemeris in sorted(ephemerides, key=lambda one: one.svid))
    entries = tuple(entry for entry in found if entry is not None)
    return tuple(
        AlmanacSet(issue=issue, t0a=t0a, entries=entries[first : first + SATELLITES_PER_SET], gps_time=gps_time)
        for first in range(0, len(entries), SATELLITES_PER_SET)
    )


def _of_word(kind: int, values: Mapping[str, float]) -> dict[str, float]:
    return {name: values[name] for name in WORD_LAYOUTS[kind].by_name if name in values}


def _gps_time_values(gps_time: GpsTimeOffset | None) -> dict[str, float]:
    if gps_time is not None:
        return gps_time.fields
    return {name: WORD_LAYOUTS[10].by_name[name].physical(raw) for name, raw in NO_GPS_TIME.items()}


def _entry(values: Mapping[str, float], place: int) -> AlmanacEntry:
    own = {one.name: values[f"{one.name}_{place}"] for one in fields(AlmanacEntry)}
    counts = {name: int(own.pop(name)) for name in ("svid", "e5b_health", "e1b_health")}
    return AlmanacEntry(**own, **counts)  # type: ignore[arg-type]
