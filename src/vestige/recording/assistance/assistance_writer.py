"""Write assistance folders for simulations, and for RECS that were made from a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

from vestige.crypto.keys.key_file import write_key_file
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.recs import group_delay, recs_file
from vestige.crypto.recs.recs_name import DECISECONDS_PER_WEEK, deciseconds_of_week
from vestige.recording.assistance.assistance_files import KEYS_NAME
from vestige.recording.assistance.receiver_corrections import write_hardware_bias, write_ionosphere
from vestige.records import Assistance, EncryptedSegment
from vestige.time import GalileoTime


def write_assistance(
    folder: Path,
    assistance: Assistance,
    *,
    roots: Sequence[RootKey] = (),
    alerts: Sequence[GalileoTime] = (),
) -> tuple[Path, ...]:
    """Write `assistance` into `folder` as the server and the receiver would, and return the files.

    Successive RECS of a satellite at equal intervals become an aggregated file, and a single RECS becomes a unitary
    file. A hardware bias of zero and an empty set of ionospheric delays are not written. A reader takes a missing bias
    or delay as zero.

    Parameters
    ----------
    folder
        The folder, which is made if it does not exist. Existing files are overwritten.
    assistance
        RECS, group delays and keys to write. Group delays are rounded to 2⁻³² s.
    roots
        Verified root keys to which the keys lead; at least one root key if there are keys.
    alerts
        Subframes in which an alert message was verified.
    """
    if assistance.keys and not roots:
        raise ValueError("found keys without root keys, expected in `roots` the root keys to which they lead")
    written = write_recs(folder, assistance.segments)
    delays = sorted(assistance.group_delays, key=lambda delay: (delay.valid_from, delay.svid))
    for _, same_time in groupby(delays, key=lambda delay: delay.valid_from):
        written.append(group_delay.write_group_delay_file(list(same_time), folder))
    if assistance.keys:
        write_key_file(folder / KEYS_NAME, assistance.keys, roots, alerts)
        written.append(folder / KEYS_NAME)
    if assistance.hardware_bias_e1_e6_s:
        written.append(write_hardware_bias(folder, assistance.hardware_bias_e1_e6_s))
    if assistance.ionosphere_e1_m:
        written.append(write_ionosphere(folder, assistance.ionosphere_e1_m))
    return tuple(written)


def write_recs(folder: Path, segments: Sequence[EncryptedSegment]) -> list[Path]:
    """Write RECS into `folder` as the server would, and return the files.

    Parameters
    ----------
    folder
        The folder, which is made if it does not exist. Existing files are overwritten.
    segments
        RECS of any satellites and times.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [recs_file.from_segments(run) for run in _runs(segments)]
    if len({str(file.name) for file in files}) < len(files):
        raise ValueError(
            "unitary RECS of one satellite and time, but of several lengths, would have the same file name"
        )
    return [recs_file.write_recs_file(file, folder) for file in files]


def _runs(segments: Sequence[EncryptedSegment]) -> Iterator[list[EncryptedSegment]]:
    """Yield the segments of each file, at most as many as the header of a file can count.

    The segments of a file are at equal intervals, and have the same satellite, length, key delay and random offset.
    """

    def alike(segment: EncryptedSegment) -> tuple[int, int, int, int]:
        return segment.svid, segment.n_chips, segment.key_delay, segment.random_offset

    ordered = sorted(segments, key=lambda segment: (alike(segment), segment.transmit_time))
    for _, group in groupby(ordered, key=alike):
        run: list[EncryptedSegment] = []
        epochs: list[int] = []
        for segment in group:
            time = segment.transmit_time
            epoch = time.week * DECISECONDS_PER_WEEK + deciseconds_of_week(time)
            if run and not _fits(epochs, epoch):
                yield run
                run, epochs = [], []
            run.append(segment)
            epochs.append(epoch)
        yield run


def _fits(epochs: Sequence[int], epoch: int) -> bool:
    """Return whether `epoch` continues the equally spaced `epochs` (in deciseconds) within the limits of a header."""
    period = epoch - epochs[-1]
    if not 0 < period <= recs_file.MAX_PERIOD_DS or (len(epochs) + 1) * period > recs_file.MAX_DURATION_DS:
        return False
    return len(epochs) == 1 or period == epochs[1] - epochs[0]
