from __future__ import annotations

import hashlib
import hmac

from hypothesis import given
from hypothesis import strategies as st

from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS, TAG_BITS, ChainParameters
from vestige.crypto.osnma.messages.mac_lookup import Slot
from vestige.crypto.osnma.messages.navigation_data import NavigationData
from vestige.crypto.osnma.messages.subframe import SatelliteSubframe
from vestige.crypto.osnma.messages.tags import Mack, Tag, macseq_ok, make_tag, parse_mack
from vestige.time import GalileoTime

TIME = GalileoTime(1251, 277_200)
GST_SF = bytes.fromhex("4e343ad0")
KEY = bytes(range(16))


def subframe(mack: bytes, header: int = 0x82) -> SatelliteSubframe:
    fields = tuple(bytes([header]) + mack[4 * k : 4 * k + 4] for k in range(15))
    return SatelliteSubframe(svid=9, time=TIME, osnma=fields, words=(0,) * 15)


@given(st.binary(min_size=60, max_size=60), st.sampled_from(sorted(KEY_BITS)), st.sampled_from(sorted(TAG_BITS)))
def test_fields_lie_one_behind_the_other(mack: bytes, key_size: int, tag_size: int) -> None:
    parameters = ChainParameters(key_size=key_size, tag_size=tag_size, alpha=bytes(6))
    parsed = parse_mack(subframe(mack), parameters)
    assert parsed is not None
    bits = "".join(f"{byte:08b}" for byte in mack)
    length = parameters.tag_bits
    position = 0
    for number, tag in enumerate(parsed.tags):
        assert tag.value == int(bits[position : position + length], 2)
        info = int(bits[position + length : position + length + 16], 2)
        if number == 0:
            assert (parsed.macseq, tag.cut_off) == (info >> 4, info & 15)
            assert (tag.svid, tag.adkd) == (9, 0)
        else:
            assert (tag.svid, tag.adkd, tag.cut_off) == (info >> 8, info >> 4 & 15, info & 15)
        assert tag.counter == number + 1
        position += length + 16
    assert position == parameters.key_start_bit


def test_a_subframe_with_a_lost_page_has_no_tags() -> None:
    whole = subframe(bytes(range(60)))
    lost = SatelliteSubframe(svid=9, time=TIME, osnma=(*whole.osnma[:3], None, *whole.osnma[4:]), words=whole.words)
    assert parse_mack(whole, ChainParameters(alpha=bytes(6))) is not None
    assert parse_mack(lost, ChainParameters(alpha=bytes(6))) is None


@given(st.integers(0, 2**549 - 1), st.integers(1, 36), st.integers(1, 6))
def test_tag_by_hand(bits: int, target: int, counter: int) -> None:
    parameters = ChainParameters(alpha=bytes(6))
    data = NavigationData(svid=target, iod_nav=1, bits=bits, n_bits=549, oldest_s=0)
    mack = Mack(svid=9, time=TIME, nma_status=2, macseq=0, tags=())
    tag = Tag(counter=counter, value=0, info=target << 8)
    text = "10" + f"{bits:0549b}" + "0" * 1
    message = bytes([9]) + GST_SF + bytes([counter]) + int(text, 2).to_bytes(69, "big")
    if counter > 1:
        message = bytes([target]) + message
    expected = hmac.new(KEY, message, hashlib.sha256).digest()[:5]
    assert make_tag(mack, tag, data, KEY, parameters) == int.from_bytes(expected, "big")


def test_macseq_covers_the_flexible_slots_only() -> None:
    parameters = ChainParameters(alpha=bytes(6))
    infos = (0x0900, 0x0B0F, 0x094F)
    digest = hmac.new(KEY, bytes([9]) + GST_SF + b"\x0b\x0f", hashlib.sha256).digest()
    macseq = int.from_bytes(digest[:2], "big") >> 4
    row = (Slot(0, own=True), Slot(None, own=False), Slot(4, own=True))

    def mack(macseq: int, infos: tuple[int, ...]) -> Mack:
        tags = tuple(Tag(counter=k + 1, value=0, info=info) for k, info in enumerate(infos))
        return Mack(svid=9, time=TIME, nma_status=2, macseq=macseq, tags=tags)

    assert macseq_ok(mack(macseq, infos), row, KEY, parameters)
    assert macseq_ok(mack(macseq, (0x0901, infos[1], 0)), row, KEY, parameters)
    assert not macseq_ok(mack(macseq, (infos[0], infos[1] ^ 0x100, infos[2])), row, KEY, parameters)
    assert not any(macseq_ok(mack(macseq ^ 1 << bit, infos), row, KEY, parameters) for bit in range(12))


def test_when_the_key_of_a_tag_comes() -> None:
    assert [Tag(counter=2, value=0, info=adkd << 4).key_delay_s for adkd in (0, 4, 12)] == [30, 30, 330]
    assert [Tag(counter=2, value=0, info=adkd << 4).supported for adkd in (0, 4, 12, 1, 15)] == [True] * 3 + [False] * 2
