from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from osnma_builder import make_page
from vestige.crypto.osnma.messages.subframe import Content, Epoch, PageStatus, SatelliteSubframe, SubframeAssembler
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

START = GalileoTime(1300, 604_770)  # the last subframe of a week: the next one is in another week


def pages(svids: tuple[int, ...] = (1, 2), n_subframes: int = 3, osnma: bytes = b"\x82abcd") -> list[InavPage]:
    return [
        make_page(svid, START + (1 + 2 * k), k << 64 | svid, osnma)
        for k in range(15 * n_subframes)
        for svid in svids
    ]  # fmt: skip


def assemble(given_pages: list[InavPage]) -> tuple[list[PageStatus], list[Epoch]]:
    assembler = SubframeAssembler()
    statuses, epochs = [], []
    for page in given_pages:
        status, closed = assembler.add(page)
        statuses.append(status)
        epochs += closed
    return statuses, epochs + assembler.flush()


def test_pages_become_subframes_across_the_end_of_the_week() -> None:
    statuses, epochs = assemble(pages())
    assert set(statuses) == {PageStatus.TAKEN}
    assert [epoch.time for epoch in epochs] == [START, GalileoTime(1301, 0), GalileoTime(1301, 30)]
    for epoch in epochs:
        assert sorted(epoch.satellites) == [1, 2]
        assert all(subframe.content is Content.OSNMA for subframe in epoch.satellites.values())


@settings(max_examples=25)
@given(st.randoms(use_true_random=False))
def test_order_of_satellites_and_small_delays_do_not_matter(rng: random.Random) -> None:
    in_order = pages()
    shuffled = sorted(in_order, key=lambda page: page.time.gst_seconds + rng.random() * 9)
    assert assemble(shuffled)[1] == assemble(in_order)[1]


def test_lost_duplicate_contradicting_late_and_misplaced_pages() -> None:
    given_pages = pages(svids=(1,), n_subframes=3)
    lost = given_pages.pop(4)
    other = make_page(1, given_pages[0].time, 99, bytes(5))
    off_grid = make_page(1, given_pages[0].time + 1, 99, bytes(5))
    statuses, epochs = assemble([given_pages[0], given_pages[0], other, off_grid, *given_pages[1:], lost])
    assert statuses[1:4] == [PageStatus.DUPLICATE, PageStatus.CONTRADICTION, PageStatus.OFF_GRID]
    assert statuses[-1] is PageStatus.LATE
    first = epochs[0].satellites[1]
    assert first.content is Content.INCOMPLETE
    assert (first.n_missing, first.hkroot) == (1, None)
    assert first.words[0] == given_pages[0].word


def test_a_recording_that_starts_again_earlier_is_read_again() -> None:
    assembler = SubframeAssembler()
    late = [make_page(3, START + (86_401 + 2 * k), 1, b"\x82abcd") for k in range(15)]
    early = [make_page(3, START + (1 + 2 * k), 1, b"\x82abcd") for k in range(15)]
    closed = [epoch for page in (*late, *early) for epoch in assembler.add(page)[1]] + assembler.flush()
    assert [epoch.time for epoch in closed] == [START + 86_400, START]
    assert all(epoch.satellites[3].content is Content.OSNMA for epoch in closed)


def test_dummy_pages_carry_no_osnma() -> None:
    dummies = [make_page(3, START + (1 + 2 * k), 63 << 122, b"\x4f\x84\xdc\xbb\x13") for k in range(15)]
    subframe = assemble(dummies)[1][0].satellites[3]
    assert subframe.content is Content.FILLER
    assert (subframe.n_missing, subframe.nma_header, subframe.hkroot) == (0, None, None)


def test_zero_fields_are_no_osnma() -> None:
    subframe = assemble(pages(osnma=bytes(5)))[1][0].satellites[1]
    assert subframe.content is Content.NONE
    assert subframe.nma_header is None


@given(st.lists(st.binary(min_size=5, max_size=5), min_size=15, max_size=15), st.integers(0, 479), st.data())
def test_mack_bits_are_those_of_the_joined_message(fields: list[bytes], start: int, data: st.DataObject) -> None:
    length = data.draw(st.integers(1, 480 - start))
    lost = data.draw(st.sets(st.integers(0, 14))) | {k for k, field in enumerate(fields) if not any(field)}
    osnma = tuple(None if k in lost else field for k, field in enumerate(fields))
    subframe = SatelliteSubframe(svid=1, time=START, osnma=osnma, words=(0,) * 15)
    joined = "".join(f"{byte:08b}" for field in fields for byte in field[1:])
    touched = {bit // 32 for bit in range(start, start + length)}
    expected = None if touched & lost else int(joined[start : start + length], 2)
    assert subframe.mack_bits(start, length) == expected


def test_hkroot_is_the_first_byte_of_every_field() -> None:
    fields = tuple(bytes([k, 0, 0, 0, 1]) for k in range(15))
    subframe = SatelliteSubframe(svid=1, time=START, osnma=fields, words=(0,) * 15)
    assert subframe.hkroot == bytes(range(15))


@pytest.mark.parametrize("offset", [0, 2, 1.5])
def test_pages_start_at_odd_seconds(offset: float) -> None:
    page = make_page(1, START + offset, 0, bytes(5))
    assert SubframeAssembler().add(page) == (PageStatus.OFF_GRID, [])
