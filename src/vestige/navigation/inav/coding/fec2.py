"""Compute the Reed–Solomon parity FEC2 of words 1 to 4, and restore lost words from the parity [OS-ICD, FEC2].

Any four of the words 1 to 4 and 17 to 20 give the clock and ephemeris data, so a receiver need not wait for lost words.
The code is over GF(256) with the polynomial 0x11D and the roots α¹ … α⁶⁰, shortened to 118 octets with 58 octets of
information::

    octet 0       type of word 1 (6 bits), 2 least significant bits of IODnav
    octet 1       8 most significant bits of IODnav
    14 octets     bits 16 to 127 of each of the words 1, 2, 3 and 4
    15 octets     of parity in each of the words 17, 18, 19 and 20

In the polynomial of the code, the parity has the lower degrees, and the information has the higher degrees. In the
parity and in the information, the first octet is the coefficient of the lowest degree. `reedsolo` expects the
coefficient of the highest degree first.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache

import reedsolo

from vestige.navigation.inav.word_table import EPHEMERIS_WORDS, PARITY_WORDS, TYPE_BITS, WORD_BITS, WORD_LAYOUTS

_PARITY = 60
_OCTETS = 14  # number of octets after type and IODnav in words 1 to 4, and after the IODnav bits in a parity word
_WORD_PARITY = _PARITY // len(PARITY_WORDS)
_BODY_BITS = 8 * _OCTETS
_IOD_AT = WORD_BITS - TYPE_BITS - 10


@cache
def _codec() -> reedsolo.RSCodec:
    return reedsolo.RSCodec(nsym=_PARITY, fcr=1, prim=0x11D)


def parity_words(words: Mapping[int, int]) -> dict[int, int]:
    """Return the parity words 17 to 20 of words 1 to 4.

    Parameters
    ----------
    words
        Word type -> word of 128 bits. The words 1 to 4 must have the same IODnav. Other words are ignored.

    Returns
    -------
    dict
        Word type 17 to 20 -> word of 128 bits.

    Raises
    ------
    ValueError
        If any of the words 1 to 4 is missing, or the words are of several issues.
    """
    issue = _issue(words)
    if issue is None or any(kind not in words for kind in EPHEMERIS_WORDS):
        raise ValueError(f"words {sorted(words)}, expected words 1 to 4 of one IODnav")
    codeword = bytes(_codec().encode(_information(words, issue)[::-1]))[::-1]
    parity = codeword[:_PARITY]  # the coefficients of the lowest degrees of the codeword
    found = {}
    for index, kind in enumerate(PARITY_WORDS):
        octets = parity[_WORD_PARITY * index : _WORD_PARITY * (index + 1)]
        found[kind] = WORD_LAYOUTS[kind].pack(
            {"first_octet": octets[0], "iod_nav_low": issue & 3, "octets": int.from_bytes(octets[1:], "big")}
        )
    return found


def restored_words(words: Mapping[int, int]) -> dict[int, int] | None:
    """Return words 1 to 4 from any four of the words 1 to 4 and 17 to 20 of one issue.

    Parameters
    ----------
    words
        Word type -> word of 128 bits, each with a good checksum. Other words are ignored.

    Returns
    -------
    dict or None
        Word type 1 to 4 -> word of 128 bits. Given words 1 to 4 stay unchanged. The result is None if there are too few
        words, or if the words are detectably of several issues. A parity word has only two bits of IODnav, so
        all words must have been received within a few minutes.

    Examples
    --------
    >>> words = {kind: kind << 122 | 9 << 112 for kind in (1, 2, 3, 4)}
    >>> restored_words(parity_words(words)) == words
    True
    """
    restored = _restored(tuple((kind, words[kind]) for kind in (*EPHEMERIS_WORDS, *PARITY_WORDS) if kind in words))
    return None if restored is None else dict(restored)


@lru_cache(maxsize=256)  # a cache, because a receiver calls this function with every page, and pages repeat words
def _restored(received: tuple[tuple[int, int], ...]) -> Mapping[int, int] | None:
    """Return words 1 to 4 from the received words 1 to 4 and 17 to 20, as `restored_words` does."""
    known = dict(received)
    low_bits = {WORD_LAYOUTS[kind].read(known[kind], "iod_nav_low") for kind in PARITY_WORDS if kind in known}
    issue = _issue(known)
    if issue is not None:
        low_bits.add(issue & 3)
    elif any(kind in known for kind in EPHEMERIS_WORDS):
        return None
    if len(low_bits) != 1 or len(known) < len(EPHEMERIS_WORDS):
        return None
    octets: list[int | None] = []
    for kind in PARITY_WORDS:
        octets += _octets(known, kind, _WORD_PARITY)
    octets += [1 << 2 | low_bits.pop(), None if issue is None else issue >> 2]
    for kind in EPHEMERIS_WORDS:
        octets += _octets(known, kind, _OCTETS)
    backwards = octets[::-1]
    erased = [place for place, octet in enumerate(backwards) if octet is None]
    try:
        message, _, _ = _codec().decode(
            bytearray(octet or 0 for octet in backwards), erase_pos=erased, only_erasures=True
        )
    except reedsolo.ReedSolomonError:
        return None
    information = bytes(message)[::-1]
    issue = information[1] << 2 | information[0] & 3
    bodies = (information[2 + _OCTETS * n : 2 + _OCTETS * (n + 1)] for n in range(len(EPHEMERIS_WORDS)))
    return {
        kind: kind << (WORD_BITS - TYPE_BITS) | issue << _IOD_AT | int.from_bytes(body, "big")
        for kind, body in zip(EPHEMERIS_WORDS, bodies, strict=True)
    }


def _issue(words: Mapping[int, int]) -> int | None:
    """Return the IODnav of the given words 1 to 4; None without words, or if the words have different IODnav."""
    issues = {WORD_LAYOUTS[kind].read(words[kind], "iod_nav") for kind in EPHEMERIS_WORDS if kind in words}
    return issues.pop() if len(issues) == 1 else None


def _information(words: Mapping[int, int], issue: int) -> bytes:
    """Return the 58 octets that the parity protects."""
    bodies = (words[kind] & ((1 << _BODY_BITS) - 1) for kind in EPHEMERIS_WORDS)
    return bytes((1 << 2 | issue & 3, issue >> 2)) + b"".join(body.to_bytes(_OCTETS, "big") for body in bodies)


def _octets(words: Mapping[int, int], kind: int, n: int) -> list[int | None]:
    """Return the `n` octets of a word in the codeword, each of which is None if the word is missing."""
    if kind not in words:
        return [None] * n
    body = list((words[kind] & ((1 << _BODY_BITS) - 1)).to_bytes(_OCTETS, "big"))
    first = [WORD_LAYOUTS[kind].read(words[kind], "first_octet")] if kind in PARITY_WORDS else []
    return [*first, *body]
