from __future__ import annotations

import pytest

from simulated_chain import make_chain
from vestige.crypto.keys.public_key import PublicKey, Trust
from vestige.crypto.keys.signature_scheme import P521
from vestige.crypto.osnma.messages.dsm import NmaHeader, parse_kroot
from vestige.crypto.osnma.messages.root_key import verify_root_key
from vestige.errors import AuthenticationError, VestigeError
from vestige.time import GalileoTime

START = GalileoTime(1400, 7200)
CHAIN = make_chain(b"root", START, 1, pkid=2)
KEY = CHAIN.public_key
OTHER = make_chain(b"other", START, 1, pkid=2).public_key
MESSAGE = CHAIN.kroot.serialise()


def test_a_signed_root_key() -> None:
    root = verify_root_key(CHAIN.kroot, CHAIN.header, (KEY,), near=START)
    assert (root.time, root.data, root.public_key) == (GalileoTime(1400, 7170), CHAIN.kroot.root_key, KEY)


def test_no_bit_of_message_header_signature_or_padding_can_change() -> None:
    """All bits, the unsigned NB and PKID too: those lead to a message of another length or to another key."""
    for bit in range(8 * len(MESSAGE)):
        changed = bytearray(MESSAGE)
        changed[bit // 8] ^= 0x80 >> bit % 8
        with pytest.raises(VestigeError):
            verify_root_key(parse_kroot(bytes(changed)), CHAIN.header, (KEY,), near=START)
    for bit in range(8):
        with pytest.raises(AuthenticationError, match="the signature does not verify"):
            verify_root_key(CHAIN.kroot, NmaHeader(CHAIN.header.value ^ 1 << bit), (KEY,), near=START)


def test_padding_is_looked_at() -> None:
    changed = bytearray(MESSAGE)
    changed[-1] ^= 1
    with pytest.raises(AuthenticationError, match="the padding is"):
        verify_root_key(parse_kroot(bytes(changed)), CHAIN.header, (KEY,), near=START)


def test_several_keys_with_one_number() -> None:
    assert verify_root_key(CHAIN.kroot, CHAIN.header, (OTHER, KEY), near=START).public_key == KEY
    unnumbered = PublicKey(pkid=None, point=KEY.point, trust=Trust.USER)
    assert verify_root_key(CHAIN.kroot, CHAIN.header, (unnumbered,), near=START).public_key == unnumbered
    with pytest.raises(AuthenticationError):
        verify_root_key(CHAIN.kroot, CHAIN.header, (OTHER,), near=START)


def test_a_key_that_was_not_given_is_named() -> None:
    numbered = PublicKey(pkid=3, point=KEY.point, trust=Trust.USER)
    with pytest.raises(VestigeError, match="PKID 2, which was not given"):
        verify_root_key(CHAIN.kroot, CHAIN.header, (numbered,), near=START)


def test_a_root_key_that_is_signed_with_p521() -> None:
    chain = make_chain(b"long", START, 1, pkid=4, scheme=P521)
    kroot = parse_kroot(chain.kroot.serialise())
    assert (kroot.n_blocks, len(kroot.signature)) == (13, 132)  # 104 ⌈1 + (128 + 1056)/104⌉ bits
    root = verify_root_key(kroot, chain.header, (chain.public_key,), near=START)
    assert (root.time, root.data) == (GalileoTime(1400, 7170), chain.kroot.root_key)
    with pytest.raises(AuthenticationError, match="does not verify"):
        verify_root_key(kroot, NmaHeader(chain.header.value ^ 1), (chain.public_key,), near=START)
    short = PublicKey(pkid=4, point=KEY.point, trust=Trust.USER)
    with pytest.raises(AuthenticationError, match="132 bytes"):
        verify_root_key(kroot, chain.header, (short,), near=START)
