from __future__ import annotations

import pytest
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature
from hypothesis import given
from hypothesis import strategies as st

from vestige.crypto.keys.public_key import (
    ClaimedPublicKey,
    PublicKey,
    Trust,
    compressed_point,
    load_point,
    trusted_by_user,
)
from vestige.crypto.keys.signature_scheme import P256, P521, scheme_of_type
from vestige.errors import AuthenticationError, UnsupportedError

PRIVATE = ec.derive_private_key(0xACA5, ec.SECP256R1())
POINT = compressed_point(PRIVATE.public_key())
KEY = PublicKey(pkid=3, point=POINT, trust=Trust.USER)


def signature(message: bytes) -> bytes:
    r, s = decode_dss_signature(PRIVATE.sign(message, ec.ECDSA(hashes.SHA256())))
    return r.to_bytes(32, "big") + s.to_bytes(32, "big")


def test_point_round_trip() -> None:
    assert load_point(POINT).public_numbers() == PRIVATE.public_key().public_numbers()


def test_signature_verifies_and_no_changed_bit_does() -> None:
    message, good = b"message", signature(b"message")
    KEY.verify(message, good)
    for bit in range(8 * len(good)):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        with pytest.raises(AuthenticationError, match="does not verify with public key PKID 3"):
            KEY.verify(message, bytes(bad))


@given(st.binary(max_size=80))
def test_garbage_is_no_signature(garbage: bytes) -> None:
    with pytest.raises(AuthenticationError):
        KEY.verify(b"message", garbage)


@given(st.binary(max_size=70))
def test_garbage_is_no_point_or_one_on_the_curve(garbage: bytes) -> None:
    try:
        key = load_point(garbage)
    except AuthenticationError:
        return
    assert key.curve.name == {33: "secp256r1", 67: "secp521r1"}[len(garbage)]


def test_trusted_by_user_says_so() -> None:
    key = trusted_by_user(ClaimedPublicKey(pkid=None, leaf=None, point=POINT))
    assert key.trust is Trust.USER
    assert "not checked against a Merkle tree" in str(key)
    with pytest.raises(AuthenticationError, match="not a point"):
        trusted_by_user(ClaimedPublicKey(pkid=1, leaf=0, point=bytes(33)))


# Key and signature of RFC 6979 (T. Pornin, 2013), A.2.7: the message "sample" under P-521 with SHA-512.
RFC_X = (
    "01894550D0785932E00EAA23B694F213F8C3121F86DC97A04E5A7167DB4E5BCD37"
    "1123D46E45DB6B5D5370A7F20FB633155D38FFA16D2BD761DCAC474B9A2F5023A4"
)
RFC_Y_IS_ODD = True  # 0493101C96…FDCF5
RFC_R = (
    "00C328FAFCBD79DD77850370C46325D987CB525569FB63C5D3BC53950E6D4C5F17"
    "4E25A1EE9017B5D450606ADD152B534931D7D4E8455CC91F9B15BF05EC36E377FA"
)
RFC_S = (
    "00617CCE7CF5064806C467F678D3B4080D6F1CC50AF26CA209417308281B68AF28"
    "2623EAA63E5B5C0723D8B8C37FF0777B1A20F8CCB1DCCC43997F1EE0E44DA4A67A"
)
RFC_KEY = PublicKey(pkid=9, point=bytes([2 + RFC_Y_IS_ODD]) + bytes.fromhex(RFC_X), trust=Trust.USER)
RFC_SIGNATURE = bytes.fromhex(RFC_R + RFC_S)


def test_a_p521_signature_verifies_and_no_changed_byte_does() -> None:
    RFC_KEY.verify(b"sample", RFC_SIGNATURE)
    assert compressed_point(load_point(RFC_KEY.point)) == RFC_KEY.point
    for place in range(0, len(RFC_SIGNATURE), 6):
        bad = bytearray(RFC_SIGNATURE)
        bad[place] ^= 1
        with pytest.raises(AuthenticationError, match="does not verify with public key PKID 9"):
            RFC_KEY.verify(b"sample", bytes(bad))


def test_a_signature_of_the_other_scheme_is_none() -> None:
    with pytest.raises(AuthenticationError, match=r"64 bytes.*132.*P-521"):
        RFC_KEY.verify(b"sample", signature(b"sample"))
    with pytest.raises(AuthenticationError, match=r"132 bytes.*64.*P-256"):
        KEY.verify(b"sample", RFC_SIGNATURE)


@pytest.mark.parametrize(("kind", "words"), [(4, "alert"), (0, "reserved"), (2, "reserved")])
def test_other_kinds_of_keys_are_left_out_with_a_reason(kind: int, words: str) -> None:
    assert (scheme_of_type(1), scheme_of_type(3)) == (P256, P521)
    with pytest.raises(UnsupportedError, match=words):
        scheme_of_type(kind)
