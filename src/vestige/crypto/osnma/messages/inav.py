"""One page of Galileo I/NAV as it is broadcast on E1-B: 240 bits in 2 s.

A page has two halves of 120 bits, one second each [OS-ICD, 4.3.2]::

    even half: even/odd 1 (= 0) | type 1 | data 112 | tail 6
    odd half:  even/odd 1 (= 1) | type 1 | data 16 | OSNMA 40 | SAR 22 | spare 2 | CRC 24 | SSP 8 | tail 6

The 112 + 16 data bits are one navigation word of 128 bits. The 40 OSNMA bits of 15 pages make up one subframe's OSNMA
message. The checksum covers everything between the tails except the SSP, so a page with a good checksum is worth
reading, but it proves nothing about its origin: anybody can compute it.
"""

from __future__ import annotations

from dataclasses import dataclass

from vestige.constants import MAX_SVID
from vestige.time import GalileoTime

PAGE_BITS = 240  # [OS-ICD, 4.3.2]
PAGE_BYTES = PAGE_BITS // 8
PAGE_S = 2  # duration of a page on E1-B [OS-ICD, 4.3.2]
WORD_BITS = 128  # [OS-ICD, 4.3.2.3]
FIRST_PAGE_OFFSET_S = 1  # on E1-B the first page of a subframe starts at its second 1 [OSNMA-ICD, 2]

_CRC_24Q = 0x1864CFB  # generator polynomial, initial value 0 [OS-ICD, 5.1.9.4]
_OSNMA_MASK = (1 << 40) - 1

# Where the words that tell the time have it: word type -> (first bit of the 12-bit week, first bit of the 20-bit time
# of week); None: not in this word [OS-ICD, 4.3.5]. Word type 0 has it only if its time field (bits 6, 7) is 10.
_TIME_FIELDS: dict[int, tuple[int | None, int]] = {0: (96, 108), 5: (73, 85), 6: (None, 105)}


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        register = byte << 16
        for _ in range(8):
            register <<= 1
            if register & 0x1000000:
                register ^= _CRC_24Q
        table.append(register)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc_24q(data: bytes) -> int:
    """Return the CRC-24Q checksum of `data` [OS-ICD, 5.1.9.4]; zero bits in front of the data do not change it."""
    register = 0
    for byte in data:
        register = ((register << 8) & 0xFFFFFF) ^ _CRC_TABLE[(register >> 16) ^ byte]
    return register


def page_checksum(data: bytes) -> int:
    """Return the checksum that the page should carry: CRC-24Q over its bits 0…113 and 120…201 (196 bits)."""
    bits = int.from_bytes(data, "big")
    covered = ((bits >> 126) << 82) | ((bits >> 38) & ((1 << 82) - 1))
    return crc_24q(covered.to_bytes(25, "big"))


def word_bits(word: int, start: int, length: int) -> int:
    """Return `length` bits of a 128-bit word from bit `start` on (bit 0 is the first one transmitted)."""
    return (word >> (WORD_BITS - start - length)) & ((1 << length) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class InavPage:
    """One I/NAV page of one satellite, as received on E1-B."""

    svid: int  # satellite, 1 … 36
    time: GalileoTime  # start of the page in whole seconds, as the recording tells it
    data: bytes  # 30 bytes: 240 bits, the even half first; its tail may be zero

    def __post_init__(self) -> None:
        if not 1 <= self.svid <= MAX_SVID or len(self.data) != PAGE_BYTES:
            raise ValueError(f"not an I/NAV page: SVID {self.svid}, {len(self.data)} bytes")

    @property
    def crc_ok(self) -> bool:
        """Whether the halves are an even and an odd one and the checksum is right."""
        halves_ok = not self.data[0] & 0x80 and bool(self.data[15] & 0x80)
        return halves_ok and page_checksum(self.data) == int.from_bytes(self.data[25:29], "big") >> 6 & 0xFFFFFF

    @property
    def is_alert(self) -> bool:
        """Whether this is an alert page: it holds neither a navigation word nor OSNMA [OS-ICD, 4.3.2.3]."""
        return bool((self.data[0] | self.data[15]) & 0x40)

    @property
    def word(self) -> int:
        """The navigation word, 128 bits: its type is in the first 6."""
        bits = int.from_bytes(self.data, "big")
        return ((bits >> 126 & ((1 << 112) - 1)) << 16) | (bits >> 102 & 0xFFFF)

    @property
    def osnma(self) -> bytes:
        """The OSNMA field, 5 bytes: 8 bits of the HKROOT and 32 bits of the MACK message."""
        return (int.from_bytes(self.data, "big") >> 62 & _OSNMA_MASK).to_bytes(5, "big")


def time_in_word(word: int) -> tuple[int | None, int] | None:
    """Return (week modulo 4096 or None, time of week in s) of the start of the page that carries `word`.

    Returns
    -------
    tuple or None
        None if this word does not tell the time. The week is None for word type 6, which has only the time of week.
    """
    fields = _TIME_FIELDS.get(word_bits(word, 0, 6))
    if fields is None or (word_bits(word, 0, 6) == 0 and word_bits(word, 6, 2) != 0b10):
        return None
    week_at, second_at = fields
    return None if week_at is None else word_bits(word, week_at, 12), word_bits(word, second_at, 20)
