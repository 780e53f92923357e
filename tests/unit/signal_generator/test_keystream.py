from __future__ import annotations

import hashlib

import numpy as np
import pytest
from cryptography.hazmat.primitives.ciphers import Cipher
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.ciphers.modes import ECB
from hypothesis import given
from hypothesis import strategies as st

from builders import START
from simulated_chain import make_chain
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.recs_segment import decrypt, encrypt
from vestige.signal_generator.keystream import encrypted_chips, encrypted_component, encryption_key
from vestige.signals.definitions import E6C
from vestige.time import GalileoTime

KEY = encryption_key(1)
RATE = 5_115_000


def at_chip(n: int) -> GalileoTime:
    return GalileoTime(START.week, START.second + n // RATE, n % RATE / RATE)


def test_a_chip_is_a_bit_of_the_encrypted_counter() -> None:
    """Block by block: AES-256 of the 128-bit number of the block."""
    first = (1372 * 604_800 + 480_136) * RATE
    satellite_key = hashlib.sha256(b"vestige E6-C" + bytes([11]) + KEY).digest()
    block = Cipher(AES(satellite_key), ECB()).encryptor()  # noqa: S305  (one block a time)
    blocks = range(first // 128, first // 128 + 5)
    bits = "".join(f"{int.from_bytes(block.update(n.to_bytes(16, 'big')), 'big'):0128b}" for n in blocks)
    expected = [1 - 2 * int(bit) for bit in bits[first % 128 :]][:400]
    assert encrypted_chips(KEY, 11, START, 400).chips.tolist() == expected


@given(first=st.integers(0, 3 * RATE), skip=st.integers(0, 2000), n=st.integers(0, 2000))
def test_random_access(first: int, skip: int, n: int) -> None:
    whole = encrypted_chips(KEY, 5, at_chip(first), 4000).chips
    part = encrypted_chips(KEY, 5, at_chip(first + skip), n)
    assert np.array_equal(part.chips, whole[skip : skip + n])
    assert part.chips.dtype == np.int8
    assert (part.svid, part.chip_rate_hz, part.transmit_time) == (5, E6C.chip_rate_hz, at_chip(first + skip))


def test_satellites_seeds_and_times_are_strangers() -> None:
    """Correlation over 81 840 chips is below 5 standard deviations, and each sequence is balanced."""
    n = 81_840
    others = [
        encrypted_chips(KEY, 2, START, n),
        encrypted_chips(encryption_key(2), 1, START, n),
        encrypted_chips(KEY, 1, START + 0.016, n),
        encrypted_chips(KEY, 1, START + 30, n),
    ]
    own = encrypted_chips(KEY, 1, START, n).chips.astype(int)
    assert abs(own.sum()) < 5 * np.sqrt(n)
    for other in others:
        assert abs(np.sum(own * other.chips)) < 5 * np.sqrt(n)
    for lag in range(1, 200):
        assert abs(np.sum(own[lag:] * own[:-lag])) < 5 * np.sqrt(n)


def test_not_the_start_of_a_chip() -> None:
    with pytest.raises(ValueError, match=r"0\.51. chips after"):
        encrypted_chips(KEY, 1, START + 1e-7, 10)


def test_the_waveform_sends_the_same_chips() -> None:
    component = encrypted_component(KEY, 9, START)
    chips = encrypted_chips(KEY, 9, START + 0.1, 3000).chips
    index = 511_500 + np.arange(3000)
    assert np.array_equal(component.modulation((index + 0.5) / RATE), -chips)  # E6-C is subtracted
    order = np.random.default_rng(1).permutation(3000)
    assert np.array_equal(component.chip(index[order]), chips[order])
    assert component.chip(np.empty(0, np.int64)).size == 0
    before = encrypted_chips(KEY, 9, START + -1, RATE).chips[-100:]
    assert np.array_equal(component.chip(np.arange(-100, 0)), before)
    t = (index + 0.5) / RATE
    x = component.received(t + 0.07, np.full(3000, 0.07 * SPEED_OF_LIGHT_MPS), E6C.carrier_hz)
    assert np.array_equal(np.sign((x * x[0].conj()).real) * chips[0], chips)


def test_reference_is_a_whole_second() -> None:
    with pytest.raises(ValueError, match="whole second"):
        encrypted_component(KEY, 9, START + 0.5)


def test_a_recs_brings_the_chips_to_the_receiver() -> None:
    chain = make_chain(b"seed", START, 2)
    chips = encrypted_chips(KEY, 11, START + 2.3, 81_840)
    key = next(key for key in chain.validated_keys() if key.time == START.subframe)
    assert np.array_equal(decrypt(encrypt(chips, key.data), key).chips, chips.chips)
