from __future__ import annotations

from dataclasses import replace

import pytest

from simulated_chain import make_chain
from vestige.crypto.osnma.dsm_collector import DsmCollector
from vestige.crypto.osnma.messages.subframe import SatelliteSubframe
from vestige.errors import UnsupportedError
from vestige.time import GalileoTime

START = GalileoTime(1400, 0)
CHAIN = make_chain(b"dsm", START, 1)
MESSAGE = CHAIN.kroot.serialise()


def block(svid: int, number: int, message: bytes = MESSAGE, dsm_id: int = 7, at_s: int = 0) -> SatelliteSubframe:
    hkroot = bytes([0x82, dsm_id << 4 | number]) + message[13 * number : 13 * number + 13]
    fields = tuple(hkroot[k : k + 1] + b"mack" for k in range(15))
    return SatelliteSubframe(svid=svid, time=START + at_s, osnma=fields, words=(0,) * 15)


def test_blocks_of_all_satellites_make_one_message_once() -> None:
    collector = DsmCollector()
    found = [
        message for number in (3, 0, 7, 5, 2, 1, 6, 4, 0, 1) for message in collector.add(block(number + 1, number))
    ]
    assert [message.data for message in found] == [MESSAGE]
    assert found[0].is_root_key
    assert (found[0].dsm_id, found[0].header.value) == (7, 0x82)
    assert DsmCollector().progress() == "no block was received"
    assert collector.progress() == "DSM 7: 8 of 8 blocks"


def test_one_satellite_with_false_blocks_cannot_block_the_others() -> None:
    collector = DsmCollector()
    false = bytes([MESSAGE[0]]) + bytes(len(MESSAGE) - 1)
    found = []
    for number in range(8):
        found += collector.add(block(1, number, false))
        found += collector.add(block(2, number))
    assert MESSAGE in [message.data for message in found]


def test_a_new_message_under_the_same_number_does_not_mix_with_an_old_one() -> None:
    collector = DsmCollector()
    new = make_chain(b"new", START, 1).kroot.serialise()
    for number in range(4):
        assert collector.add(block(1, number)) == []
    found = [
        message for number in (4, 5, 6, 7, 0, 1, 2, 3) for message in collector.add(block(1, number, new, at_s=40_000))
    ]
    assert [message.data for message in found] == [new]


def test_an_incomplete_subframe_gives_nothing() -> None:
    whole = block(1, 0)
    lost = SatelliteSubframe(svid=1, time=START, osnma=(None, *whole.osnma[1:]), words=whole.words)
    assert DsmCollector().add(lost) == []


def test_a_block_that_ends_with_a_zero_page_counts_when_it_comes_again() -> None:
    """The page may hold nothing but padding; once only, OSNMA may have stopped before it."""
    message = MESSAGE[:12] + b"\0" + MESSAGE[13:]
    collector = DsmCollector()
    unsure = block(1, 0, message)
    for at_s in (0, 30):
        for number in range(8):
            subframe = replace(block(1, number, message), time=START + at_s)
            if number == 0:
                subframe = replace(subframe, osnma=(*unsure.osnma[:-1], bytes(5)))
                assert at_s or collector.add(replace(subframe, svid=2)) == []  # it may have stopped, too
            found = collector.add(subframe)
            assert (len(found) == 1) is (at_s == 30 and number == 0)
            assert all(one.data == message for one in found)


def test_reserved_length_is_named() -> None:
    with pytest.raises(UnsupportedError, match="NB"):
        DsmCollector().add(block(1, 0, bytes([0xF0]) + MESSAGE[1:]))
    with pytest.raises(UnsupportedError, match="DSM-PKR"):
        DsmCollector().add(block(1, 0, bytes([0x60]) + MESSAGE[1:], dsm_id=12))
