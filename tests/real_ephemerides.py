"""Ephemerides that real satellites broadcast, out of the recorded I/NAV pages."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.ephemeris_words import ephemeris_from_words
from vestige.recording.navigation.navigation_pages import read_pages

ECCENTRIC = 18  # E18 was left in an orbit of eccentricity 0.16 by its launcher


def recorded_words(osnma_data: Path) -> dict[int, tuple[dict[int, int], object]]:
    """Return the first words 1 to 5 of each satellite and the time of the last of them."""
    words: dict[int, dict[int, int]] = defaultdict(dict)
    times: dict[int, object] = {}
    for page in read_pages(osnma_data / "recorded_2025-12-12.sbf"):
        kind = page.word >> 122
        if page.crc_ok and not page.is_alert and 1 <= kind <= 5 and kind not in words[page.svid]:
            words[page.svid][kind] = page.word
            times[page.svid] = page.time
    return {svid: (words[svid], times[svid]) for svid in sorted(words) if len(words[svid]) == 5}


def recorded_ephemerides(osnma_data: Path) -> dict[int, Ephemeris]:
    """Return the first ephemeris of each satellite."""
    found = {}
    for svid, (words, time) in recorded_words(osnma_data).items():
        ephemeris = ephemeris_from_words(words, time)  # type: ignore[arg-type]
        if ephemeris is not None:
            found[svid] = ephemeris
    return found
