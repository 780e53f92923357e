from __future__ import annotations

import pytest

from osnma_builder import WORD_ORDER, make_word, tag_data
from vestige.crypto.osnma.messages.navigation_data import NavigationWords
from vestige.crypto.osnma.messages.subframe import SatelliteSubframe
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_770)  # the next subframe is in the next week


def received(index: int, issue: int = 5, lost: tuple[int, ...] = (), svid: int = 4) -> SatelliteSubframe:
    time = START + 30 * index
    words = [make_word(kind, svid, time + (1 + 2 * k), issue) for k, kind in enumerate(WORD_ORDER)]
    kept = tuple(None if WORD_ORDER[k] in lost else word for k, word in enumerate(words))
    return SatelliteSubframe(svid=svid, time=time, osnma=(None,) * 15, words=kept)


@pytest.mark.parametrize(("adkd", "n_bits"), [(0, 549), (12, 549), (4, 141)])
def test_the_bits_are_those_of_the_words(adkd: int, n_bits: int) -> None:
    data = NavigationWords().updated(received(0)).data(4, adkd, START + 30)
    assert data is not None
    assert data.n_bits == n_bits
    assert f"{data.bits:0{n_bits}b}" == tag_data(4, adkd, 5, START)
    assert data.iod_nav == (None if adkd == 4 else 5)


def test_a_lost_word_is_taken_from_before() -> None:
    words = NavigationWords().updated(received(0)).updated(received(1, lost=(3,)))
    data = words.data(4, 0, START + 60)
    assert data is not None
    assert data.oldest_s == (START + (1 + 2 * WORD_ORDER.index(3))).gst_seconds


def test_without_a_word_or_with_two_issues_there_is_no_data() -> None:
    assert NavigationWords().data(4, 0, START + 30) is None
    assert NavigationWords().updated(received(0, lost=(5,))).data(4, 0, START + 30) is None
    mixed = NavigationWords().updated(received(0, issue=5)).updated(received(1, issue=6, lost=(2,)))
    assert mixed.data(4, 0, START + 60) is None
    assert mixed.data(4, 4, START + 60) is not None


def test_a_satellite_that_was_not_received_in_the_subframe_before_has_no_data() -> None:
    words = NavigationWords().updated(received(0))
    assert words.data(4, 0, START + 30) is not None
    assert words.data(4, 0, START + 60) is None
