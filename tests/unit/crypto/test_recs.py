from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import validated_key
from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS
from vestige.crypto.recs import recs_segment as recs
from vestige.crypto.recs.recs_segment import LENGTHS, CipherMode, SegmentLength
from vestige.records import ChipSequence
from vestige.time import GalileoTime

EPOCH = GalileoTime(1251, 277216)
KEY = bytes(range(16))

times = st.builds(GalileoTime, st.integers(1, 8000), st.integers(0, 604_799), st.integers(0, 9).map(lambda ds: ds / 10))
keys = st.sampled_from(sorted(KEY_BITS.values())).flatmap(
    lambda bits: st.binary(min_size=bits // 8, max_size=bits // 8)
)


def random_chips(n_chips: int, *, time: GalileoTime = EPOCH, seed: int = 1) -> ChipSequence:
    chips = np.random.default_rng(seed).choice(np.array([-1, 1], np.int8), n_chips)
    return ChipSequence.of(svid=11, transmit_time=time, chip_rate_hz=5.115e6, chips=chips)


@pytest.mark.parametrize("length", LENGTHS, ids=lambda length: f"{length.duration_ms}ms")
def test_lengths_are_whole_code_periods_filled_up_to_aes_blocks(length: SegmentLength) -> None:
    assert length.duration_ms == 2**length.code
    assert length.n_chips == 5115 * length.duration_ms
    assert 8 * length.n_bytes == -(-length.n_chips // 128) * 128


@pytest.mark.parametrize(
    ("second", "key_delay", "expected"),
    [
        (277_200, 0, GalileoTime(1251, 277_200)),
        (277_229, 0, GalileoTime(1251, 277_200)),
        (277_229, 1, GalileoTime(1251, 277_230)),
        (604_799, 0, GalileoTime(1251, 604_770)),
        (604_799, 1, GalileoTime(1252, 0)),
    ],
)
def test_key_time(second: int, key_delay: int, expected: GalileoTime) -> None:
    assert recs.key_time(GalileoTime(1251, second, 0.9), key_delay) == expected


def test_key_delay_must_be_known() -> None:
    with pytest.raises(ValueError, match="neither 0 nor 1"):
        recs.key_time(EPOCH, 2)


def test_week_enters_modulo_4096() -> None:
    gst_sf = GalileoTime(1251, 277_200)
    assert recs.iv_preimage(GalileoTime(1251 + 4096, 277_200), 1) == recs.iv_preimage(gst_sf, 1)
    assert recs.iv_preimage(gst_sf, 1) == bytes.fromhex("4e343ad0") + b"\x01" + bytes(11)
    assert recs.initialization_vector(gst_sf, 0) != recs.initialization_vector(gst_sf, 1)
    with pytest.raises(ValueError, match="not the start of a subframe"):
        recs.iv_preimage(EPOCH, 0)


@given(
    length=st.sampled_from(LENGTHS), mode=st.sampled_from(CipherMode), key=keys, time=times,
    key_delay=st.integers(0, 1), random_offset=st.integers(0, 1), seed=st.integers(0, 2**32),
)  # fmt: skip
def test_decrypt_inverts_encrypt(
    length: SegmentLength,
    mode: CipherMode,
    key: bytes,
    time: GalileoTime,
    key_delay: int,
    random_offset: int,
    seed: int,
) -> None:
    chips = random_chips(length.n_chips, time=time, seed=seed)
    segment = recs.encrypt(chips, key, key_delay=key_delay, random_offset=random_offset, mode=mode)
    assert len(segment.cipher) == length.n_bytes
    assert segment.n_chips == length.n_chips
    decrypted = recs.decrypt(segment, validated_key(segment.key_time, key), mode=mode)
    assert decrypted.transmit_time == time
    np.testing.assert_array_equal(decrypted.chips, chips.chips)


@pytest.mark.parametrize("wrong", ["key", "mode"])
def test_wrong_key_or_mode_gives_noise(wrong: str) -> None:
    chips = random_chips(81_840)
    segment = recs.encrypt(chips, KEY)
    key = validated_key(segment.key_time, KEY[::-1] if wrong == "key" else KEY)
    decrypted = recs.decrypt(segment, key, mode=CipherMode.CTR if wrong == "mode" else CipherMode.CBC)
    correlation = np.dot(decrypted.chips.astype(int), chips.chips.astype(int)) / np.sqrt(81_840)
    assert abs(correlation) < 5  # standard normal: 6e-7 both sides


def test_wrong_initialization_vector_damages_the_first_block_only() -> None:
    chips = random_chips(81_840)
    segment = recs.encrypt(chips, KEY, random_offset=0)
    wrong = dataclasses.replace(segment, random_offset=1)
    decrypted = recs.decrypt(wrong, validated_key(segment.key_time))
    np.testing.assert_array_equal(decrypted.chips[128:], chips.chips[128:])
    assert np.any(decrypted.chips[:128] != chips.chips[:128])


@pytest.mark.parametrize("step", [-30, 30, 604_800, 4096 * 604_800])
def test_key_of_another_subframe_is_refused(step: int) -> None:
    segment = recs.encrypt(random_chips(5115), KEY)
    with pytest.raises(ValueError, match="needs the key of"):
        recs.decrypt(segment, validated_key(segment.key_time + step))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"key_delay": 1}, "is not that of a RECS at"),
        ({"n_chips": 5120}, "does not hold 5120 chips"),
        ({"n_chips": 10_230}, "does not hold 10230 chips"),
        ({"cipher": bytes(16)}, "does not hold 5115 chips"),
    ],
)
def test_contradicting_segment_is_refused(change: dict[str, int], message: str) -> None:
    segment = recs.encrypt(random_chips(5115), KEY)
    with pytest.raises(ValueError, match=message):
        recs.decrypt(dataclasses.replace(segment, **change), validated_key(segment.key_time))


def test_only_recs_lengths_and_whole_blocks_are_encrypted() -> None:
    with pytest.raises(ValueError, match="no RECS has 5120 chips"):
        recs.encrypt(random_chips(5120), KEY)
    for mode in CipherMode:
        with pytest.raises(ValueError, match="not whole AES blocks"):
            recs.encrypt_body(bytes(17), KEY, EPOCH.subframe, 0, mode)
