"""Positions of a recording that grows as NMEA 0183, into a file or on standard output."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import click

from vestige.navigation.nmea import NmeaFix, sentences
from vestige.output import naming

if TYPE_CHECKING:
    from vestige.acas_processor.processor import Step
    from vestige.time import GalileoTime

NMEA_STDOUT = Path("-")


class NmeaLog:
    """Writes two sentences for each snapshot at once."""

    def __init__(self, stream: TextIO | None, path: Path) -> None:
        self._stream, self._path = stream, path

    def write(self, step: Step, time: GalileoTime, *, verified: frozenset[int] | None) -> None:
        """Write what a snapshot says.

        Parameters
        ----------
        step
            The processor's answer to the snapshot.
        time
            Time of the snapshot in Galileo System Time.
        verified
            Satellites whose orbits are authentic; None for all. A position that rests on others is no fix.
        """
        if self._stream is None:
            return
        found, fix = next(iter(step.positions), None), None
        if found is not None and (verified is None or verified.issuperset(found.svids)):
            fix = NmeaFix(
                latitude_deg=found.latitude_deg,
                longitude_deg=found.longitude_deg,
                height_m=found.height_m,
                n_satellites=len(found.svids),
            )
        with naming(self._path):
            self._stream.write("".join(f"{line}\r\n" for line in sentences(time.utc, fix)))
            self._stream.flush()


@contextmanager
def nmea_log(path: Path | None, *, as_json: bool) -> Iterator[NmeaLog]:
    """Yield the log: of a file, to which it appends, or of standard output, all else going to standard error then.

    Raises `click.UsageError` if standard output is for JSON already. Raises `InputFileError` if the file cannot be
    written.
    """
    if path is None:
        yield NmeaLog(None, NMEA_STDOUT)
    elif path == NMEA_STDOUT:
        if as_json:
            raise click.UsageError("--nmea -: standard output is for --json; name a file for one of them")
        stream = sys.stdout
        with redirect_stdout(sys.stderr):
            yield NmeaLog(stream, path)
    else:
        with naming(path):
            file = path.open("a", encoding="ascii", newline="")
        with file:
            yield NmeaLog(file, path)
