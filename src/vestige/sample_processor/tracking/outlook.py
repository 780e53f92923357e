"""Choose the satellite that a tracking receiver searches next, from the elevations that the almanac gives.

Every satellite sends the almanac of all satellites in words 7 to 10, three satellites a minute [OS-ICD, 5.1.10]. From
the almanac's coarse orbits and the ranges of four satellites, the receiver computes its position to some kilometres.
This position gives elevations to a tenth of a degree. So within seconds the receiver finds a satellite that has risen.
A search of all satellites in turn may take minutes.

The almanac only decides which satellites are tried first. A message may be forged, and an almanac may be old. So every
fourth search is for a satellite that is not known to be above the horizon, if such a satellite is untracked. No verdict
depends on the almanac.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Float

from vestige.constants import MAX_SVID
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.almanac_words import ALMANAC_WORDS, AlmanacSet
from vestige.navigation.inav.page import InavPage
from vestige.navigation.inav.words import word_type
from vestige.navigation.line_of_sight import ReceiverMotion, line_of_sight
from vestige.navigation.position_fix import UNKNOWNS, position_fix, transmission
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

# lowest elevation in degrees of a satellite that is searched first; a satellite at −1° may be about to rise
HORIZON_DEG = -1.0
_SET_S = 60  # time in s in which a satellite sends one set of words 7 to 10
_LOOK_S = 60.0
_OTHERS_EVERY = 4  # one in four searches is for a satellite that is not known to be above the horizon
_ORBIT_SIGMA_M = 1e4


class Outlook:
    """Chooser of the next searched satellite, from the almanac in the message and the receiver's own ranges.

    Attributes
    ----------
    position_m
        ECEF position in m, correct to some kilometres; None while the position is unknown.
    """

    def __init__(self) -> None:
        self.position_m: Float[np.ndarray, " 3"] | None = None
        self._words: dict[int, tuple[int, dict[int, int]]] = {}  # minute and almanac words of that minute, by satellite
        self._orbits: dict[int, Ephemeris] = {}
        self._searched: dict[int, int] = {}  # number of the last search, by satellite
        self._n_searches = 0
        self._above: set[int] = set()
        self._looked_at: GalileoTime | None = None

    @property
    def known(self) -> frozenset[int]:
        """Satellites with a known almanac."""
        return frozenset(self._orbits)

    def take(self, page: InavPage) -> None:
        """Store the almanac words of the next page, which must have a good checksum."""
        kind = word_type(page.word)
        if page.is_alert or kind not in ALMANAC_WORDS:
            return
        minute = page.time.gst_seconds // _SET_S
        before, words = self._words.get(page.svid, (minute, {}))
        words = words if before == minute else {}
        words[kind] = page.word
        self._words[page.svid] = minute, words
        try:
            found = AlmanacSet.from_words(words, page.time)
        except ValueError:  # the almanac's reference time is after the end of a week
            return
        for entry in () if found is None else found.entries:
            if found is not None and 1 <= entry.svid <= MAX_SVID:
                self._orbits[entry.svid] = entry.ephemeris(found.t0a)

    def locate(self, epoch: ObservationEpoch) -> None:
        """Compute the position from the ranges of an epoch, if the almanac has four or more satellites of the epoch."""
        svids = sorted(self.known & set(epoch.observations))
        if len(svids) < UNKNOWNS:
            return
        ranges_m = np.array([[epoch.observations[svid].pseudorange_m for svid in svids]])
        sent = transmission([self._orbits[svid] for svid in svids], epoch.time, np.zeros(1), ranges_m)
        fix = position_fix(sent, ranges_m, np.full_like(ranges_m, _ORBIT_SIGMA_M))
        if fix.valid[0]:
            self.position_m = fix.position_m[0]

    def elevation_deg(self, svid: int, time: GalileoTime) -> float:
        """Return the elevation of a satellite in degrees; NaN if its almanac or the receiver's position is unknown."""
        if self.position_m is None or svid not in self._orbits:
            return float("nan")
        rest = np.zeros((1, 3))
        here = ReceiverMotion(position_m=self.position_m[None, :], velocity_mps=rest, acceleration_mps2=rest)
        seen = line_of_sight(self._orbits[svid], time, np.zeros(1), here)
        return float(np.degrees(seen.elevation_rad[0]))

    def next_search(self, unseen: Collection[int], time: GalileoTime) -> int | None:
        """Return the satellite to look for next; None if all satellites are tracked.

        Three of four searches are for satellites above `HORIZON_DEG`, if any of these satellites is untracked. The
        fourth search is for the other untracked satellites, if there are any. If several satellites qualify for a
        search, the function returns a satellite that was never searched, or else the satellite whose last search is the
        oldest.

        Parameters
        ----------
        unseen
            Satellites that are not tracked.
        time
            Time to which the elevations refer.
        """
        self._n_searches += 1
        self._look_up(time)
        above = [svid for svid in unseen if svid in self._above]
        others = [svid for svid in unseen if svid not in above]
        first, second = (others, above) if self._n_searches % _OTHERS_EVERY == 0 else (above, others)
        found = self._longest_ago(first or second)
        if found is not None:
            self._searched[found] = self._n_searches
        return found

    def _look_up(self, time: GalileoTime) -> None:
        """Determine the satellites above the horizon; a result with satellites is kept for a minute.

        The elevation of a satellite near the horizon changes by less than half a degree in a minute.
        """
        if self._looked_at is None or abs(time - self._looked_at) >= _LOOK_S:
            self._above = {svid for svid in self._orbits if self.elevation_deg(svid, time) >= HORIZON_DEG}
            self._looked_at = time if self._above else None

    def _longest_ago(self, svids: Sequence[int]) -> int | None:
        return min(svids, key=lambda svid: (self._searched.get(svid, 0), svid), default=None)
