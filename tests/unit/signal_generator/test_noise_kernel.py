from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vestige.signal_generator.noise_kernel import noise_key, normal_pairs

MASK = (1 << 64) - 1
GOLD = 0x9E3779B97F4A7C15


def mix(z: int) -> int:
    """The finaliser of splitmix64, in whole numbers."""
    z &= MASK
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & MASK
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & MASK
    return z ^ (z >> 31)


def plain_pairs(key: int, first: int, n: int) -> np.ndarray:
    """Logarithm, sine and cosine in float64, of the same numbers after their rounding to float32."""
    z = np.array([mix(key + i * GOLD) for i in range(first, first + n)], np.uint64)
    hi, lo = (z >> np.uint64(32)).astype(np.int64), (z & np.uint64(0xFFFFFFFF)).astype(np.int64)
    x = (np.float32(hi >> 1) + np.float32(0.5)).astype(np.float64)
    r = np.sqrt(-2 * np.log(x / 2.0**31))
    a = (np.float32((lo & 0x3FFFFFFF) - 2**29) * np.float32(2 * np.pi / 2**32)).astype(np.float64)
    u, v = np.where(lo >> 30 & 1, np.sin(a), np.cos(a)), np.where(lo >> 30 & 1, np.cos(a), np.sin(a))
    return np.stack([r * u * (1 - 2 * (lo >> 31)), r * v * (1 - 2 * (hi & 1))], axis=1)


@given(seed=st.integers(0, MASK), epoch=st.integers(0, 10**6), first=st.sampled_from([0, 1, 10**7, 2**40]))
def test_pairs_equal_the_functions_in_float64(seed: int, epoch: int, first: int) -> None:
    key = noise_key(seed, epoch, 7)
    assert int(key) == mix(mix(seed + epoch * GOLD) + 7)
    pairs = normal_pairs(key, first, 300).astype(np.float64)
    expected = plain_pairs(int(key), first, 300)
    radius = np.hypot(*expected.T)
    assert np.max(np.abs(pairs - expected) / (radius + 1e-9)[:, None]) < 5e-7


def test_splitmix64_reference() -> None:
    """First outputs of splitmix64 from state 1234567, as its reference program prints them."""
    states = [1234567 + GOLD * i for i in (1, 2, 3, 4, 5)]
    assert [mix(state) for state in states] == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]


def test_all_of_many_pairs() -> None:
    """A million pairs against float64: rare arguments of logarithm and square root are among them."""
    key = noise_key(9, 9, 9)
    pairs = normal_pairs(key, 0, 1_000_000)
    assert np.isfinite(pairs).all()
    z = (np.uint64(key) + np.arange(1_000_000, dtype=np.uint64) * np.uint64(GOLD)).view(np.uint64)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    hi = ((z ^ (z >> np.uint64(31))) >> np.uint64(32)).astype(np.int64)
    radius = np.sqrt(-2 * np.log((np.float32(hi >> 1) + np.float32(0.5)).astype(float) / 2.0**31))
    assert np.max(np.abs(np.hypot(*pairs.astype(float).T) - radius) - 5e-7 * radius) < 1e-9


@given(first=st.integers(0, 2**40), skip=st.integers(0, 500), n=st.integers(0, 500))
def test_a_pure_function_of_key_and_number(first: int, skip: int, n: int) -> None:
    key = noise_key(1, 2, 3)
    whole = normal_pairs(key, first, 1000)
    assert np.array_equal(normal_pairs(key, first + skip, n), whole[skip : skip + n])


def test_keys_differ() -> None:
    keys = {int(noise_key(s, e, b)) for s in range(20) for e in range(200) for b in range(3)}
    assert len(keys) == 20 * 200 * 3
