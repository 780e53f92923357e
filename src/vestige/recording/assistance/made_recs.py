"""Make RECS for a recording whose E6-C was not encrypted, so that all processing steps can run on a real signal.

The transmitted E6-C chips (primary ⊕ secondary code) take the place of the encrypted code sequence. The transmitted
chips are encrypted under an OSNMA key, and become a RECS in the form that a server publishes. The times of transmission
are whole deciseconds, because a period of E6-C's secondary code starts at each decisecond. The processor reads the
files of these RECS like the files of a server. A test with such RECS cannot prove the secrecy of the chips, because
anybody knows the open code.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.recs_segment import LENGTHS, CipherMode, SegmentLength, decrypt, encrypt, key_time
from vestige.errors import VestigeError
from vestige.output import new_folder
from vestige.recording.assistance.assistance_files import KEYS_NAME, assistance_kind
from vestige.recording.assistance.assistance_writer import write_assistance
from vestige.recording.assistance.folder import read_assistance
from vestige.recording.recording import Recording
from vestige.recording.snapshots import ALL_SVIDS, svids_in_view
from vestige.records import Assistance, ChipSequence, EncryptedSegment, GroupDelay
from vestige.signals.codes import tiered_code
from vestige.signals.definitions import E6C
from vestige.signals.open_e6c import is_open_e6c
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

NOTE_NAME = "OPEN_CODE.txt"
OPEN_CODE = "these RECS contain the open E6-C code, which everybody knows: they prove nothing against a spoofer"


def transmit_times(
    first: GalileoTime, last: GalileoTime, *, travel_s: Iterable[float], duration_s: float, interval_s: float
) -> tuple[GalileoTime, ...]:
    """Return the times of transmission, in whole deciseconds, of segments that the samples contain for all satellites.

    The samples lie between the receiver-clock times `first` and `last`. `travel_s` are the apparent travel times from
    the satellites in s. `duration_s` is the duration of a segment, and `interval_s` is the time between two segments.
    """
    travel = tuple(travel_s)
    step = round(interval_s * 10)
    if step < 1 or abs(step - interval_s * 10) > 1e-9:
        raise ValueError(f"the interval between RECS must be a multiple of 0.1 s, not {interval_s}")
    earliest, latest = first + -min(travel), last + -(max(travel) + duration_s)
    tick = GalileoTime(earliest.week, earliest.second)
    ticks = int((earliest - tick) * 10) + 1
    times = []
    while (time := tick + ticks / 10) <= latest:
        exact = GalileoTime(time.week, time.second, round(time.fraction, 1) % 1.0)
        times.append(exact)
        ticks += step
    return tuple(times)


def make_segments(
    svids: Iterable[int],
    times: Iterable[GalileoTime],
    keys: Iterable[ValidatedKey],
    *,
    length: SegmentLength,
    key_delay: int = 0,
    cipher_mode: CipherMode = CipherMode.CBC,
) -> tuple[EncryptedSegment, ...]:
    """Return the RECS of every satellite at every time for which there is a key."""
    by_time = {key.time: key for key in keys}
    segments = []
    for time in times:
        key = by_time.get(key_time(time, key_delay))
        if key is None:
            continue
        for svid in svids:
            # a period of the secondary code starts at every decisecond of Galileo System Time [E6-CODES]
            chips = ChipSequence.of(
                svid=svid,
                transmit_time=time,
                chip_rate_hz=E6C.chip_rate_hz,
                chips=tiered_code(E6C, svid)[: length.n_chips],
            )
            segments.append(encrypt(chips, key.data, key_delay=key_delay, mode=cipher_mode))
    return tuple(segments)


def open_code_warning(
    folder: Path,
    segments: Iterable[EncryptedSegment],
    keys: Iterable[ValidatedKey],
    *,
    cipher_mode: CipherMode = CipherMode.CBC,
) -> str | None:
    """Return a warning about RECS of the open E6-C code, or None if no decrypted RECS contains this code.

    For each satellite the first RECS with a known key is decrypted. The warning names `folder`, the source of the RECS.
    """
    by_time = {key.time: key for key in keys}
    first: dict[int, EncryptedSegment] = {}
    for one in segments:
        if one.key_time in by_time:
            first.setdefault(one.svid, one)
    codes = (decrypt(one, by_time[one.key_time], mode=cipher_mode) for one in first.values())
    return f"{folder}: {OPEN_CODE}" if any(is_open_e6c(code.chips, code.svid) for code in codes) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeAssistance:
    """RECS and files of the assistance folder that `make_assistance` made."""

    segments: tuple[EncryptedSegment, ...]
    files: tuple[Path, ...]


def make_assistance(
    recording: Recording,
    *,
    keys_path: Path,
    output: Path,
    public_key: Path | None = None,
    merkle_tree: Path | None = None,
    duration_ms: int = 16,
    interval_s: float = 30.0,
    key_delay: int = 0,
    cipher_mode: CipherMode = CipherMode.CBC,
    svids: tuple[int, ...] = (),
    progress: Callable[[int, int], None] | None = None,
) -> MadeAssistance:
    """Make the assistance folder of a recording with open E6-C: RECS, zero group delays, keys, trust anchor and a note.

    The function raises `InputFileError` if the folder exists, or a file is not usable. The function raises
    `VestigeError` if no key can be validated, the recording has no E6 samples, `interval_s` is not a multiple of 0.1 s,
    no satellite is found, no segment fits into the recording, or no key belongs to the time of the recording.

    `keys_path` is the path of a key file, or of a file of navigation pages with OSNMA. The file at `keys_path` and the
    given files of trust anchors are copied into the folder. Without `svids` RECS are made for the satellites that are
    found on E1. `progress` is called with the number of satellites for which E1 was searched, and the number of all
    satellites.
    """
    with new_folder(output) as unfinished:
        name = KEYS_NAME if assistance_kind(keys_path) is None else keys_path.name
        for path, copy in ((keys_path, name), *((path, path.name) for path in (public_key, merkle_tree) if path)):
            shutil.copyfile(path, unfinished / copy)
        keys = read_assistance(unfinished, public_key=public_key, merkle_tree=merkle_tree, strict=True).assistance.keys
        segments = _segments_of(recording, keys, duration_ms, interval_s, key_delay, cipher_mode, svids, progress)
        first = min(segment.transmit_time for segment in segments)
        delays = tuple(
            GroupDelay(svid=svid, bgd_e1_e6_s=0.0, valid_from=first) for svid in sorted({one.svid for one in segments})
        )
        write_assistance(unfinished, Assistance(segments=segments, group_delays=delays))
        (unfinished / NOTE_NAME).write_text(f"{OPEN_CODE}\n")
    return MadeAssistance(segments=segments, files=tuple(sorted(path for path in output.iterdir())))


def _segments_of(
    recording: Recording,
    keys: tuple[ValidatedKey, ...],
    duration_ms: int,
    interval_s: float,
    key_delay: int,
    cipher_mode: CipherMode,
    svids: tuple[int, ...],
    progress: Callable[[int, int], None] | None,
) -> tuple[EncryptedSegment, ...]:
    """Return the RECS that fit into the recording and have a key."""
    if abs(interval_s * 10 - round(interval_s * 10)) > 1e-9:
        raise VestigeError(f"interval between RECS: found {interval_s} s, expected a multiple of 0.1 s")
    reader = recording.e6
    if reader is None:
        raise VestigeError(f"{recording.description.path}: no E6 samples, so no RECS can be made for it")
    seen = svids_in_view(recording, svids or ALL_SVIDS, progress=progress)
    if not seen:
        raise VestigeError(f"{recording.description.path}: no satellite is seen on E1, so no RECS can be timed")
    first, last = reader.start, reader.start + reader.duration_s
    travel_s = [one.pseudorange_m / SPEED_OF_LIGHT_MPS for one in seen.values()]
    length = next(length for length in LENGTHS if length.duration_ms == duration_ms)
    times = transmit_times(first, last, travel_s=travel_s, duration_s=duration_ms / 1e3, interval_s=interval_s)
    if not times:
        raise VestigeError(
            f"{recording.description.path}: {reader.duration_s:g} s of E6 are too short for a RECS of {duration_ms} ms "
            "from every satellite, sent at a multiple of 0.1 s; take a longer recording or a shorter RECS"
        )
    segments = make_segments(
        svids or sorted(seen), times, keys, length=length, key_delay=key_delay, cipher_mode=cipher_mode
    )
    if not segments:
        span = f"{keys[0].time} to {keys[-1].time}" if keys else "none"
        raise VestigeError(f"no OSNMA key falls into the time of the recording, {first} to {last}; keys: {span}")
    return segments
