"""Every real page is decoded and encoded again, and has the same bits."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from real_ephemerides import ECCENTRIC
from vestige.navigation.ephemeris import FIT_INTERVAL_S, Ephemeris
from vestige.navigation.inav.almanac_words import ALMANAC_WORDS, AlmanacSet
from vestige.navigation.inav.coding.channel_coding import page_from_symbols, page_symbols
from vestige.navigation.inav.coding.fec2 import parity_words, restored_words
from vestige.navigation.inav.ephemeris_words import ephemeris_from_words, ephemeris_words, status_word
from vestige.navigation.inav.ionosphere import BroadcastIonosphere
from vestige.navigation.inav.page import NO_SSP, InavPage, encode_page, page_ssp
from vestige.navigation.inav.reduced_ced import ReducedCed, reference_time
from vestige.navigation.inav.schedule import scheduled_word
from vestige.navigation.inav.timing_words import UtcModel, time_word
from vestige.navigation.inav.word_table import DUMMY_WORD, PARITY_WORDS, WORD_LAYOUTS
from vestige.navigation.inav.words import InavWord, word_type
from vestige.navigation.orbit import satellite_state
from vestige.recording.navigation.navigation_pages import read_pages

FILES = {"test_vector_configuration_1_2023-08-16T0500.csv": 46_800, "recorded_2025-12-12.sbf": 24_679}
DUMMY_SSP = 0x55  # of dummy pages in the test vector


@pytest.fixture(scope="module", params=FILES)
def pages(request: pytest.FixtureRequest, osnma_data: Path) -> list[InavPage]:
    """Pages whose checksum is good."""
    found = [page for page in read_pages(osnma_data / request.param) if page.crc_ok and not page.is_alert]
    assert len(found) == FILES[request.param]
    return found


def without_spare(kind: int, word: int) -> dict[str, int]:
    return {name: raw for name, raw in InavWord.decode(word).raw.items() if name not in ("spare", "reserved")}


@pytest.mark.judged(
    by="real recording",
    what="I/NAV encoder",
    figure="all 46,800 pages of the official vector and 24,679 of a recording, bit for bit",
)
def test_every_page_and_word_is_made_again(pages: list[InavPage]) -> None:
    kinds: Counter[int] = Counter()
    for page in pages:
        decoded = InavWord.decode(page.word)
        kinds[decoded.kind] += 1
        again = encode_page(
            decoded.encode(),
            osnma=page.osnma,
            sar=page.field("sar"),
            spare=page.field("spare"),
            ssp=page.field("ssp"),
        )
        assert again == page.data
        assert InavWord.from_values(decoded.kind, decoded.values) == decoded
    assert set(WORD_LAYOUTS) <= set(kinds)


def test_synchronisation_patterns_are_those_of_the_second(pages: list[InavPage]) -> None:
    for page in pages:
        dummy = word_type(page.word) == DUMMY_WORD
        assert page.field("ssp") in ({DUMMY_SSP} if dummy else {NO_SSP, page_ssp(page.time)})


def test_pages_pass_the_channel_coding(pages: list[InavPage]) -> None:
    for page in pages[::20]:
        assert page_from_symbols(1.0 - 2.0 * page_symbols(page.data)) == page.data


def test_words_come_as_scheduled(pages: list[InavPage]) -> None:
    """E18 sends FEC2 in the recording, and word 5 where its orbit does not fit into word 16."""
    parity = {page.svid for page in pages if word_type(page.word) in PARITY_WORDS}
    for page in pages:
        kind = word_type(page.word)
        if kind != DUMMY_WORD:
            expected = scheduled_word(page.time, fec2=page.svid in parity, reduced_ced=page.svid != ECCENTRIC)
            assert kind == expected, page


def test_parity_words_are_those_of_the_ephemeris_words(pages: list[InavPage]) -> None:
    """Each parity word equals that which belongs to the last words 1 to 4, if those are of its issue."""
    words: dict[int, dict[int, int]] = defaultdict(dict)
    checked, restored = 0, 0
    made: dict[tuple[int, ...], dict[int, int]] = {}
    for page in pages:
        kind, own = word_type(page.word), words[page.svid]
        own[kind] = page.word
        issues = {InavWord.decode(own[one]).raw["iod_nav"] for one in (1, 2, 3, 4) if one in own}
        if kind not in PARITY_WORDS or len(issues) != 1 or any(one not in own for one in (1, 2, 3, 4)):
            continue
        if InavWord.decode(page.word).raw["iod_nav_low"] != next(iter(issues)) & 3:
            continue
        key = tuple(own[one] for one in (1, 2, 3, 4))
        expected = made[key] = made.get(key) or parity_words(own)
        assert expected[kind] == page.word
        checked += 1
        if checked % 400 == 0 and all(own.get(one) == expected[one] for one in PARITY_WORDS):
            for kinds in combinations((1, 2, 3, 4, *PARITY_WORDS), 4):
                wanted = {one: own[one] & ~3 for one in (1, 2, 3, 4)}
                found = restored_words({one: own[one] for one in kinds})
                assert found is not None
                assert {one: word & ~3 for one, word in found.items()} == wanted
            restored += 1
    assert checked > 2500
    assert restored > 3


def test_ephemerides_status_time_and_almanac_are_made_again(pages: list[InavPage]) -> None:
    """From what the words mean and not only from their fields; spare bits are not compared."""
    words: dict[int, dict[int, int]] = defaultdict(dict)
    counts: Counter[str] = Counter()
    for page in pages:
        kind, own, time = word_type(page.word), words[page.svid], page.time
        own[kind] = page.word
        ephemeris = ephemeris_from_words(own, time) if kind == 5 else None
        made: dict[int, int] = {}
        if kind == 0:
            made = {0: time_word(time)}
        elif ephemeris is not None:
            ionosphere = BroadcastIonosphere.from_word(page.word)
            raw = InavWord.decode(page.word).raw
            status = {"e5b_health": raw["e5b_health"], "e5b_data_valid": not raw["e5b_data_invalid"]}
            made = {**ephemeris_words(ephemeris), 5: status_word(ephemeris, time, ionosphere, **status)}
        elif kind == 6:
            made = {6: UtcModel.from_word(page.word, time).word(time)}
        elif kind == 10 and (almanac := AlmanacSet.from_words(own, time)) is not None:
            made = {one: word for one, word in almanac.words().items() if one in ALMANAC_WORDS}
        for one, word in made.items():
            assert without_spare(one, word) == without_spare(one, own[one])
            counts[f"word {one}"] += 1
            counts[f"word {one}, spare bits too"] += word == own[one]
    assert all(counts[f"word {kind}"] > 800 for kind in range(11))
    assert all(counts[f"word {kind}, spare bits too"] > 0.8 * counts[f"word {kind}"] for kind in range(11))


@pytest.mark.judged(by="real recording", what="almanac", figure="positions within 6.0 km of the ephemerides")
def test_almanac_positions_are_those_of_the_ephemerides_to_kilometres(pages: list[InavPage]) -> None:
    words: dict[int, dict[int, int]] = defaultdict(dict)
    ephemerides: dict[int, Ephemeris] = {}
    errors_km = []
    for page in pages:
        kind, own = word_type(page.word), words[page.svid]
        own[kind] = page.word
        if kind == 5 and (ephemeris := ephemeris_from_words(own, page.time)) is not None:
            ephemerides[page.svid] = ephemeris
        if kind == 10 and (almanac := AlmanacSet.from_words(own, page.time)) is not None and page.svid % 5 == 0:
            for entry in almanac.entries:
                if entry.svid in ephemerides:
                    told, true = (
                        satellite_state(one, page.time, np.zeros(1)).position_m
                        for one in (entry.ephemeris(almanac.t0a), ephemerides[entry.svid])
                    )
                    errors_km.append(float(np.linalg.norm(told - true)) / 1e3)
    assert len(errors_km) > 100
    assert max(errors_km) < 6.0


@pytest.mark.judged(
    by="real recording",
    what="reduced clock and ephemeris data (word 16)",
    figure="range error below 10.0 m",
)
def test_reduced_ced_is_as_good_as_that_on_air(osnma_data: Path) -> None:
    """Position and range on the ground, 0 to 10 min after the reference time.

    What is on air moves an error of the axis into the clock, so its position is worse than ours and its range as good.
    """
    words: dict[int, dict[int, int]] = defaultdict(dict)
    errors: dict[str, list[float]] = defaultdict(list)
    elapsed = np.array([0.0, 300.0, 600.0])
    for number, page in enumerate(read_pages(osnma_data / "recorded_2025-12-12.sbf")):
        kind, own = word_type(page.word), words[page.svid]
        if not page.crc_ok or page.is_alert:
            continue
        own[kind] = page.word
        if kind != 16 or number % 7 or (ephemeris := ephemeris_from_words(own, page.time)) is None:
            continue
        start = reference_time(page.time)
        if abs(start - ephemeris.toe) > FIT_INTERVAL_S:
            continue
        true = satellite_state(replace(ephemeris, bgd_e1_e5b_s=0.0), start, elapsed)
        fitted = ReducedCed.from_ephemeris(ephemeris, page.time)
        assert fitted is not None
        for name, word in (("air", page.word), ("own", fitted.word)):
            told = satellite_state(ReducedCed.from_word(word).ephemeris(page.svid, page.time), start, elapsed)
            off = told.position_m - true.position_m
            radial = np.sum(off * true.position_m, axis=1) / np.linalg.norm(true.position_m, axis=1)
            errors[f"{name} position"].append(float(np.linalg.norm(off, axis=1).max()))
            errors[f"{name} range"].append(float(np.abs(radial - (told.clock_s - true.clock_s) * 299_792_458.0).max()))
    assert len(errors["air range"]) > 200
    assert max(errors["air position"]) < 200.0
    assert max(errors["own position"]) < 70.0
    assert max(errors["own range"]) < 10.0
    assert max(errors["air range"]) < 10.0
