"""Encode and decode a page of Galileo I/NAV on E1-B, which has 240 bits and takes 2 s.

A page has two halves of 120 bits, one second each [OS-ICD, 4.3.2]::

    even half: even/odd 1 (= 0) | type 1 | data 112 | tail 6
    odd half:  even/odd 1 (= 1) | type 1 | data 16 | OSNMA 40 | SAR 22 | spare 2 | CRC 24 | SSP 8 | tail 6

The 112 + 16 data bits are one navigation word of 128 bits. The OSNMA message of a subframe consists of the 40 OSNMA
bits of each of its 15 pages. The checksum covers all bits before the checksum except the tail of the even half. A good
checksum almost certainly means a correct decoding. A good checksum proves nothing about the page's origin, because
anybody can compute the checksum.
"""

from __future__ import annotations

from dataclasses import dataclass

from vestige.constants import MAX_SVID
from vestige.navigation.inav.bit_fields import BitField, BitLayout
from vestige.navigation.inav.crc import crc_24q
from vestige.time import GalileoTime

PAGE_BITS = 240  # [OS-ICD, 4.3.2]
PAGE_BYTES = PAGE_BITS // 8
PAGE_S = 2  # duration of a page on E1-B [OS-ICD, 4.3.2]
FIRST_PAGE_OFFSET_S = 1  # on E1-B the first page starts 1 s after the start of the subframe [OSNMA-ICD, 2]
OSNMA_BYTES = 5  # 8 bits of the HKROOT and 32 bits of the MACK message in a page [OSNMA-ICD, 2]

# Secondary synchronisation pattern by the second of the page's start modulo 6 [OS-ICD, 4.3.2]
SSP_BY_SECOND = {1: 0x04, 3: 0x2B, 5: 0x2F}
NO_SSP = 0xFD  # value that a satellite without the pattern sends

_DATA_1_BITS, _DATA_2_BITS = 112, 16  # number of bits of the word in the even and the odd half


def _page_layout() -> BitLayout:
    rows = (
        ("even_odd_1", 1, 0),
        ("alert_1", 1, 0),
        ("data_1", _DATA_1_BITS, None),
        ("tail_1", 6, 0),
        ("even_odd_2", 1, 1),
        ("alert_2", 1, 0),
        ("data_2", _DATA_2_BITS, None),
        ("osnma", 8 * OSNMA_BYTES, 0),
        ("sar", 22, 0b10_1010_1010_1010_1010_1010),  # pattern without a return link message
        ("spare", 2, 0b01),
        ("crc", 24, 0),
        ("ssp", 8, NO_SSP),
        ("tail_2", 6, 0),
    )
    fields, start = [], 0
    for name, length, fill in rows:
        fields.append(BitField(name=name, start=start, length=length, fill=fill))
        start += length
    return BitLayout(PAGE_BITS, tuple(fields))


PAGE_LAYOUT = _page_layout()
_CRC = PAGE_LAYOUT.by_name["crc"]
# number of bits from the first tail to the end of the page
_BEHIND_TAIL = PAGE_BITS - PAGE_LAYOUT.by_name["tail_1"].start
# number of bits that the checksum covers in the odd half
_ODD_COVERED = _CRC.start - PAGE_LAYOUT.by_name["even_odd_2"].start
_CRC_ON = PAGE_BITS - _CRC.start  # number of bits from the checksum to the end of the page
_CRC_SHIFT = _CRC_ON - _CRC.length


def page_checksum(data: bytes) -> int:
    """Return the checksum that the page should carry: CRC-24Q over bits 0 to 113 and 120 to 201 (196 bits).

    Parameters
    ----------
    data
        The 30 bytes of the page.
    """
    bits = int.from_bytes(data, "big")
    covered = ((bits >> _BEHIND_TAIL) << _ODD_COVERED) | ((bits >> _CRC_ON) & ((1 << _ODD_COVERED) - 1))
    return crc_24q(covered.to_bytes(25, "big"))


def encode_page(
    word: int,
    *,
    osnma: bytes = bytes(OSNMA_BYTES),
    sar: int | None = None,
    spare: int | None = None,
    ssp: int = NO_SSP,
    alert: bool = False,
) -> bytes:
    """Return the 30 bytes of a page with its checksum, and with both tails zero [OS-ICD, 4.3.2].

    Parameters
    ----------
    word
        Navigation word, 128 bits.
    osnma
        OSNMA field, 5 bytes; zero if the satellite sends no OSNMA.
    sar
        Search-and-rescue return link, 22 bits; None for the pattern that satellites send without a message.
    spare
        Spare field, 2 bits; None for the pattern that satellites send.
    ssp
        Secondary synchronisation pattern, 8 bits (see `page_ssp`).
    alert
        Whether the page is an alert page.

    Raises
    ------
    ValueError
        If a value has more bits than its field, or the OSNMA field does not have 5 bytes.

    Examples
    --------
    >>> page = InavPage(svid=11, time=GalileoTime(1372, 1), data=encode_page(2 << 122, osnma=b"vesti"))
    >>> page.crc_ok, page.osnma, page.word >> 122
    (True, b'vesti', 2)
    """
    if len(osnma) != OSNMA_BYTES:
        raise ValueError(f"{len(osnma)} bytes of OSNMA in a page, expected {OSNMA_BYTES}")
    raw = {
        "alert_1": int(alert),
        "data_1": word >> _DATA_2_BITS,
        "alert_2": int(alert),
        "data_2": word & ((1 << _DATA_2_BITS) - 1),
        "osnma": int.from_bytes(osnma, "big"),
        "ssp": ssp,
        **({} if sar is None else {"sar": sar}),
        **({} if spare is None else {"spare": spare}),
    }
    without = PAGE_LAYOUT.pack(raw)
    return (without | page_checksum(without.to_bytes(PAGE_BYTES, "big")) << _CRC_SHIFT).to_bytes(PAGE_BYTES, "big")


def page_ssp(start: GalileoTime) -> int:
    """Return the secondary synchronisation pattern of the page that starts at a time [OS-ICD, 4.3.2].

    Parameters
    ----------
    start
        Start of the page, an odd whole second.

    Raises
    ------
    ValueError
        If no page starts at this time.
    """
    pattern = None if start.fraction else SSP_BY_SECOND.get(start.second % 6)
    if pattern is None:
        raise ValueError(f"no I/NAV page starts at {start}, expected an odd whole second")
    return pattern


@dataclass(frozen=True, slots=True, kw_only=True)
class InavPage:
    """An I/NAV page of one satellite, as received on E1-B."""

    svid: int  # SVID of the satellite, 1 to 36
    time: GalileoTime  # start of the page in whole seconds, from the recording
    data: bytes  # 240 bits in 30 bytes, the even half first; the tail may be zero

    def __post_init__(self) -> None:
        if not 1 <= self.svid <= MAX_SVID or len(self.data) != PAGE_BYTES:
            raise ValueError(f"not an I/NAV page: SVID {self.svid}, {len(self.data)} bytes")

    def field(self, name: str) -> int:
        """Return the raw integer of a field of `PAGE_LAYOUT`."""
        return PAGE_LAYOUT.read(int.from_bytes(self.data, "big"), name)

    @property
    def crc_ok(self) -> bool:
        """Whether the page has an even and an odd half and a right checksum."""
        halves_ok = self.field("even_odd_1") == 0 and self.field("even_odd_2") == 1
        return halves_ok and page_checksum(self.data) == self.field("crc")

    @property
    def is_alert(self) -> bool:
        """Whether the page is an alert page, without navigation word and OSNMA [OS-ICD, 4.3.2.3]."""
        return bool(self.field("alert_1") or self.field("alert_2"))

    @property
    def word(self) -> int:
        """The navigation word, 128 bits, with the word type in the first 6 bits."""
        return self.field("data_1") << _DATA_2_BITS | self.field("data_2")

    @property
    def osnma(self) -> bytes:
        """The OSNMA field, 5 bytes: 8 bits of the HKROOT and 32 bits of the MACK message."""
        return self.field("osnma").to_bytes(OSNMA_BYTES, "big")
