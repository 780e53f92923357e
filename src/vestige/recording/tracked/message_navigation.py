"""Collect ephemerides from the navigation pages of a recording."""

from __future__ import annotations

from collections.abc import Iterable

from vestige.crypto.osnma.messages.navigation_data import ADKD_EPHEMERIS
from vestige.crypto.osnma.osnma_report import AuthenticatedData
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.coding.fec2 import restored_words
from vestige.navigation.inav.ephemeris_words import STATUS_WORD, ephemeris_from_words
from vestige.navigation.inav.page import InavPage
from vestige.navigation.inav.word_table import EPHEMERIS_WORDS, PARITY_WORDS, WORD_LAYOUTS
from vestige.navigation.inav.words import word_type

_MIXED_S = 120  # largest age in s of words 1 to 4 and 17 to 20 that are combined; all are sent within 60 s


class EphemerisCollector:
    """Collector that takes navigation pages one by one and keeps the ephemerides of all satellites.

    Any four of the words 1 to 4 and of the parity words 17 to 20 of an issue give all words 1 to 4 [OS-ICD, FEC2]. Word
    5, which contains the health of the signals, must have been received.

    Parameters
    ----------
    most_issues
        Number of newest issues that are kept for each satellite; None keeps all issues.
    """

    def __init__(self, most_issues: int | None = None) -> None:
        self._most = most_issues
        self._held: dict[int, dict[int, tuple[int, int]]] = {}  # time and bits of words, by satellite and word type
        self._found: dict[tuple[int, int], Ephemeris] = {}  # ephemeris by satellite and issue

    @property
    def ephemerides(self) -> tuple[Ephemeris, ...]:
        """Ephemerides, each issue of each satellite once, in the order of satellite and issue number."""
        return tuple(self._found[key] for key in sorted(self._found))

    def take(self, page: InavPage) -> None:
        """Take the word of the next page, whose checksum must be good."""
        if page.is_alert:
            return
        kind, now = word_type(page.word), page.time.gst_seconds
        if kind not in (*EPHEMERIS_WORDS, *PARITY_WORDS, STATUS_WORD):
            return
        words = self._held.setdefault(page.svid, {})
        words[kind] = (now, page.word)
        recent = {one: word for one, (when, word) in words.items() if now - when <= _MIXED_S}
        status = words.get(STATUS_WORD)
        if status is None:
            return
        _drop_other_issues(words, recent)
        restored = restored_words(recent)
        if restored is None:
            return
        ephemeris = ephemeris_from_words({**restored, STATUS_WORD: status[1]}, page.time)
        if ephemeris is not None and ephemeris.svid == page.svid:
            self._keep(ephemeris)

    def _keep(self, ephemeris: Ephemeris) -> None:
        self._found[ephemeris.svid, ephemeris.iod_nav] = ephemeris
        own = sorted((one for one in self._found.values() if one.svid == ephemeris.svid), key=lambda one: one.toe)
        for old in own[: -self._most] if self._most else ():
            del self._found[old.svid, old.iod_nav]


def ephemerides_in(pages: Iterable[InavPage]) -> tuple[Ephemeris, ...]:
    """Return the ephemerides in navigation pages, each issue of each satellite once.

    Parameters
    ----------
    pages
        Pages with good checksums in the order of time.
    """
    collector = EphemerisCollector()
    for page in pages:
        collector.take(page)
    return collector.ephemerides


def authenticated_orbits(
    found: tuple[Ephemeris, ...], proven: Iterable[AuthenticatedData]
) -> tuple[tuple[Ephemeris, ...], frozenset[int]]:
    """Return the ephemerides to use, and the satellites whose ephemerides OSNMA tags have verified.

    If tags have verified an issue of a satellite, all issues of the satellite that no tag has verified are left out.

    Parameters
    ----------
    found
        Ephemerides from the navigation messages.
    proven
        Navigation data that tags have verified.
    """
    issues = {(one.svid, one.iod_nav) for one in proven if one.authenticated and one.adkd == ADKD_EPHEMERIS}
    svids = frozenset(one.svid for one in found if (one.svid, one.iod_nav) in issues)
    return tuple(one for one in found if one.svid not in svids or (one.svid, one.iod_nav) in issues), svids


def _drop_other_issues(words: dict[int, tuple[int, int]], recent: dict[int, int]) -> None:
    """If a new issue has begun, drop the words of older issues and all parity words.

    A parity word has only two bits of IODnav, so the issue of the parity word is uncertain.
    """
    issues = {WORD_LAYOUTS[one].read(recent[one], "iod_nav") for one in EPHEMERIS_WORDS if one in recent}
    if len(issues) < 2:
        return
    newest = max((when, one) for one, (when, _) in words.items() if one in EPHEMERIS_WORDS)[1]
    issue = WORD_LAYOUTS[newest].read(words[newest][1], "iod_nav")
    for one in EPHEMERIS_WORDS:
        if one in words and WORD_LAYOUTS[one].read(words[one][1], "iod_nav") != issue:
            del words[one]
            recent.pop(one, None)
    for one in PARITY_WORDS:
        if words.pop(one, None):
            recent.pop(one, None)
