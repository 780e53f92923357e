"""I/NAV pages with OSNMA of a simulated chain, made from the published formulas and not with the code under test."""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from simulated_chain import SimulatedChain
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

SLOTS = {
    33: (("00S", "00E", "04S", "00E", "12S", "00E"), ("00S", "00E", "00E", "12S", "00E", "12E")),
    34: (("00S", "FLX", "04S", "FLX", "12S", "00E"), ("00S", "FLX", "00E", "12S", "00E", "12E")),
}
WORD_ORDER = (2, 4, 6, 10, 7, 8, 0, 0, 0, 0, 1, 3, 5, 0, 0)


def crc_24q(bits: str) -> int:
    """Polynomial division, from one bit that is set to the next."""
    register = int(bits or "0", 2) << 24
    while register >> 24:
        register ^= 0x1864CFB << (register.bit_length() - 25)
    return register


def make_page(svid: int, time: GalileoTime, word: int, osnma: bytes, alert: bool = False) -> InavPage:
    kind = "1" if alert else "0"
    data = f"{word:0128b}"
    even = "0" + kind + data[:112]
    odd = "1" + kind + data[112:] + f"{int.from_bytes(osnma, 'big'):040b}" + "0" * 24
    bits = even + "0" * 6 + odd + f"{crc_24q(even + odd):024b}" + "0" * 14
    return InavPage(svid=svid, time=time, data=int(bits, 2).to_bytes(30, "big"))


def make_word(kind: int, svid: int, time: GalileoTime, issue: int) -> int:
    """A word whose payload is random-like but the same for one satellite and issue; words 0, 5 and 6 tell the time."""
    payload = int.from_bytes(hashlib.sha256(bytes([kind, svid, issue])).digest()[:16], "big")
    bits = f"{payload & ((1 << 122) - 1):0122b}"
    bits = f"{kind:06b}" + bits
    if kind in (1, 2, 3, 4):
        bits = bits[:6] + f"{issue:010b}" + bits[16:]
    if kind == 5:
        bits = bits[:73] + f"{time.week % 4096:012b}{time.second:020b}" + bits[105:]
    if kind == 6:
        bits = bits[:105] + f"{time.second:020b}" + bits[125:]
    if kind == 0:
        bits = bits[:6] + "10" + bits[8:96] + f"{time.week % 4096:012b}{time.second:020b}"
    return int(bits, 2)


def tag_data(svid: int, adkd: int, issue: int, time: GalileoTime) -> str:
    """The bits that a tag covers, of words sent in the subframe of `time`."""
    fields = (
        ((6, 6, 105), (10, 86, 128)) if adkd == 4 else ((1, 6, 126), (2, 6, 126), (3, 6, 128), (4, 6, 126), (5, 6, 73))
    )
    words = {}
    for index, kind in enumerate(WORD_ORDER):
        words[kind] = f"{make_word(kind, svid, time + (1 + 2 * index), issue):0128b}"
    return "".join(words[kind][start:end] for kind, start, end in fields)


def gst_sf(time: GalileoTime) -> bytes:
    return (time.week % 4096 << 20 | time.second).to_bytes(4, "big")


@dataclass
class Broadcast:
    """What the satellites send: chain, satellites, and switches to make it wrong."""

    chain: SimulatedChain
    svids: tuple[int, ...] = (2, 7, 11)
    n_subframes: int = 12
    header: int | None = None
    dsm_id: int = 3
    cut_off: int = 15
    issue_of: Callable[[int], int] = lambda _index: 5
    key_of: Callable[[int, int, bytes], bytes] = lambda _svid, _index, key: key
    header_of: Callable[[int, int, int], int] = lambda _svid, _index, header: header
    dsm_of: Callable[[int], bytes] | None = None
    _keys: Mapping[GalileoTime, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._keys = {key.time: key.data for key in self.chain.keys}
        if self.header is None:
            self.header = self.chain.header.value

    @property
    def start(self) -> GalileoTime:
        return self.chain.keys[0].time

    def pages(self) -> list[InavPage]:
        """All pages in time order."""
        pages = []
        for index in range(self.n_subframes):
            for svid in self.svids:
                pages += self.subframe(svid, index)
        return sorted(pages, key=lambda page: page.time)

    def subframe(self, svid: int, index: int) -> list[InavPage]:
        time = self.start + 30 * index
        assert self.header is not None
        header = self.header_of(svid, index, self.header)
        dsm = self.chain.kroot.serialise() if self.dsm_of is None else self.dsm_of(svid)
        block = (index + svid) % (len(dsm) // 13)
        hkroot = bytes([header, self.dsm_id << 4 | block]) + dsm[13 * block : 13 * block + 13]
        mack = self.mack(svid, index, header)
        pages = []
        for k, kind in enumerate(WORD_ORDER):
            start = time + (1 + 2 * k)
            word = make_word(kind, svid, start, self.issue_of(index))
            pages.append(make_page(svid, start, word, hkroot[k : k + 1] + mack[4 * k : 4 * k + 4]))
        return pages

    def mack(self, svid: int, index: int, header: int) -> bytes:
        """tag0, MACSEQ, COP, five tags and the key: the operational layout."""
        time = self.start + 30 * index
        slots = SLOTS.get(self.chain.kroot.parameters.mac_lookup, SLOTS[33])[time.second // 30 % 2]
        other = self.svids[(self.svids.index(svid) + 1) % len(self.svids)]
        fields = []
        flexible = b""
        for number, slot in enumerate(slots):
            adkd = 0 if slot == "FLX" else int(slot[:2])
            target = svid if slot[2] == "S" else other
            info = bytes([target, adkd << 4 | self.cut_off])
            if slot == "FLX":
                flexible += info
            head = b"" if number == 0 else bytes([target])
            head += bytes([svid]) + gst_sf(time) + bytes([number + 1])
            bits = f"{header >> 6:02b}" + tag_data(target, adkd, self.issue_of(index - 1), time + -30)
            bits += "0" * (-len(bits) % 8)
            key = self._keys.get(time + (330 if adkd == 12 else 30), bytes(16))
            tag = hmac.new(key, head + int(bits, 2).to_bytes(len(bits) // 8, "big"), hashlib.sha256).digest()[:5]
            fields.append(tag + info)
        next_key = self._keys.get(time + 30, bytes(16))
        sequence = hmac.new(next_key, bytes([svid]) + gst_sf(time) + flexible, hashlib.sha256).digest()
        macseq = int.from_bytes(sequence[:2], "big") >> 4
        fields[0] = fields[0][:5] + (macseq << 4 | self.cut_off).to_bytes(2, "big")
        return b"".join(fields) + self.key_of(svid, index, self._keys[time]) + bytes(2)
