from __future__ import annotations

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS, TAG_BITS, ChainParameters
from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader, kroot_blocks, parse_kroot
from vestige.errors import AuthenticationError, UnsupportedError, VestigeError
from vestige.time import GalileoTime

# Broadcast on 2025-12-12: PKID 2, MACLT 34, week 1372, hour 133.
HEAD = bytes.fromhex("22104922055c851d2f2bc51851ec7649a34f6d811393b8a3423648742e")


@st.composite
def kroots(draw: st.DrawFn) -> DsmKroot:
    parameters = ChainParameters(
        hash_function=draw(st.sampled_from([0, 2])),
        key_size=draw(st.sampled_from(sorted(KEY_BITS))),
        tag_size=draw(st.sampled_from(sorted(TAG_BITS))),
        mac_lookup=draw(st.integers(0, 255)),
        alpha=draw(st.binary(min_size=6, max_size=6)),
    )
    signature_bytes = draw(st.sampled_from([64, 132]))
    used = 13 + parameters.key_bytes + signature_bytes
    n_blocks = max(7, -(-used // 13))
    return DsmKroot(
        n_blocks=n_blocks,
        public_key_id=draw(st.integers(0, 15)),
        chain_id=draw(st.integers(0, 3)),
        parameters=parameters,
        root_week=draw(st.integers(0, 4095)),
        root_hour=draw(st.integers(0, 167)),
        root_key=draw(st.binary(min_size=parameters.key_bytes, max_size=parameters.key_bytes)),
        signature=draw(st.binary(min_size=signature_bytes, max_size=signature_bytes)),
        padding=bytes(13 * n_blocks - used),
        reserved=(draw(st.integers(0, 3)), draw(st.integers(0, 15))),
    )


@given(kroots())
def test_serialise_and_parse_are_inverse(kroot: DsmKroot) -> None:
    data = kroot.serialise()
    assert len(data) == 13 * kroot.n_blocks
    assert parse_kroot(data) == kroot
    assert kroot.signed_message(NmaHeader(0x82)) == b"\x82" + data[1 : 13 + kroot.parameters.key_bytes]


@pytest.mark.parametrize(
    ("key_size", "n_blocks", "signature_bytes"),  # l_DK = 104 ⌈1 + (l_K + l_DS)/104⌉ [OSNMA-ICD, DSM-KROOT]
    [(0, 7, 64), (4, 8, 64), (8, 9, 64), (0, 13, 132), (4, 13, 132), (8, 14, 132)],
)
def test_the_number_of_blocks_says_how_long_the_signature_is(
    key_size: int, n_blocks: int, signature_bytes: int
) -> None:
    message = bytearray(13 * n_blocks)
    message[0], message[2] = (n_blocks - 6) << 4, key_size << 4 | 5
    kroot = parse_kroot(bytes(message))
    assert len(kroot.signature) == signature_bytes
    assert len(kroot.padding) < 13


def test_fields_of_a_broadcast_message() -> None:
    kroot = parse_kroot(HEAD + bytes(104 - len(HEAD)))
    assert (kroot.n_blocks, kroot.public_key_id, kroot.chain_id, kroot.reserved) == (8, 2, 0, (1, 0))
    parameters = kroot.parameters
    assert (parameters.key_size, parameters.tag_size, parameters.mac_lookup) == (4, 9, 34)
    assert parameters.alpha.hex() == "1d2f2bc51851"
    assert (kroot.root_week, kroot.root_hour) == (1372, 133)
    assert kroot.root_key.hex() == "ec7649a34f6d811393b8a3423648742e"
    assert kroot.root_time(near=GalileoTime(1372, 480_120)) == GalileoTime(1372, 478_770)


@given(kroots())
def test_padding_is_the_hash_of_message_and_signature(kroot: DsmKroot) -> None:
    header = NmaHeader(0x72)
    digest = hashlib.sha256(kroot.signed_message(header) + kroot.signature).digest()
    assert kroot.expected_padding(header) == digest[: len(kroot.padding)]


@pytest.mark.parametrize(
    ("near", "expected"),
    [
        (GalileoTime(4095, 604_000), GalileoTime(4095, 604_770)),  # hour 0 of week 4096, 30 s before
        (GalileoTime(4096, 100), GalileoTime(4095, 604_770)),
        (GalileoTime(8191, 0), GalileoTime(8191, 604_770)),
    ],
)
def test_root_time_across_the_roll_over_of_weeks(near: GalileoTime, expected: GalileoTime) -> None:
    data = bytearray(HEAD + bytes(104 - len(HEAD)))
    data[4:7] = bytes([0x00, 0x00, 0x00])  # reserved, week 0, hour 0
    kroot = parse_kroot(bytes(data))
    assert (kroot.root_week, kroot.root_hour) == (0, 0)
    assert kroot.root_time(near) == expected


@given(st.binary(max_size=200))
def test_garbage_gives_one_of_our_errors_or_a_message(data: bytes) -> None:
    try:
        kroot = parse_kroot(data)
    except VestigeError:
        return
    assert kroot.serialise() == data


@pytest.mark.parametrize("code", [0, 9, 15])
def test_reserved_number_of_blocks(code: int) -> None:
    with pytest.raises(UnsupportedError, match=rf"NB \(number of blocks\) is {code}"):
        kroot_blocks(code << 4)


def test_too_short_for_its_key_and_an_hour_that_is_none() -> None:
    long_key = bytearray(91)
    long_key[:4] = bytes([1 << 4, 0, 0x89, 33])  # 7 blocks, 256-bit key
    with pytest.raises(AuthenticationError, match="too short"):
        parse_kroot(bytes(long_key))
    bad_hour = bytearray(HEAD + bytes(104 - len(HEAD)))
    bad_hour[6] = 168
    with pytest.raises(AuthenticationError, match="TOWH is 168"):
        parse_kroot(bytes(bad_hour))


def test_nma_header() -> None:
    header = NmaHeader(0x72)
    assert (header.status, header.chain_id, header.key_status) == (1, 3, 1)
    assert str(header) == "0x72 (test, chain 3, keys: nominal)"
