from __future__ import annotations

import hashlib

import pytest
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature
from hypothesis import given, settings
from hypothesis import strategies as st

from simulated_chain import make_chain
from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS, TAG_BITS, ChainParameters
from vestige.crypto.osnma.messages.dsm import parse_kroot
from vestige.time import GalileoTime


def test_same_seed_same_chain() -> None:
    first, second = (make_chain(b"seed", GalileoTime(1400, 3000), 5) for _ in range(2))
    assert first.keys == second.keys
    assert first.kroot == second.kroot
    assert first.tree == second.tree
    assert make_chain(b"sees", GalileoTime(1400, 3000), 5).keys != first.keys


@settings(max_examples=25)
@given(
    st.integers(1, 5000),
    st.integers(0, 604_799),
    st.integers(1, 30),
    st.sampled_from(sorted(KEY_BITS)),
    st.sampled_from(sorted(TAG_BITS)),
    st.sampled_from([0, 2]),
)
def test_everything_about_a_chain_by_hand(
    week: int, second: int, n_keys: int, key_size: int, tag_size: int, function: int
) -> None:
    parameters = ChainParameters(hash_function=function, key_size=key_size, tag_size=tag_size, alpha=b"patern")
    chain = make_chain(b"law", GalileoTime(week, second), n_keys, chain_id=1, parameters=parameters)
    digest = hashlib.sha256 if function == 0 else hashlib.sha3_256

    # The keys hash down to the root key of 30 s before the hour.
    assert len(chain.keys) == n_keys
    assert chain.keys[0].time == GalileoTime(week, second).subframe
    key, time = chain.keys[-1].data, chain.keys[-1].time.gst_seconds
    steps = 0
    hour = chain.keys[0].time.gst_seconds // 3600 * 3600
    while time > hour - 30:
        time -= 30
        bits = ((time // 604_800) % 4096 << 20 | time % 604_800).to_bytes(4, "big")
        key = digest(key + bits + b"patern").digest()[: KEY_BITS[key_size] // 8]
        steps += 1
    assert key == chain.kroot.root_key
    assert n_keys <= steps <= n_keys + 120

    # The DSM-KROOT is signed and padded, and reads back.
    data = chain.kroot.serialise()
    assert parse_kroot(data) == chain.kroot
    end = 13 + len(key)
    message, signature = bytes([chain.header.value]) + data[1:end], data[end : end + 64]
    r, s = int.from_bytes(signature[:32], "big"), int.from_bytes(signature[32:], "big")
    chain.private_key.public_key().verify(encode_dss_signature(r, s), message, ec.ECDSA(hashes.SHA256()))
    assert hashlib.sha256(message + signature).digest().startswith(data[end + 64 :])
    assert len(chain.validated_keys()) == n_keys


def test_root_of_a_chain_that_starts_with_the_week() -> None:
    chain = make_chain(b"week", GalileoTime(1400, 0), 2)
    assert chain.root.time == GalileoTime(1399, 604_770)
    assert (chain.kroot.root_week, chain.kroot.root_hour) == (1400, 0)


def test_a_chain_has_keys() -> None:
    with pytest.raises(ValueError, match="at least one key"):
        make_chain(b"", GalileoTime(1400, 0), 0)
