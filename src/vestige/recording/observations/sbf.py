"""Read I/NAV pages in Septentrio Binary Format (SBF), block GALRawINAV.

A block is `$@ | CRC-16 2 | id 2 | length 2 | time of week in ms 4 | week 2 | …`, little endian. In this list, the
number at the end of a field is the field's length in bytes. The CRC covers everything after the CRC field. GALRawINAV
(id 4023) adds `SVID + 70 | CRC passed | Viterbi count | source | 2 bytes | 32 bytes of navigation bits`. The first four
of these fields have one byte each. The time of a block is the **end** of the page, and the week of a block is the GPS
week [SBF].

The reader tests the length and the CRC of each block. If a test fails, the reader continues at the next sync word `$@`.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from vestige.constants import MAX_SVID
from vestige.crypto.file_bytes import open_file
from vestige.errors import InputFileError
from vestige.navigation.inav.page import PAGE_S, InavPage
from vestige.time import GalileoTime

SYNC = b"$@"
GAL_RAW_INAV = 4023  # number of the block GALRawINAV [SBF]

_HEADER = struct.Struct("<2sHHH")
_INAV = struct.Struct("<IHBBBB2x8I")  # fields after the header: TOW, WNc, SVID, CRC passed, Viterbi count, source, bits
_CHUNK_BYTES = 1 << 20
_E1B, _E5B = 17, 21  # numbers of the sources E1-B and E5b of a page [SBF]
_MIXED = 0x20  # flag in the source for pages that combine E1-B and E5b [SBF]
_SVID_OFFSET = 70  # number of a satellite in SBF minus its SVID [SBF]
_WEEK_OFFSET = 1024  # WNc counts from 1980, Galileo weeks from 1999 [SBF]
_TOW_UNKNOWN, _WEEK_UNKNOWN = 0xFFFFFFFF, 0xFFFF  # "do not use" values [SBF]
_UNUSED_BITS = 22  # number of unused bits at the end of the 8 words


@dataclass(slots=True)
class SbfCounts:
    """Counts of the blocks and bytes that a reader found."""

    blocks: int = 0  # number of blocks of any kind with a good CRC
    bad_blocks: int = 0  # number of apparent blocks with a wrong CRC or length, or cut off by the end of the file
    skipped_bytes: int = 0  # number of bytes outside blocks with a good CRC
    e1b: int = 0  # number of GALRawINAV blocks of E1-B, the only blocks that become pages
    e5b: int = 0
    mixed: int = 0
    other: int = 0
    no_time: int = 0  # number of E1-B blocks without a usable time, or with an impossible satellite number


def read_sbf(path: Path, counts: SbfCounts | None = None) -> Iterator[InavPage]:
    """Yield the E1-B pages of an SBF file, in the order of the file.

    Pages that failed the receiver's checksum test are also yielded, because the caller tests the checksum again. Pages
    without a usable time or satellite number are left out. `counts` is filled while the file is read.

    The function raises `InputFileError` if the file cannot be read, or contains no GALRawINAV block of E1-B.
    """
    counts = SbfCounts() if counts is None else counts
    with open_file(path) as file:
        for block in _blocks(path, file, counts):
            page = _page(block, counts)
            if page is not None:
                yield page
    if not counts.e1b:
        raise InputFileError(
            path, "file", f"{counts.blocks} SBF blocks, none of them GALRawINAV of E1-B", "navigation pages"
        )


def _blocks(path: Path, file: BinaryIO, counts: SbfCounts) -> Iterator[bytes]:
    """Yield the blocks with a good CRC."""
    data, at, ended = b"", 0, False
    while True:
        if not ended and len(data) - at < 1 << 16:  # a block has at most 65,535 bytes
            try:
                chunk = file.read(_CHUNK_BYTES)
            except OSError as error:
                raise InputFileError(path, "file", error.strerror or "an error", "a readable file") from None
            ended = not chunk
            data, at = data[at:] + chunk, 0
        start = data.find(SYNC, at)
        if start < 0:
            # The last byte may be the first half of a sync word.
            keep = 0 if ended else 1
            counts.skipped_bytes += max(len(data) - keep - at, 0)
            at = max(len(data) - keep, at)
            if ended:
                return
            continue
        counts.skipped_bytes += start - at
        at = start
        if len(data) - at < 1 << 16 and not ended:
            continue
        length = _good_length(data, at)
        if length:
            counts.blocks += 1
            yield data[at : at + length]
            at += length
        else:
            counts.bad_blocks += 1
            counts.skipped_bytes += len(SYNC)
            at += len(SYNC)


def _good_length(data: bytes, at: int) -> int:
    """Return the length of the block at `at`, or 0 if there is no good block."""
    if len(data) - at < _HEADER.size:
        return 0
    _, checksum, _, length = _HEADER.unpack_from(data, at)
    if length < _HEADER.size or length % 4 or at + length > len(data):
        return 0
    return length if binascii.crc_hqx(data[at + 4 : at + length], 0) == checksum else 0


def _page(block: bytes, counts: SbfCounts) -> InavPage | None:
    _, _, block_id, length = _HEADER.unpack_from(block)
    if block_id & 0x1FFF != GAL_RAW_INAV or length < _HEADER.size + _INAV.size:
        return None
    tow_ms, week, svid, _, _, source, *words = _INAV.unpack_from(block, _HEADER.size)
    if source & _MIXED:
        counts.mixed += 1
    elif source & 0x1F == _E5B:
        counts.e5b += 1
    elif source & 0x1F != _E1B:
        counts.other += 1
    else:
        counts.e1b += 1
        time = _page_start(tow_ms, week)
        if time is not None and 1 <= svid - _SVID_OFFSET <= MAX_SVID:
            return InavPage(svid=svid - _SVID_OFFSET, time=time, data=_page_bits(words))
        counts.no_time += 1
    return None


def _page_start(tow_ms: int, week: int) -> GalileoTime | None:
    if tow_ms == _TOW_UNKNOWN or tow_ms % 1000 or tow_ms > 604_800_000:
        return None
    if week == _WEEK_UNKNOWN or week <= _WEEK_OFFSET:
        return None
    return GalileoTime.normalized(week - _WEEK_OFFSET, tow_ms // 1000 - PAGE_S)


def _page_bits(words: list[int]) -> bytes:
    """Return the page as 30 bytes, with zeros for the tail of the even half, which the block leaves out."""
    bits = 0
    for word in words:
        bits = bits << 32 | word
    bits >>= _UNUSED_BITS
    even, odd = bits >> 120, bits & ((1 << 120) - 1)
    return (even << 126 | odd).to_bytes(30, "big")
