from __future__ import annotations

import numpy as np
import pytest

from vestige.navigation.inav.coding.channel_coding import page_symbols
from vestige.navigation.inav.page import encode_page
from vestige.sample_processor.tracking.page_sync import PageSync, ReceivedPage


def _pages(n: int, seed: int = 1) -> list[bytes]:
    rng = np.random.default_rng(seed)
    return [encode_page(int.from_bytes(rng.bytes(16), "big"), osnma=rng.bytes(5)) for _ in range(n)]


def _prompts(pages: list[bytes]) -> np.ndarray:
    return np.concatenate([1.0 - 2.0 * page_symbols(page) for page in pages]).astype(complex)


def _take(sync: PageSync, first: int, prompts: np.ndarray, cuts: list[int]) -> list[ReceivedPage]:
    found = []
    for begin, end in zip([0, *cuts], [*cuts, prompts.size], strict=True):
        found += sync.take(np.arange(first + begin, first + end), prompts[begin:end])
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("cuts", [[], [1], [499, 500, 501], list(range(0, 1500, 37))])
def test_finds_pages_however_the_symbols_are_cut(sign: float, cuts: list[int]) -> None:
    """Tracking begins 137 symbols into a page; the number of its periods is 13 beyond a secondary code."""
    pages = _pages(4)
    prompts = sign * _prompts(pages)[137:]
    first = 13 + 25 * 4  # page 1 begins with symbol 500 − 137 = 363, period 476 − 1 = 475: 25 divides it
    first = 475 - 363 + 25
    found = _take(PageSync(svid=5), first, prompts, cuts)
    assert [page.data for page in found] == pages[1:]
    assert [page.period for page in found] == [500, 1000, 1500]


def test_a_page_that_is_damaged_is_left_out_and_the_next_one_is_found() -> None:
    pages = _pages(4)
    prompts = _prompts(pages)
    prompts[520:700] = 0.0
    found = _take(PageSync(svid=5), 0, prompts, [])
    assert [page.period for page in found] == [0, 1000, 1500]


def test_a_gap_begins_anew() -> None:
    pages = _pages(4)
    prompts = _prompts(pages)
    sync = PageSync(svid=5)
    found = sync.take(np.arange(0, 700), prompts[:700])
    found += sync.take(np.arange(775, 2000), prompts[775:])
    assert [page.period for page in found] == [0, 1000, 1500]


def test_noise_is_no_page() -> None:
    rng = np.random.default_rng(2)
    sync = PageSync(svid=5)
    assert sync.take(np.arange(20_000), rng.normal(size=20_000) + 0j) == []


def test_half_page_in_the_wrong_order_is_no_page() -> None:
    """An odd half and the even half of the next page pass no checksum: the page does not begin there."""
    prompts = _prompts(_pages(3))[250:]
    found = _take(PageSync(svid=5), 0, prompts, [])
    assert [page.period for page in found] == [250, 750]
