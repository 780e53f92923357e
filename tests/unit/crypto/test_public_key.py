from __future__ import annotations

import pytest
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature
from hypothesis import given
from hypothesis import strategies as st

from vestige.crypto.public_key import (
    ClaimedPublicKey,
    PublicKey,
    Trust,
    compressed_point,
    load_point,
    require_p256,
    trusted_by_user,
)
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


@given(st.binary(max_size=40))
def test_garbage_is_no_point_or_one_on_the_curve(garbage: bytes) -> None:
    try:
        key = load_point(garbage)
    except AuthenticationError:
        return
    assert key.curve.name == "secp256r1"


def test_trusted_by_user_says_so() -> None:
    key = trusted_by_user(ClaimedPublicKey(pkid=None, leaf=None, point=POINT))
    assert key.trust is Trust.USER
    assert "not checked against a Merkle tree" in str(key)
    with pytest.raises(AuthenticationError, match="not a point"):
        trusted_by_user(ClaimedPublicKey(pkid=1, leaf=0, point=bytes(33)))


@pytest.mark.parametrize(("kind", "words"), [(3, "P-521"), (4, "alert"), (0, "reserved")])
def test_other_kinds_of_keys_are_left_out_with_a_reason(kind: int, words: str) -> None:
    require_p256(1)
    with pytest.raises(UnsupportedError, match=words):
        require_p256(kind)
