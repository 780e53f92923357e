from __future__ import annotations

import hashlib
import hmac

import pytest
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.cmac import CMAC

from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS, TAG_BITS, ChainParameters
from vestige.errors import UnsupportedError

ALPHA = bytes.fromhex("a06221261ad9")


def test_operational_layout() -> None:
    parameters = ChainParameters(alpha=ALPHA)
    assert (parameters.key_bits, parameters.tag_bits, parameters.n_tags) == (128, 40, 6)
    assert parameters.key_start_bit == 336
    assert parameters.disclosure_start_s == 22
    assert parameters.disclosure_end_s == 31


@pytest.mark.parametrize("key_size", KEY_BITS)
@pytest.mark.parametrize("tag_size", TAG_BITS)
def test_as_many_tags_as_fit(key_size: int, tag_size: int) -> None:
    parameters = ChainParameters(key_size=key_size, tag_size=tag_size, alpha=ALPHA)
    free = 480 - parameters.key_start_bit - parameters.key_bits
    assert 0 <= free < parameters.tag_bits + 16
    assert parameters.disclosure_start_s < parameters.disclosure_end_s <= 31
    assert parameters.disclosure_end_s % 2 == 1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("hash_function", 1),
        ("hash_function", 3),
        ("mac_function", 2),
        ("mac_function", 3),
        ("key_size", 9),
        ("tag_size", 4),
    ],
)
def test_reserved_codes_are_named(name: str, value: int) -> None:
    with pytest.raises(UnsupportedError, match=f"is {value}"):
        ChainParameters(alpha=ALPHA, **{name: value})


def test_cmac_needs_an_aes_key() -> None:
    with pytest.raises(UnsupportedError, match="96 bits"):
        ChainParameters(mac_function=1, key_size=0, alpha=ALPHA)


def test_functions_are_the_named_ones() -> None:
    plain = ChainParameters(alpha=ALPHA)
    other = ChainParameters(hash_function=2, mac_function=1, alpha=ALPHA)
    assert plain.new_hash(b"m").digest() == hashlib.sha256(b"m").digest()
    assert other.new_hash(b"m").digest() == hashlib.sha3_256(b"m").digest()
    key = bytes(range(16))
    assert plain.mac(key, b"m", 40) == int.from_bytes(hmac.new(key, b"m", hashlib.sha256).digest()[:5], "big")
    cmac = CMAC(AES(key))
    cmac.update(b"m")
    assert other.mac(key, b"m", 20) == int.from_bytes(cmac.finalize()[:3], "big") >> 4


def test_alpha_has_six_bytes() -> None:
    with pytest.raises(ValueError, match="alpha"):
        ChainParameters(alpha=b"")
