"""The message of a sky: a page has the same bits in every message that contains it, and few pages are kept."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from vestige.broadcast import osnma_fields
from vestige.broadcast.sky_message import SkyMessage, make_sky_message
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.crypto.osnma.operator.tag_plan import MAX_CUT_OFF, SUBFRAMES_REMEMBERED
from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.coding.channel_coding import page_symbols
from vestige.time import GalileoTime

START = GalileoTime(1400, 7200 + 330)  # issues of ephemerides change in subframes 9, 29 and 49
N = 60
SVIDS = (7, 11, 13)


def orbit(svid: int) -> Ephemeris:
    return Ephemeris(
        svid=svid, iod_nav=9, toe=START, toc=START, sqrt_a=5440.6, eccentricity=0.0, m0_rad=0.3 * svid,
        delta_n_radps=0.0, omega0_rad=0.5, omega_dot_radps=0.0, i0_rad=0.98, i_dot_radps=0.0, omega_rad=0.0,
    )  # fmt: skip


def message(first: int | None = None, n_subframes: int = N) -> SkyMessage:
    """Return the message from subframe `first` on, of an operator that broadcasts N subframes."""
    operator = OsnmaOperator(OperatorConfiguration(seed=b"sky", start=START, n_subframes=N))
    return make_sky_message(
        [orbit(svid) for svid in SVIDS],
        operator,
        START + (30.0 * ((first or 0) + n_subframes) - 1.0),
        first=None if first is None else START + 30.0 * first,
        almanac=[orbit(svid) for svid in range(1, 8)],
    )


@pytest.fixture(scope="module")
def whole() -> dict[int, list[bytes]]:
    """Data of all pages, made in the order of time."""
    return {svid: [page.data for page in pages] for svid, pages in message().pages.items()}


def test_pages_follow_each_other(whole: dict[int, list[bytes]]) -> None:
    for svid, pages in message(n_subframes=2).pages.items():
        assert [page.data for page in pages] == whole[svid][:30]
        assert pages[0].time == START + 1.0
        assert all(two.time - one.time == 2.0 for one, two in pairwise(pages))


@pytest.mark.parametrize("first", [1, 9, 17, SUBFRAMES_REMEMBERED, 29, 40, 56])
def test_the_pages_of_a_part_are_those_of_the_whole(whole: dict[int, list[bytes]], first: int) -> None:
    """Every tag and cut-off point, also where the words of the whole go back longer than those of the part."""
    part = message(first, 4)
    assert part.n_subframes == 4
    for svid, pages in part.pages.items():
        assert [page.data for page in pages] == whole[svid][15 * first : 15 * (first + 4)]


def test_shorter_words_than_remembered_give_other_pages(
    whole: dict[int, list[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The memory is not too long by much: cut-off points need 15 subframes of complete data."""
    monkeypatch.setattr(osnma_fields, "SUBFRAMES_REMEMBERED", MAX_CUT_OFF - 2)
    part = message(28, 1)
    assert any([page.data for page in pages] != whole[svid][420:435] for svid, pages in part.pages.items())


def test_symbols_are_those_of_the_pages_in_any_order(whole: dict[int, list[bytes]]) -> None:
    """Back, forth, and across pages; only a few pages and subframes are kept."""
    one = message()
    symbols = {svid: one.symbols(svid, START + 30.0) for svid in SVIDS}
    expected = {
        svid: 1 - 2 * np.concatenate([page_symbols(data) for data in pages]).astype(np.int8)
        for svid, pages in whole.items()
    }
    for subframe in (0, 50, 3, 31, 32, 0, 59):
        index = (30 * subframe - 29) * 250 + np.arange(-250 if subframe > 30 else 0, 1250)
        for svid in SVIDS:
            assert np.array_equal(symbols[svid](index), expected[svid][index + 29 * 250])
    fields = one.transmissions[7].osnma
    assert isinstance(fields, osnma_fields.OsnmaFields)
    assert len(fields._made) <= 8


def test_a_symbol_outside_the_message_is_refused() -> None:
    one = message(40, 2)
    symbol = one.symbols(7, START)
    first = (1200 + 1) * 250  # of subframe 40
    assert symbol(np.arange(first, first + 2 * 7500)).size == 15_000
    for outside in (first - 1, first + 2 * 7500):
        with pytest.raises(VestigeError, match=r"E07: found a symbol of .*expected one of the message, from"):
            symbol(np.array([outside]))


def test_a_message_is_not_longer_than_the_broadcast() -> None:
    late = message(N - 1, 3)
    with pytest.raises(VestigeError, match="the broadcast ends at"):
        late.pages  # noqa: B018  (the property makes the pages)
