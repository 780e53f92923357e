"""Parse and compute tags and MACSEQ, the fields of OSNMA that authenticate navigation data.

A MACK message with n_t tags is `tag0 | MACSEQ 12 | COP 4 | (n_t - 1) x [tag | PRN_D 8 | ADKD 4 | COP 4] | key |
padding`. Tags and MACSEQ are made with a key that is disclosed one subframe later. The only exception is a tag of the
slow MAC (ADKD 12), whose key is disclosed eleven subframes later. A tag covers ::

    [PRN_D 8, not in tag0] | PRN_A 8 | GST_SF 32 | CTR 8 | NMAS 2 | data | zeros to a full byte       [OSNMA-ICD, 6.7]

MACSEQ covers PRN_A 8 | GST_SF 32 | 16 bits (PRN_D, ADKD and COP) of each flexible slot. The cut-off point COP counts
the subframes over which the data of a tag has not changed. A COP of 0 marks a dummy tag.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.messages.chain_parameters import TAG_INFO_BITS, ChainParameters
from vestige.crypto.osnma.messages.mac_lookup import Slot
from vestige.crypto.osnma.messages.navigation_data import ADKD_EPHEMERIS, ADKD_SLOW, NAVIGATION_FIELDS, NavigationData
from vestige.crypto.osnma.messages.subframe import SatelliteSubframe
from vestige.crypto.osnma.messages.tesla import gst_sf
from vestige.time import GalileoTime

MACSEQ_BITS = 12
KEY_DELAY_S = SUBFRAME_S  # time from a tag to its key, which is the key of the next subframe [OSNMA-ICD, 6.7]
SLOW_KEY_DELAY_S = 11 * SUBFRAME_S  # time from a tag with ADKD 12 to its key [OSNMA-ICD, 6.7]
MIN_TAG_BITS = 40  # smallest total length of tags for authenticated data [OSNMA-RG, equivalent tag length]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """A tag of a MACK message."""

    counter: int  # CTR, number of the tag in the message; 1 for tag0
    value: int  # bits of the tag as a number; the length of a tag follows from the chain
    info: int  # PRN_D, ADKD and COP in 16 bits; tag0 does not send PRN_D (its sender) and ADKD (0)

    @property
    def svid(self) -> int:
        """PRN_D: the satellite whose data is authenticated."""
        return self.info >> 8

    @property
    def adkd(self) -> int:
        """ADKD: the kind of data that is authenticated."""
        return self.info >> 4 & 15

    @property
    def cut_off(self) -> int:
        """COP: number of subframes over which the data has not changed; 0 for a dummy tag."""
        return self.info & 15

    @property
    def supported(self) -> bool:
        """Whether vestige supports the kind of data that the tag authenticates."""
        return self.adkd == ADKD_SLOW or self.adkd in NAVIGATION_FIELDS

    @property
    def key_delay_s(self) -> int:
        """Time from the subframe of the tag to the subframe of its key, in s."""
        return SLOW_KEY_DELAY_S if self.adkd == ADKD_SLOW else KEY_DELAY_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Mack:
    """The tags and the MACSEQ field of a complete MACK message."""

    svid: int  # PRN_A: the satellite that sent the message
    time: GalileoTime  # start of the subframe of the message
    nma_status: int  # NMAS of the NMA header in the same subframe; the tags cover this status
    macseq: int  # MACSEQ field, 12 bits
    tags: tuple[Tag, ...]


def parse_mack(subframe: SatelliteSubframe, parameters: ChainParameters) -> Mack | None:
    """Return tags and MACSEQ of a subframe; None if a page with tags is lost or contains no OSNMA."""
    header = subframe.nma_header
    length = parameters.tag_bits
    step = length + TAG_INFO_BITS
    bits = subframe.mack_bits(0, parameters.key_start_bit)
    if bits is None or header is None:
        return None
    fields = [bits >> (parameters.key_start_bit - step * (k + 1)) & ((1 << step) - 1) for k in range(parameters.n_tags)]
    macseq, cut_off = fields[0] >> 4 & 0xFFF, fields[0] & 15
    fields[0] = fields[0] >> TAG_INFO_BITS << TAG_INFO_BITS | subframe.svid << 8 | ADKD_EPHEMERIS << 4 | cut_off
    tags = tuple(Tag(counter=k + 1, value=value >> 16, info=value & 0xFFFF) for k, value in enumerate(fields))
    return Mack(svid=subframe.svid, time=subframe.time, nma_status=header >> 6, macseq=macseq, tags=tags)


def macseq_ok(mack: Mack, slots: Sequence[Slot], key: bytes, parameters: ChainParameters) -> bool:
    """Return whether the MACSEQ field of a MACK message is correct; `make_macseq` describes the parameters."""
    return make_macseq(mack, slots, key, parameters) == mack.macseq


def make_macseq(mack: Mack, slots: Sequence[Slot], key: bytes, parameters: ChainParameters) -> int:
    """Return the MACSEQ field, 12 bits, which covers the information fields of the flexible slots [OSNMA-ICD, 6.6].

    `slots` are the slots of the message's subframe, from `mac_lookup.slots`. `key` is the key of the next subframe.
    """
    flexible = (tag.info.to_bytes(2, "big") for tag, slot in zip(mack.tags, slots, strict=True) if slot.flexible)
    message = bytes([mack.svid]) + gst_sf(mack.time.gst_seconds) + b"".join(flexible)
    return parameters.mac(key, message, MACSEQ_BITS)


def make_tag(mack: Mack, tag: Tag, data: NavigationData, key: bytes, parameters: ChainParameters) -> int:
    """Return the bits of the tag that authenticates navigation data.

    `key` is the key of the subframe that starts `tag.key_delay_s` seconds after the subframe of the tag.
    """
    head = bytes([mack.svid]) + gst_sf(mack.time.gst_seconds) + bytes([tag.counter])
    if tag.counter > 1:
        head = bytes([tag.svid]) + head
    n_bits = 2 + data.n_bits
    tail = (mack.nma_status << data.n_bits | data.bits) << (-n_bits % 8)
    return parameters.mac(key, head + tail.to_bytes((n_bits + 7) // 8, "big"), parameters.tag_bits)
