"""Read the input of `vestige search`: the recording, its RECS, and the possible arrival times of the RECS."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vestige.cli.terminal import warn
from vestige.errors import VestigeError

if TYPE_CHECKING:
    from vestige.crypto.recs.recs_segment import CipherMode
    from vestige.recording.recording import Recording
    from vestige.recording.samples.sample_file import SampleReader
    from vestige.records import Assistance, ChipSequence
    from vestige.sample_processor.search.e1_jump import Jump
    from vestige.time import GalileoTime


def say_jump(jump: Jump) -> None:
    """Warn that a signal on E1 jumps to another code phase."""
    warn(
        f"E{jump.svid:02d} jumps by {jump.by_s * 1e6:+.1f} µs some {jump.at_s * 1e3:.0f} ms after the first "
        "sample: samples are missing there, or one signal takes the place of another"
    )


def opened_recording(path: Path, start: GalileoTime | None) -> Recording:
    """Open a recording, print its notes as warnings, and return the recording."""
    from vestige.recording.recording import open_recording

    recording = open_recording(path, start=start)
    for line in recording.notes:
        warn(line)
    return recording


def reader_of(recording: Recording, band: Any) -> SampleReader:
    """Return the reader of the samples of a band; raise `VestigeError` if the recording does not have the band."""
    reader = recording.reader(band)
    if reader is None:
        raise VestigeError(f"the recording has no {band.value} samples")
    return reader


def decrypted_recs(
    recording: Recording, folder: Path, svids: tuple[int, ...], around_s: float, mode: CipherMode
) -> tuple[list[ChipSequence], Assistance]:
    """Return the decrypted RECS of `svids` that may be in the samples, in order of transmission, and the assistance.

    The function raises `VestigeError` if there are no such RECS with a validated key.
    """
    from vestige.crypto.recs.recs_segment import decrypt
    from vestige.recording.assistance.folder import read_assistance
    from vestige.recording.snapshots import time_span

    found = read_assistance(
        folder, window=time_span(recording, uncertainty_s=around_s if math.isfinite(around_s) else 0.0), strict=False
    )
    e6 = recording.e6
    span = None if e6 is None else (e6.start, e6.start + e6.duration_s)
    for line in (*found.problems, *found.missing_for(span), *found.warnings):
        warn(line)
    keys = {key.time: key for key in found.assistance.keys}
    segments = [one for one in found.assistance.segments if one.svid in svids and one.key_time in keys]
    if not segments:
        raise VestigeError(f"{folder}: no RECS of these satellites with a validated key")
    return [decrypt(one, keys[one.key_time], mode=mode) for one in segments], found.assistance


def clock_bound_s(recording: Recording, uncertainty_s: float | None) -> float:
    """Return the upper limit of the clock's error in s; warn if there is no limit."""
    around_s = recording.description.time_uncertainty_s if uncertainty_s is None else uncertainty_s
    if math.isinf(around_s):
        warn(
            "the time tag's error has no upper limit (--uncertainty-s), "
            "so no signal can be proven to be older than the disclosure of its key"
        )
    return around_s


def arrival_window_in(e6: SampleReader, code: ChipSequence, around_s: float) -> tuple[GalileoTime, GalileoTime]:
    """Return the first and the last time in the samples at which the first chip may arrive.

    If the first chip cannot arrive in the samples, the two returned times are equal.
    """
    from vestige.acas_processor.searches.vestigial import arrival_window

    return arrival_window(code.transmit_time, around_s, e6) or (e6.start, e6.start)


def grouped_by_transmission(codes: Iterable[ChipSequence]) -> list[list[ChipSequence]]:
    """Return the RECS grouped by time of transmission, because a group is searched in the same samples."""
    groups: dict[GalileoTime, list[ChipSequence]] = {}
    for code in codes:
        groups.setdefault(code.transmit_time, []).append(code)
    return list(groups.values())
