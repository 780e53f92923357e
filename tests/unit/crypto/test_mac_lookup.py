from __future__ import annotations

import pytest

from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS, TAG_BITS, ChainParameters
from vestige.crypto.osnma.messages.mac_lookup import MAC_LOOKUP, Slot, slots
from vestige.errors import UnsupportedError
from vestige.time import GalileoTime

FULL_MINUTE, HALF_MINUTE = GalileoTime(1251, 277200), GalileoTime(1251, 277230)


def code(slot: Slot) -> str:
    return "FLX" if slot.adkd is None else f"{slot.adkd:02d}{'S' if slot.own else 'E'}"


@pytest.mark.parametrize(
    ("number", "time", "expected"),
    [
        (33, FULL_MINUTE, "00S 00E 04S 00E 12S 00E"),
        (33, HALF_MINUTE, "00S 00E 00E 12S 00E 12E"),
        (34, FULL_MINUTE, "00S FLX 04S FLX 12S 00E"),
        (34, HALF_MINUTE, "00S FLX 00E 12S 00E 12E"),
    ],
)
def test_rows_in_use(number: int, time: GalileoTime, expected: str) -> None:
    row = slots(ChainParameters(mac_lookup=number, alpha=bytes(6)), time)
    assert " ".join(map(code, row)) == expected


@pytest.mark.parametrize("number", MAC_LOOKUP)
def test_every_row_is_consistent(number: int) -> None:
    first, second = MAC_LOOKUP[number]
    sizes = {ChainParameters(key_size=key, tag_size=tag, alpha=bytes(6)).n_tags for key in KEY_BITS for tag in TAG_BITS}
    assert len(first) == len(second)
    assert len(first) in sizes
    assert first[0] == second[0] == Slot(0, own=True)
    assert all(slot.own for slot in (*first, *second) if slot.adkd == 4)


def test_unknown_row_and_row_of_another_length() -> None:
    with pytest.raises(UnsupportedError, match="99 is not known"):
        slots(ChainParameters(mac_lookup=99, alpha=bytes(6)), FULL_MINUTE)
    with pytest.raises(UnsupportedError, match="has 5 tags, the MACK message 6"):
        slots(ChainParameters(mac_lookup=31, alpha=bytes(6)), FULL_MINUTE)


def test_what_a_slot_allows() -> None:
    own, cross, flexible = Slot(0, own=True), Slot(0, own=False), Slot(None, own=False)
    assert own.allows(adkd=0, own=True)
    assert not own.allows(adkd=0, own=False)
    assert cross.allows(adkd=0, own=False)
    assert not cross.allows(adkd=12, own=False)
    assert flexible.allows(adkd=12, own=False)
