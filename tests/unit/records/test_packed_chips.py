from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import START
from vestige.records import ChipSequence
from vestige.records.packed_chips import PAD, bits_of_packed, packed_bits, packed_chips, unpacked_chips


@given(st.binary(min_size=1, max_size=64), st.data())
def test_packing_is_most_significant_bit_first_and_zero_is_plus_one(stream: bytes, data: st.DataObject) -> None:
    skip = data.draw(st.integers(0, 8 * len(stream)))
    n_chips = data.draw(st.integers(0, 8 * len(stream) - skip))
    bits = "".join(f"{byte:08b}" for byte in stream)[skip : skip + n_chips]
    packed = packed_bits(stream, n_chips, skip)
    chips = unpacked_chips(packed, n_chips)
    assert chips.dtype == np.int8
    assert chips.tolist() == [1 if bit == "0" else -1 for bit in bits]
    assert np.array_equal(packed_chips(chips), packed)
    again = bits_of_packed(packed, 70)
    assert "".join(f"{byte:08b}" for byte in again) == bits.ljust(560, "0")


@given(st.integers(0, 300), st.integers(0, 9))
def test_zeros_surround_the_chips(n_chips: int, seed: int) -> None:
    chips = np.random.default_rng(seed).choice(np.array([-1, 1], np.int8), n_chips)
    packed = packed_chips(chips)
    bits = np.unpackbits(packed.astype(">u4").view(np.uint8))
    assert np.array_equal(bits[PAD : PAD + n_chips], chips < 0)
    assert not bits[:PAD].any()
    assert not bits[PAD + n_chips :].any()
    assert bits.size >= n_chips + 2 * PAD + 32


def test_a_sequence_gives_its_chips_back() -> None:
    chips = np.array([1, -1, -1, 1, -1], np.int8)
    sequence = ChipSequence.of(svid=1, transmit_time=START, chip_rate_hz=1e3, chips=chips)
    assert np.array_equal(sequence.chips, chips)
    assert (sequence.n_chips, sequence.duration_s) == (5, 5e-3)


def test_packing_refuses_what_is_not_a_chip() -> None:
    with pytest.raises(ValueError, match=r"\+1 or -1"):
        ChipSequence.of(svid=1, transmit_time=START, chip_rate_hz=1e3, chips=np.array([1, 0, -1], np.int8))


@pytest.mark.parametrize(("n_chips", "skip"), [(9, 0), (1, 8), (-1, 0)])
def test_bits_must_be_there(n_chips: int, skip: int) -> None:
    with pytest.raises(ValueError, match="1 bytes do not hold"):
        packed_bits(b"\0", n_chips, skip)
