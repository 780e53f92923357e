"""Files with navigation pages as receivers write them: Septentrio SBF and the CSV of the official test vectors."""

from __future__ import annotations

import binascii
import struct
from collections.abc import Sequence

from vestige.navigation.inav.page import InavPage
from vestige.recording.samples.test_vector_csv import HEADER


def sbf_block(body: bytes, number: int = 4023, length: int | None = None) -> bytes:
    body = body.ljust(-(-len(body) // 4) * 4, b"\0")
    after = struct.pack("<HH", number, 8 + len(body) if length is None else length) + body
    return b"$@" + struct.pack("<H", binascii.crc_hqx(after, 0)) + after


def inav_block(page: InavPage, source: int = 17, passed: int = 1) -> bytes:
    end = page.time + 2
    bits = f"{int.from_bytes(page.data, 'big'):0240b}"
    bits = (bits[:114] + bits[120:]).ljust(256, "0")
    words = [int(bits[k : k + 32], 2) for k in range(0, 256, 32)]
    head = struct.pack("<IHBBBBBB", end.second * 1000, end.week + 1024, page.svid + 70, passed, 0, source, 0, 0)
    return sbf_block(head + struct.pack("<8I", *words))


def vector_csv(pages: Sequence[InavPage]) -> str:
    lines = [HEADER]
    for svid in sorted({page.svid for page in pages}):
        digits = "".join(page.data.hex().upper() for page in pages if page.svid == svid)
        lines.append(f"{svid:02d},{4 * len(digits)},{digits}")
    return "\n".join(lines)
