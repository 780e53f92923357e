from __future__ import annotations

import hashlib
from itertools import combinations

import pytest

from vestige.navigation.inav.coding.fec2 import parity_words, restored_words


def words_of(seed: int, issue: int) -> dict[int, int]:
    digests = {kind: hashlib.sha256(bytes([seed, kind])).digest() for kind in (1, 2, 3, 4)}
    return {kind: kind << 122 | issue << 112 | int.from_bytes(made[:14], "big") for kind, made in digests.items()}


def product(a: int, b: int) -> int:
    """Product in GF(256) with the polynomial 0x11D, bit by bit."""
    total = 0
    for bit in range(8):
        if b >> bit & 1:
            total ^= a << bit
    for bit in range(14, 7, -1):
        if total >> bit & 1:
            total ^= 0x11D << (bit - 8)
    return total


def straightforward_parity(information: list[int]) -> list[int]:
    """Remainder of the long division by Π (x − α^k), k = 1 … 60; lowest degree first."""
    generator, root = [1], 1
    for _ in range(60):
        root = product(root, 2)
        shifted, scaled = [0, *generator], [*(product(root, one) for one in generator), 0]
        generator = [a ^ b for a, b in zip(shifted, scaled, strict=True)]
    rest = [0] * 60 + information
    for degree in range(len(rest) - 1, 59, -1):
        factor = rest[degree]
        for place, one in enumerate(generator):
            rest[degree - 60 + place] ^= product(factor, one)
    return rest[:60]


def test_parity_is_the_remainder_of_a_division() -> None:
    words = words_of(1, 0b1100110110)
    bodies = [byte for word in words.values() for byte in (word & ((1 << 112) - 1)).to_bytes(14, "big")]
    parity = straightforward_parity([0b000001_10, 0b11001101, *bodies])
    for index, (kind, word) in enumerate(parity_words(words).items()):
        octets = parity[15 * index : 15 * index + 15]
        assert f"{word:0128b}" == f"{kind:06b}{octets[0]:08b}10" + "".join(f"{octet:08b}" for octet in octets[1:])


@pytest.mark.parametrize("issue", [0, 9, 1023])
def test_any_four_words_give_the_ephemeris(issue: int) -> None:
    words = words_of(2, issue)
    sent = {**words, **parity_words(words)}
    for kinds in combinations(sent, 4):
        assert restored_words({kind: sent[kind] for kind in kinds}) == words, kinds


def test_all_words_and_strangers_give_the_same() -> None:
    words = words_of(3, 77)
    assert restored_words({**words, **parity_words(words), 0: 0, 5: 5 << 122}) == words


def test_three_words_are_too_few() -> None:
    words = words_of(4, 5)
    sent = {**words, **parity_words(words)}
    for kinds in combinations(sent, 3):
        assert restored_words({kind: sent[kind] for kind in kinds}) is None


def test_words_of_several_issues_give_nothing() -> None:
    old, new = words_of(5, 8), words_of(6, 9)
    assert restored_words({1: old[1], 2: new[2], **parity_words(old)}) is None
    parity = parity_words(new)
    assert restored_words({1: old[1], 2: old[2], 17: parity[17], 18: parity[18]}) is None
    same_low_bits = parity_words(words_of(7, 12))
    assert restored_words({**old, 17: same_low_bits[17]}) is None


def test_parity_needs_all_words_of_one_issue() -> None:
    words = words_of(8, 8)
    with pytest.raises(ValueError, match="expected words 1 to 4 of one IODnav"):
        parity_words({kind: words[kind] for kind in (1, 2, 3)})
    with pytest.raises(ValueError, match="expected words 1 to 4 of one IODnav"):
        parity_words({**words, 2: words_of(9, 9)[2]})
