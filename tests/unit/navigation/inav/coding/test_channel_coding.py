"""The convolutional code against an independent encoder and decoder (`scikit-commpy`), and against theory."""

from __future__ import annotations

import numpy as np
import pytest
from commpy.channelcoding import Trellis, conv_encode, viterbi_decode
from jaxtyping import Float, UInt8
from scipy.stats import norm

from vestige.navigation.inav.coding.channel_coding import (
    SYNC_PATTERN,
    convolved,
    decoded_halves,
    deinterleaved,
    interleaved,
    page_from_symbols,
    page_symbols,
)
from vestige.navigation.inav.page import encode_page

GENERATORS = (0o171, 0o133)
DATA_BITS, STEPS = 114, 120
TRELLIS = Trellis(np.array([6]), np.array([GENERATORS]), polynomial_format="Matlab")


def random_halves(rng: np.random.Generator, count: int) -> UInt8[np.ndarray, "count 120"]:
    bits = rng.integers(0, 2, (count, STEPS)).astype(np.uint8)
    bits[:, DATA_BITS:] = 0
    return bits


def received(rng: np.random.Generator, bits: UInt8[np.ndarray, "n 120"], eb_n0_db: float) -> Float[np.ndarray, "n 240"]:
    """Soft symbols in the order of transmission. A symbol has half the energy of a bit; the tail counts as no loss."""
    es_n0 = 10 ** (eb_n0_db / 10) / 2
    sent = 1.0 - 2.0 * interleaved(convolved(bits))
    return sent + rng.normal(scale=np.sqrt(0.5 / es_n0), size=sent.shape)


def judged(soft: Float[np.ndarray, " 240"]) -> UInt8[np.ndarray, " 120"]:
    """Bits of one half-page by `commpy`. It does not know that the code ends in state 0: strong zeros behind say so."""
    symbols = -deinterleaved(soft[None])[0]  # its ones are positive
    symbols[1::2] *= -1
    known = np.full(2 * 20, -50.0)
    decoded = viterbi_decode(np.concatenate((symbols, known)), TRELLIS, tb_depth=130, decoding_type="unquantized")
    return decoded[:STEPS].astype(np.uint8)


def test_symbols_are_those_of_an_independent_encoder() -> None:
    for bits in random_halves(np.random.default_rng(1), 20):
        expected = conv_encode(bits, TRELLIS, termination="cont").astype(np.uint8)
        expected[1::2] ^= 1
        assert np.array_equal(convolved(bits[None])[0], expected)


def test_the_interleaver_writes_columns_and_reads_rows() -> None:
    symbols = np.arange(240, dtype=np.uint8)
    table = [[0] * 30 for _ in range(8)]
    for place, symbol in enumerate(symbols):
        table[place % 8][place // 8] = int(symbol)
    assert interleaved(symbols).tolist() == [symbol for row in table for symbol in row]
    assert np.array_equal(deinterleaved(interleaved(symbols).astype(np.float64)), symbols)


def test_a_page_has_two_halves_behind_their_patterns() -> None:
    data = encode_page(0x0123456789ABCDEF0123456789ABCDEF, osnma=b"12345")
    symbols = page_symbols(data)
    bits = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(2, STEPS)
    for half in range(2):
        assert symbols[250 * half : 250 * half + 10].tolist() == list(SYNC_PATTERN) == [0, 1, 0, 1, 1, 0, 0, 0, 0, 0]
        assert np.array_equal(symbols[250 * half + 10 : 250 * (half + 1)], interleaved(convolved(bits[half])))
    for sign in (1.0, -1.0):
        assert page_from_symbols(sign * (1.0 - 2.0 * symbols)) == data


def test_a_page_with_lost_symbols_is_decoded() -> None:
    data = encode_page(3 << 122)
    soft = 1.0 - 2.0 * page_symbols(data).astype(np.float64)
    soft[100:120] = 0.0
    soft[400:412] = 0.0
    assert page_from_symbols(soft) == data


def test_symbols_must_be_finite_and_a_page_whole() -> None:
    with pytest.raises(ValueError, match="not finite"):
        decoded_halves(np.full((1, 240), np.nan))
    with pytest.raises(ValueError, match="29 bytes in a page, expected 30"):
        page_symbols(bytes(29))


@pytest.mark.parametrize("eb_n0_db", [3.0, 0.0])
def test_the_decoder_decides_as_an_independent_one(eb_n0_db: float) -> None:
    """At 0 dB most half-pages have errors, so agreement says that ours takes the most likely path too."""
    rng = np.random.default_rng(2)
    bits = random_halves(rng, 4)
    soft = received(rng, bits, eb_n0_db)
    assert np.array_equal(decoded_halves(soft), [judged(one) for one in soft])
    assert (decoded_halves(soft) != bits).any() == (eb_n0_db == 0.0)


@pytest.mark.slow
def test_many_noisy_half_pages_are_decided_as_by_an_independent_decoder() -> None:
    rng = np.random.default_rng(3)
    for eb_n0_db in (3.0, 0.0, -2.0):
        soft = received(rng, random_halves(rng, 3), eb_n0_db)
        hard = np.sign(soft)
        assert np.array_equal(decoded_halves(soft), [judged(one) for one in soft])
        # with hard decisions several paths are equally likely: the distances must agree, not the bits
        for own, other, symbols in zip(decoded_halves(hard), [judged(one) for one in hard], hard, strict=True):
            distances = [np.sum(1.0 - 2.0 * interleaved(convolved(one)) != symbols) for one in (own, other)]
            assert distances[0] == distances[1]


def spectrum(largest: int) -> list[tuple[int, Float[np.ndarray, " w"], Float[np.ndarray, " w"]]]:
    """Error events of each length: how many there are of each weight, and the sum of their wrong bits."""
    register = np.arange(128)
    weight = np.bitwise_count(register & GENERATORS[0]) % 2 + np.bitwise_count(register & GENERATORS[1]) % 2
    count, wrong = np.zeros((64, largest + 1)), np.zeros((64, largest + 1))
    count[32, weight[64]] = wrong[32, weight[64]] = 1
    events = []
    for length in range(2, STEPS + 1):
        count_2, wrong_2 = np.zeros_like(count), np.zeros_like(wrong)
        for state in range(1, 64):
            for bit in (0, 1):
                w, after = int(weight[bit << 6 | state]), (bit << 6 | state) >> 1
                count_2[after, w:] += count[state, : largest + 1 - w]
                wrong_2[after, w:] += (wrong + bit * count)[state, : largest + 1 - w]
        events.append((length, count_2[0].copy(), wrong_2[0].copy()))
        count, wrong = count_2, wrong_2
    return events


def union_bound(eb_n0_db: float) -> float:
    """Upper bound of the bit error rate in a half-page: each error event at each of its places."""
    events = spectrum(26)
    total = sum(wrong for _, _, wrong in events)
    assert total[10:21:2].tolist() == [36, 211, 1404, 11633, 77433, 502690]  # as published for this code
    tail = norm.sf(np.sqrt(10 ** (eb_n0_db / 10) * np.arange(27)))
    return float(sum((STEPS - length + 1) * (wrong @ tail) for length, _, wrong in events)) / DATA_BITS


@pytest.mark.slow
def test_bit_error_rate_at_3_db_is_that_of_theory() -> None:
    """The rate lies between the union bound at 3.0 dB and at 3.4 dB.

    Error budget: 200,000 half-pages have about 1300 wrong ones, with five wrong bits each on average, so the rate is
    known to 4 % (1σ). The union bound counts overlapping events more than once; at 3 dB it is twice the rate, which is
    0.2 dB. A decoder that loses 0.2 dB, as one of hard decisions loses 2 dB, exceeds the bound.
    """
    rng = np.random.default_rng(4)
    wrong = 0
    for _ in range(20):
        bits = random_halves(rng, 10_000)
        wrong += int((decoded_halves(received(rng, bits, 3.0)) != bits).sum())
    rate = wrong / (200_000 * DATA_BITS)
    assert union_bound(3.4) < rate < union_bound(3.0)


@pytest.mark.slow
def test_half_pages_decode_at_3_db_with_an_independent_decoder() -> None:
    """Of 60 half-pages 0.4 are expected wrong (0.67 %); 5 or more have a probability of 6e-5."""
    rng = np.random.default_rng(5)
    bits = random_halves(rng, 60)
    decoded = np.array([judged(one) for one in received(rng, bits, 3.0)])
    assert (decoded != bits).any(axis=1).sum() < 5
