"""Read and write RECS files bit for bit, as the assistance server publishes them.

There are two kinds of RECS files. An *aggregated* file has the RECS of one satellite at equal intervals. The file has a
25-byte header, then the encrypted chips (the bodies) of all RECS. A *unitary* file has a single RECS behind a 16-byte
header. All numbers are big endian, and times count deciseconds. The kind of a file follows from its content, not from
its name. A name in the form of `vestige.crypto.recs.recs_name` must agree with the header.

The service's interface document is not public, so vestige makes these assumptions [SASLIB]:

* An aggregated body has a RECS at tSTART + i · RTBA for every i with i · RTBA < tDur. tSTART is the time of the first
  RECS, RTBA is the time between two RECS, and tDur is the time that the file covers.
* WN is the full week in the aggregated header (16 bits) and the week modulo 4096 in the unitary header (12 bits).
* The time of a RECS is the satellite time at which its first chip leaves the satellite. With RAND = 1 the header's time
  already includes the random offset.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from vestige.constants import MAX_SVID
from vestige.crypto.file_bytes import read_bytes
from vestige.crypto.recs.recs_name import (
    DECISECONDS_PER_WEEK,
    RecsName,
    deciseconds_of_week,
    parse_name,
    time_of_deciseconds,
)
from vestige.crypto.recs.recs_segment import LENGTH_BY_BYTES, LENGTH_BY_CHIPS, LENGTHS, WEEK_MODULUS, key_time
from vestige.errors import InputFileError, UnsupportedError
from vestige.records import EncryptedSegment
from vestige.time import GalileoTime

RECS_INTERFACE_VERSION = 1  # only known interface version of a RECS file [SASLIB]
MAX_PERIOD_DS = (1 << 16) - 1  # RTBA has 16 bits [SASLIB]
MAX_DURATION_DS = (1 << 24) - 1  # tDur has 24 bits [SASLIB]
# size in bytes of a file with the longest RECS in every second of a day
MAX_RECS_FILE_BYTES = 25 + 86_400 * max(length.n_bytes for length in LENGTHS)

# The fields are Provider, IntV, reserved, WN, ATOW, tDur, SVID, KDI, RAND, NChip, RTBA and FileVersion [SASLIB].
_AGGREGATED = struct.Struct(">8s B B H 3s 3s B B B B H B")
# The fields are Provider, IntV, reserved (4 bits) with WN (12 bits), ATOW, SVID, KDI, RAND, FileVersion and
# HeaderLength [SASLIB].
_UNITARY = struct.Struct(">4s B H 3s B B B B H")

_PROVIDER = re.compile(rb"[A-Za-z0-9]+")  # the provider becomes part of a file name


class RecsFileKind(Enum):
    """The two kinds of RECS file."""

    AGGREGATED = "aggregated"
    UNITARY = "unitary"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecsFile:
    """A RECS file, with every header field and the bodies.

    Attributes
    ----------
    provider
        Four letters or digits in a unitary file, up to eight letters or digits in an aggregated file.
    start
        Time of transmission of the first RECS, with the full week.
    svid
        SVID of the satellite, 1 to 36.
    key_delay
        KDI, 0 or 1.
    random_offset
        RAND, 1 if `start` includes a random offset, otherwise 0.
    n_chip_code
        Index into `vestige.crypto.recs.recs_segment.LENGTHS`.
    body
        Encrypted chips of all RECS, in the order of time.
    duration_ds
        tDur, the time that the file covers, in ds; 0 for a unitary file.
    period_ds
        RTBA, the time between two RECS, in ds; 0 for a unitary file.
    reserved
        Reserved bits, 8 bits in an aggregated header and 4 bits in a unitary header. The reserved bits are kept so that
        a file is written unchanged.
    """

    kind: RecsFileKind
    provider: str
    start: GalileoTime
    svid: int
    key_delay: int
    random_offset: int
    n_chip_code: int
    body: bytes
    duration_ds: int = 0
    period_ds: int = 0
    file_version: int = 1
    interface_version: int = RECS_INTERFACE_VERSION
    reserved: int = 0

    @property
    def name(self) -> RecsName:
        """Name of the file, in which tDur is rounded down to whole seconds. `str` returns the text of the name."""
        aggregated = self.kind is RecsFileKind.AGGREGATED
        return RecsName(
            start=self.start,
            svid=self.svid,
            key_delay=self.key_delay,
            random_offset=self.random_offset,
            provider="" if aggregated else self.provider,
            duration_s=self.duration_ds // 10,
            period_ds=self.period_ds,
            n_chip_code=self.n_chip_code if aggregated else 0,
            interface_version=self.interface_version,
            file_version=self.file_version,
        )

    @property
    def n_segments(self) -> int:
        """Number of RECS: 1 in a unitary file, else the number of RECS that begin within tDur."""
        return 1 if self.kind is RecsFileKind.UNITARY else -(-self.duration_ds // self.period_ds)

    @property
    def segments(self) -> tuple[EncryptedSegment, ...]:
        """The RECS in the order of time. Times after the end of the week are in the next week."""
        length, first = LENGTHS[self.n_chip_code], deciseconds_of_week(self.start)
        times = (time_of_deciseconds(self.start.week, first + i * self.period_ds) for i in range(self.n_segments))
        return tuple(
            EncryptedSegment(
                svid=self.svid,
                transmit_time=time,
                n_chips=length.n_chips,
                cipher=self.body[i * length.n_bytes : (i + 1) * length.n_bytes],
                key_time=key_time(time, self.key_delay),
                key_delay=self.key_delay,
                random_offset=self.random_offset,
            )
            for i, time in enumerate(times)
        )


def read_recs_file(path: Path, *, reference: GalileoTime | None = None) -> RecsFile:
    """Return the RECS file at `path`, of either kind.

    The function raises `InputFileError` if the file cannot be read, is not a RECS file, is truncated, or contradicts
    itself or its name. The function raises `UnsupportedError` if the interface version of the file is unknown.

    Parameters
    ----------
    path
        File to read. If the file's name has the form of a RECS name, the name must agree with the header.
    reference
        A time within ± 2048 weeks (39 years) of the RECS, which resolves the 12-bit week of a unitary file. If None,
        the file name resolves the week. If the file name is not a RECS name either, the week is taken as 0 to 4095,
        which is right until 2078.
    """
    return parse_recs_file(read_bytes(path, at_most=MAX_RECS_FILE_BYTES), path, reference=reference)


def parse_recs_file(data: bytes, path: Path, *, reference: GalileoTime | None = None) -> RecsFile:
    """Return the RECS file from `data`, the content of `path`; see `read_recs_file` for `reference` and the errors."""
    name = parse_name(path.name)
    if len(data) < _AGGREGATED.size:
        raise InputFileError(path, "length", f"{len(data)} bytes", f"at least {_AGGREGATED.size} bytes")
    # Byte 4 of a unitary header is the interface version. Byte 4 of an aggregated header belongs to the provider: a
    # letter, a digit or NUL.
    if data[4] in range(1, 32):
        file = _parse_unitary(data, path, reference or (name.start if name else None))
    else:
        file = _parse_aggregated(data, path)
    if fault := _fault(file):
        raise InputFileError(path, *fault)
    if name is not None and str(file.name).lower() != path.name.lower():
        raise InputFileError(path, "file name", path.name, f"{file.name} as the header says")
    return file


def has_recs_header(head: bytes) -> bool:
    """Return whether a file that begins with `head`, at least 25 bytes, looks like a RECS file."""
    if len(head) < _AGGREGATED.size:
        return False
    if head[4] == RECS_INTERFACE_VERSION:
        return _PROVIDER.fullmatch(head[:4]) is not None and head[14:16] == _UNITARY.size.to_bytes(2, "big")
    return head[8] == RECS_INTERFACE_VERSION and _PROVIDER.fullmatch(head[:8].rstrip(b"\0")) is not None


def serialize_recs_file(file: RecsFile) -> bytes:
    """Return the bytes of a RECS file.

    The function raises `ValueError` if a field does not fit the format or contradicts another field.
    """
    if fault := _fault(file):
        raise ValueError("{}: found {}, expected {}".format(*fault))
    exact = time_of_deciseconds(file.start.week, deciseconds_of_week(file.start))
    provider, atow = file.provider.encode("ascii"), deciseconds_of_week(exact).to_bytes(3, "big")
    if file.kind is RecsFileKind.UNITARY:
        week = file.reserved << 12 | exact.week % WEEK_MODULUS
        last = (file.svid, file.key_delay, file.random_offset, file.file_version, _UNITARY.size)
        return _UNITARY.pack(provider, file.interface_version, week, atow, *last) + file.body
    return (
        _AGGREGATED.pack(
            provider, file.interface_version, file.reserved, exact.week, atow, file.duration_ds.to_bytes(3, "big"),
            file.svid, file.key_delay, file.random_offset, file.n_chip_code, file.period_ds, file.file_version,
        )
        + file.body
    )  # fmt: skip


def write_recs_file(file: RecsFile, folder: Path) -> Path:
    """Write `file` under its own name into `folder` and return the path."""
    path = folder / str(file.name)
    path.write_bytes(serialize_recs_file(file))
    return path


def from_segments(segments: Sequence[EncryptedSegment], *, provider: str = "GSCX") -> RecsFile:
    """Return the file with `segments`: unitary for a single RECS, aggregated for several RECS at equal intervals.

    The function raises `ValueError` if the segments differ in satellite, length, KDI or RAND, or are not at equal
    intervals of whole deciseconds.
    """
    first = segments[0]
    epochs = [s.transmit_time.week * DECISECONDS_PER_WEEK + deciseconds_of_week(s.transmit_time) for s in segments]
    period = epochs[1] - epochs[0] if len(epochs) > 1 else 0
    alike = {(s.svid, s.n_chips, s.key_delay, s.random_offset) for s in segments}
    steady = epochs == [epochs[0] + i * period for i in range(len(epochs))]
    if len(alike) > 1 or not steady or (len(epochs) > 1 and period <= 0):
        raise ValueError("segments of one file share satellite, length, KDI and RAND and follow at equal intervals")
    return RecsFile(
        kind=RecsFileKind.AGGREGATED if period else RecsFileKind.UNITARY,
        provider=provider,
        start=first.transmit_time,
        svid=first.svid,
        key_delay=first.key_delay,
        random_offset=first.random_offset,
        n_chip_code=LENGTH_BY_CHIPS[first.n_chips].code,
        body=b"".join(s.cipher for s in segments),
        duration_ds=len(segments) * period,
        period_ds=period,
    )


def resolve_week(week: int, reference: GalileoTime | None) -> int:
    """Return the full week of a 12-bit week, nearest to `reference`; the 12-bit week itself without `reference`."""
    if reference is None:
        return week
    half = WEEK_MODULUS // 2
    full = reference.week + (week - reference.week + half) % WEEK_MODULUS - half
    return full if full >= 0 else full + WEEK_MODULUS


def _parse_unitary(data: bytes, path: Path, reference: GalileoTime | None) -> RecsFile:
    provider, interface, week, atow, svid, kdi, rand, version, header_length = _UNITARY.unpack_from(data)
    text = _provider(provider, path)
    _require_interface(interface, path)
    if header_length != _UNITARY.size:
        raise InputFileError(path, "byte 14: HeaderLength", header_length, _UNITARY.size)
    body = data[_UNITARY.size :]
    if len(body) not in LENGTH_BY_BYTES:
        raise InputFileError(path, "body", f"{len(body)} bytes", f"one RECS of {sorted(LENGTH_BY_BYTES)} bytes")
    return RecsFile(
        kind=RecsFileKind.UNITARY,
        provider=text,
        start=_start(resolve_week(week % WEEK_MODULUS, reference), atow, path),
        svid=svid,
        key_delay=kdi,
        random_offset=rand,
        n_chip_code=LENGTH_BY_BYTES[len(body)].code,
        body=body,
        file_version=version,
        interface_version=interface,
        reserved=week // WEEK_MODULUS,
    )


def _parse_aggregated(data: bytes, path: Path) -> RecsFile:
    unpacked = _AGGREGATED.unpack_from(data)
    provider, interface, reserved, week, atow, duration, svid, kdi, rand, n_chip, period, version = unpacked
    text = _provider(provider, path)
    _require_interface(interface, path)
    return RecsFile(
        kind=RecsFileKind.AGGREGATED,
        provider=text,
        start=_start(week, atow, path),
        svid=svid,
        key_delay=kdi,
        random_offset=rand,
        n_chip_code=n_chip,
        body=data[_AGGREGATED.size :],
        duration_ds=int.from_bytes(duration, "big"),
        period_ds=period,
        file_version=version,
        interface_version=interface,
        reserved=reserved,
    )


def _provider(field: bytes, path: Path) -> str:
    text = field.rstrip(b"\0")
    if not _PROVIDER.fullmatch(text):
        raise InputFileError(path, "byte 0: provider", field, "letters and digits, then NUL, as a RECS file begins")
    return text.decode("ascii")


def _require_interface(version: int, path: Path) -> None:
    if version != RECS_INTERFACE_VERSION:
        raise UnsupportedError(
            f"{path}: RECS interface version {version} is not known, only {RECS_INTERFACE_VERSION} is"
        )


def _start(week: int, atow: bytes, path: Path) -> GalileoTime:
    deciseconds = int.from_bytes(atow, "big")
    if deciseconds >= DECISECONDS_PER_WEEK:
        raise InputFileError(path, "ATOW", f"{deciseconds} ds", f"less than a week, {DECISECONDS_PER_WEEK} ds")
    return time_of_deciseconds(week, deciseconds)


def _fault(file: RecsFile) -> tuple[str, object, object] | None:
    """Return the first fault of a RECS file as field, found value and expected value; None without a fault."""
    unitary = file.kind is RecsFileKind.UNITARY
    fields = (
        ("provider: length", len(file.provider), range(4, 5) if unitary else range(1, 9)),
        ("IntV", file.interface_version, range(RECS_INTERFACE_VERSION, RECS_INTERFACE_VERSION + 1)),
        ("reserved", file.reserved, range(16 if unitary else 256)),
        ("WN", file.start.week, range(1 << 16)),
        ("tDur", file.duration_ds, range(1) if unitary else range(1, MAX_DURATION_DS + 1)),
        ("SVID", file.svid, range(1, MAX_SVID + 1)),
        ("KDI", file.key_delay, range(2)),
        ("RAND", file.random_offset, range(2)),
        ("NChip", file.n_chip_code, range(len(LENGTHS))),
        ("RTBA", file.period_ds, range(1) if unitary else range(1, MAX_PERIOD_DS + 1)),
        ("FileVersion", file.file_version, range(256)),
    )
    for place, value, allowed in fields:
        if value not in allowed:
            return (place, value, f"{allowed[0]} to {allowed[-1]}" if len(allowed) > 1 else allowed[0])
    if not _PROVIDER.fullmatch(file.provider.encode("ascii", "replace")):
        return ("provider", file.provider, "letters and digits")
    n_bytes = LENGTHS[file.n_chip_code].n_bytes
    if len(file.body) != file.n_segments * n_bytes:
        return ("body", f"{len(file.body)} bytes", f"{file.n_segments} RECS of {n_bytes} bytes as the header says")
    return None
