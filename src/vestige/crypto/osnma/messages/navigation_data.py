"""Extract the navigation data that OSNMA tags authenticate from the words of a satellite.

A tag in subframe s covers data that was sent up to the end of subframe s-1. ADKD 0 and 12 cover ephemeris, clock and
status (words 1 to 5, 549 bits). ADKD 4 covers the timing parameters (words 6 and 10, 141 bits) [OSNMA-ICD, ADKD].

This module uses the latest words 1 to 5 (or 6 and 10) received by the end of subframe s-1. The satellite must still be
received in subframe s-1. Words 1 to 4 must have the same IODnav. The bits of a tag are not checked if its data are not
available. Word 5 and the timing words carry no IOD, so the latest received words may be outdated after lost pages. The
tag's cut-off point shows whether the received words may be outdated (see `tags`). When a word without IOD changes, a
tag does not show whether it covers the old or the new data. In the subframe after the change, the new data and then the
old data are candidates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.messages.subframe import SatelliteSubframe
from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S, PAGE_S
from vestige.navigation.inav.word_table import EPHEMERIS_WORDS
from vestige.navigation.inav.words import word_bits
from vestige.time import GalileoTime

ADKD_EPHEMERIS, ADKD_TIMING, ADKD_SLOW = 0, 4, 12  # [OSNMA-ICD, MACK]

# ADKD -> (word type, first bit, end bit) of each part that a tag covers [OSNMA-ICD, ADKD]
NAVIGATION_FIELDS: Mapping[int, tuple[tuple[int, int, int], ...]] = {
    ADKD_EPHEMERIS: ((1, 6, 126), (2, 6, 126), (3, 6, 128), (4, 6, 126), (5, 6, 73)),
    ADKD_TIMING: ((6, 6, 105), (10, 86, 128)),
}

# types of the words that tags cover
TAGGED_WORDS = frozenset(word for fields in NAVIGATION_FIELDS.values() for word, _, _ in fields)
_PIECES = {word: (start, end) for fields in NAVIGATION_FIELDS.values() for word, start, end in fields}


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationData:
    """Navigation data of one satellite, as the bits that a tag covers."""

    svid: int
    iod_nav: int | None  # issue of data of words 1 to 4; None for timing parameters
    bits: int
    n_bits: int
    oldest_s: int  # time of reception of the word that was received first, in GST seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationWords:
    """Latest received navigation words of one satellite, for the word types that tags cover."""

    # word type -> (word, time of reception in GST seconds)
    words: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    # words without IODnav whose data changed in the last subframe: word type -> the previous word, as in `words`
    replaced: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    subframe_s: int = -1  # start of the last subframe with a page of this satellite, in GST seconds

    def updated(self, subframe: SatelliteSubframe) -> NavigationWords:
        """Return the latest words after the reception of a subframe."""
        start = subframe.time.gst_seconds
        received = {
            word >> 122: (word, start + FIRST_PAGE_OFFSET_S + PAGE_S * index)
            for index, word in enumerate(subframe.words)
            if word is not None and word >> 122 in TAGGED_WORDS
        }
        replaced = {
            kind: self.words[kind]
            for kind, (word, _) in received.items()
            if kind in self.words
            and kind not in EPHEMERIS_WORDS
            and _piece(kind, word) != _piece(kind, self.words[kind][0])
        }
        return NavigationWords(words={**self.words, **received}, replaced=replaced, subframe_s=start)

    def candidates(self, svid: int, adkd: int, subframe: GalileoTime) -> tuple[NavigationData, ...]:
        """Return the data that a tag may cover: the latest data, and older data if a word without IODnav changed."""
        before = replace(self, words={**self.words, **self.replaced})
        found = (words.data(svid, adkd, subframe) for words in (self, before))
        return tuple({data.bits: data for data in found if data is not None}.values())

    def data(self, svid: int, adkd: int, subframe: GalileoTime) -> NavigationData | None:
        """Return the latest data that a tag in `subframe` may cover; None without such data.

        The data are missing if words are missing, words have different IODnav, or the satellite was not received in the
        previous subframe.
        """
        fields = NAVIGATION_FIELDS[ADKD_EPHEMERIS if adkd == ADKD_SLOW else adkd]
        if self.subframe_s != subframe.gst_seconds - SUBFRAME_S or any(word not in self.words for word, _, _ in fields):
            return None
        iod_nav = None
        if adkd != ADKD_TIMING:
            issues = {word_bits(self.words[word][0], 6, 10) for word in EPHEMERIS_WORDS}
            if len(issues) > 1:
                return None
            iod_nav = issues.pop()
        bits = n_bits = 0
        for word, start, end in fields:
            bits = bits << (end - start) | word_bits(self.words[word][0], start, end - start)
            n_bits += end - start
        oldest_s = min(self.words[word][1] for word, _, _ in fields)
        return NavigationData(svid=svid, iod_nav=iod_nav, bits=bits, n_bits=n_bits, oldest_s=oldest_s)


def _piece(kind: int, word: int) -> int:
    """Return the part of a navigation word that tags cover."""
    start, end = _PIECES[kind]
    return word_bits(word, start, end - start)
