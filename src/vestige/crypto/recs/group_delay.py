"""Read and write BGD files, and compute the delay of E6 after E1 that follows from a broadcast group delay.

Each satellite's payload delays its carriers differently. T_R is the group delay of a carrier, and a larger T_R means a
later carrier. The open service defines [OS-ICD, 5.1.5]::

    BGD(E1,E6)  = (T_R1 − T_R6) / (1 − γ),        γ = (f1/f6)² = (154/125)²
    T_R6 − T_R1 = (γ − 1) · BGD(E1,E6)                                            positive: E6 arrives later

So BGD and ionosphere have the same factor: P6 − P1 = (γ − 1) · (I1 + c · BGD) + receiver hardware + multipath. Here P1
and P6 are the pseudoranges, I1 is the ionospheric delay on E1 in m, and c is the speed of light. The public reference
receiver instead adds the value of the file without the factor (γ − 1), so the delay is 1/0.518 times as large [SASLIB].
The convention of the service is not public. `GroupDelayConvention` selects the convention for simulator and processor.

The layout of the file is known only from a public program that reads BGD files [SASLIB]. The authors of the program
derived the layout from examples. This module is the only module that contains the layout::

    byte  length  content
    0     4       provider, ASCII
    4     1       interface version
    5     2       reserved (4 bits), week modulo 4096 (12 bits)          assumed, as in a unitary RECS header
    7     3       time of week in deciseconds                            assumed, as in a unitary RECS header
    10    6       validity, kept as read                                 meaning unknown
    16    20      satellite mask, most significant bit first, from SVID 1
    36    36      filling, 0x12
    72    72      little endian int16 of SVID 1 to 36, LSB 2⁻³² s        known for SVID 1 to 30, assumed beyond
    144   …       a typical file has 191 bytes                           meaning unknown
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from vestige.constants import GAMMA_E1_E6, MAX_SVID
from vestige.crypto.recs.recs_file import resolve_week
from vestige.crypto.recs.recs_name import (
    DECISECONDS_PER_WEEK,
    deciseconds_of_week,
    format_time_code,
    time_of_deciseconds,
)
from vestige.crypto.recs.recs_segment import WEEK_MODULUS
from vestige.errors import InputFileError, UnsupportedError
from vestige.records import GroupDelay
from vestige.time import GalileoTime

LSB_S = 2.0**-32  # least significant bit of a BGD value in the message [OS-ICD, 5.1.5] and in the file [SASLIB]
BGD_INTERFACE_VERSION = 1  # only known interface version of a BGD file [SASLIB]

_HEADER = struct.Struct(">4s B H 3s 6s 20s 36s")
_FILLING = b"\x12" * 36
_SHORTEST_BYTES = 72 + 2 * 30  # length in bytes of the part of the file whose meaning is known
_TYPICAL_BYTES = 191
MAX_GROUP_DELAY_FILE_BYTES = 1 << 16  # upper limit, far above the size of any file of this layout
_RAW = range(-512, 512)  # a BGD value has 10 bits in the navigation message [OS-ICD, 5.1.5]


class GroupDelayScale(Enum):
    """Delay of E6 after E1 divided by the BGD value: γ − 1 [OS-ICD, 5.1.5] or 1 [SASLIB]."""

    OS_ICD = "os-icd"
    FILE_VALUE = "file-value"


_FACTOR = {GroupDelayScale.OS_ICD: GAMMA_E1_E6 - 1, GroupDelayScale.FILE_VALUE: 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupDelayConvention:
    """Convention of a BGD value: its scale and its sign; the default is the definition of [OS-ICD, 5.1.5].

    Attributes
    ----------
    scale
        Delay of E6 after E1 divided by the BGD value, without sign.
    sign
        +1 if a larger BGD makes E6 later, −1 if it makes E6 earlier.
    """

    scale: GroupDelayScale = GroupDelayScale.OS_ICD
    sign: int = 1

    def __post_init__(self) -> None:
        if self.sign not in (1, -1):
            raise ValueError(f"the sign of a group delay convention is 1 or -1, not {self.sign}")


OS_ICD_CONVENTION = GroupDelayConvention()


def inter_frequency_delay_s(bgd_s: float, convention: GroupDelayConvention = OS_ICD_CONVENTION) -> float:
    """Return T_R6 − T_R1, the delay of E6 after E1 at the satellite, in s.

    T_R6 − T_R1 = (γ − 1) · BGD(E1,E6) in the default convention [OS-ICD, 5.1.5].
    """
    return convention.sign * _FACTOR[convention.scale] * bgd_s


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupDelayFile:
    """The content of a BGD file."""

    provider: str  # provider of the file, four letters or digits
    valid_from: GalileoTime  # time in the header in whole deciseconds
    delays: tuple[GroupDelay, ...]  # values of the satellites in the mask, in ascending order of SVID
    validity: bytes = bytes(6)  # 6 bytes of unknown meaning, kept for writing

    @property
    def name(self) -> str:
        """Name of the file, which begins like a unitary RECS name, because the pattern of the service is unknown."""
        return f"{self.provider}{BGD_INTERFACE_VERSION:02d}_{format_time_code(self.valid_from)}.BGD"


def parse_group_delay_file(data: bytes, path: Path, *, reference: GalileoTime | None = None) -> GroupDelayFile:
    """Return the fields of the BGD file whose content is `data`; error messages name `path`.

    `reference` is a time within ± 2048 weeks (39 years) of the header's time, and resolves the 12-bit week. Without
    `reference` the week is 0 to 4095.

    The function raises `InputFileError` if the file does not have the layout of this module, or a value is beyond
    ± 119 ns, the range of a BGD in the navigation message. The function raises `UnsupportedError` if the interface
    version is unknown.
    """
    if len(data) < _SHORTEST_BYTES:
        raise InputFileError(path, "length", f"{len(data)} bytes", f"at least {_SHORTEST_BYTES} bytes")
    provider, interface, week, atow, validity, mask, filling = _HEADER.unpack_from(data)
    if not re.fullmatch(rb"[A-Za-z0-9]{4}", provider):
        raise InputFileError(path, "byte 0: provider", provider, "four letters or digits, as a BGD file begins")
    if filling != _FILLING:
        raise InputFileError(path, "byte 36: filling", filling, "36 bytes 0x12, as a BGD file has")
    if interface != BGD_INTERFACE_VERSION:
        raise UnsupportedError(
            f"{path}: BGD interface version {interface} is not known, only {BGD_INTERFACE_VERSION} is"
        )
    deciseconds = int.from_bytes(atow, "big")
    if deciseconds >= DECISECONDS_PER_WEEK:
        raise InputFileError(path, "time of week", f"{deciseconds} ds", f"less than a week, {DECISECONDS_PER_WEEK} ds")
    valid_from = time_of_deciseconds(resolve_week(week % WEEK_MODULUS, reference), deciseconds)
    return GroupDelayFile(
        provider=provider.decode("ascii"),
        valid_from=valid_from,
        delays=tuple(
            GroupDelay(svid=svid, bgd_e1_e6_s=_value(data, svid, path) * LSB_S, valid_from=valid_from)
            for svid in _satellites(mask, path)
        ),
        validity=validity,
    )


def serialize_group_delay_file(file: GroupDelayFile) -> bytes:
    """Return the bytes of a BGD file with values rounded to 2⁻³² s.

    The function raises `ValueError` if a field does not fit the format.
    """
    slots, mask = np.zeros(MAX_SVID, "<i2"), np.zeros(160, np.uint8)
    for delay in file.delays:
        raw = round(delay.bgd_e1_e6_s / LSB_S)
        if raw not in _RAW or not 1 <= delay.svid <= MAX_SVID or mask[delay.svid - 1]:
            raise ValueError(f"{delay} does not fit in a BGD file: one value of ± 119 ns for each SVID 1 to {MAX_SVID}")
        slots[delay.svid - 1], mask[delay.svid - 1] = raw, 1
    exact = time_of_deciseconds(file.valid_from.week, deciseconds_of_week(file.valid_from))
    atow = deciseconds_of_week(exact).to_bytes(3, "big")
    provider = file.provider.encode("ascii")
    if not re.fullmatch(rb"[A-Za-z0-9]{4}", provider) or len(file.validity) != 6:
        raise ValueError(
            f"found provider {file.provider!r} and {len(file.validity)} bytes of validity, expected four letters or "
            "digits and 6 bytes"
        )
    header = _HEADER.pack(
        provider,
        BGD_INTERFACE_VERSION,
        exact.week % WEEK_MODULUS,
        atow,
        file.validity,
        np.packbits(mask).tobytes(),
        _FILLING,
    )
    return (header + slots.tobytes()).ljust(_TYPICAL_BYTES, b"\0")


def write_group_delay_file(delays: Sequence[GroupDelay], folder: Path) -> Path:
    """Write a BGD file into `folder` with delays that are all valid from one time, and return the path of the file."""
    ordered = tuple(sorted(delays, key=lambda delay: delay.svid))
    if len({delay.valid_from for delay in ordered}) != 1:
        raise ValueError("a BGD file holds one or more values, all valid from one time")
    file = GroupDelayFile(provider="GSCX", valid_from=ordered[0].valid_from, delays=ordered)
    path = folder / file.name
    path.write_bytes(serialize_group_delay_file(file))
    return path


def _satellites(mask: bytes, path: Path) -> tuple[int, ...]:
    svids = tuple(int(bit) + 1 for bit in np.flatnonzero(np.unpackbits(np.frombuffer(mask, np.uint8))))
    if svids and svids[-1] > MAX_SVID:
        raise InputFileError(path, "byte 16: satellite mask", f"SVID {svids[-1]}", f"SVID 1 to {MAX_SVID}")
    return svids


def _value(data: bytes, svid: int, path: Path) -> int:
    offset = _HEADER.size + 2 * (svid - 1)
    if offset + 2 > len(data):
        raise InputFileError(path, f"value of SVID {svid}", f"end of file at byte {len(data)}", f"2 bytes at {offset}")
    raw = int.from_bytes(data[offset : offset + 2], "little", signed=True)
    if raw not in _RAW:
        raise InputFileError(path, f"byte {offset}: value of SVID {svid}", raw, f"{_RAW[0]} to {_RAW[-1]}")
    return raw
