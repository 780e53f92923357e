"""Ephemerides out of the navigation pages of a recording."""

from __future__ import annotations

from collections.abc import Iterable

from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.coding.fec2 import restored_words
from vestige.navigation.inav.ephemeris_words import STATUS_WORD, ephemeris_from_words
from vestige.navigation.inav.page import InavPage
from vestige.navigation.inav.word_table import EPHEMERIS_WORDS, PARITY_WORDS, WORD_LAYOUTS
from vestige.navigation.inav.words import word_type

_MIXED_S = 120  # words of one issue come within half of it; a parity word of another issue is not mixed in


def ephemerides_in(pages: Iterable[InavPage]) -> tuple[Ephemeris, ...]:
    """Return the ephemerides that navigation pages hold, each issue of each satellite once.

    Words 1 to 4 that were lost are restored from the parity words 17 to 20 [OS-ICD, FEC2]. Word 5, with the health,
    must have been received.

    Parameters
    ----------
    pages
        Pages with good checksums in the order of time.
    """
    held: dict[int, dict[int, tuple[int, int]]] = {}  # satellite: word type: when, and the word
    found: dict[tuple[int, int], Ephemeris] = {}
    for page in pages:
        if page.is_alert:
            continue
        kind, now = word_type(page.word), page.time.gst_seconds
        if kind not in (*EPHEMERIS_WORDS, *PARITY_WORDS, STATUS_WORD):
            continue
        words = held.setdefault(page.svid, {})
        words[kind] = (now, page.word)
        recent = {one: word for one, (when, word) in words.items() if now - when <= _MIXED_S}
        status = words.get(STATUS_WORD)
        if status is None:
            continue
        issues = {WORD_LAYOUTS[one].read(recent[one], "iod_nav") for one in EPHEMERIS_WORDS if one in recent}
        if len(issues) > 1:  # a new issue has begun: what is older does not belong to it
            newest = max((when, one) for one, (when, _) in words.items() if one in EPHEMERIS_WORDS)[1]
            issue = WORD_LAYOUTS[newest].read(words[newest][1], "iod_nav")
            for one in EPHEMERIS_WORDS:
                if one in words and WORD_LAYOUTS[one].read(words[one][1], "iod_nav") != issue:
                    del words[one]
                    recent.pop(one, None)
            for one in PARITY_WORDS:
                if words.pop(one, None):
                    recent.pop(one, None)
        restored = restored_words(recent)
        if restored is None:
            continue
        ephemeris = ephemeris_from_words({**restored, STATUS_WORD: status[1]}, page.time)
        if ephemeris is not None and ephemeris.svid == page.svid:
            found[ephemeris.svid, ephemeris.iod_nav] = ephemeris
    return tuple(found[key] for key in sorted(found))
