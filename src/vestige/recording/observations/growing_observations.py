"""Read E1 observations from a file that a receiver is still writing.

A line is read when its end is written. A RINEX epoch is complete when its last record is written. A CSV epoch is
complete when the next epoch begins, or when the file is marked as complete. After the header, a damaged line, or the
epoch of this line, is left out and reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from vestige.errors import InputFileError, VestigeError
from vestige.recording.observations.observation_epoch import EpochParser
from vestige.recording.observations.observation_file import FIRST_LINE, OBSERVATION_READERS, kind_of_line
from vestige.recording.text_lines import GrowingLines
from vestige.records.observation_epoch import ObservationEpoch


class GrowingObservations:
    """A growing file of E1 observations, for an `ObservationTrack`.

    The iterators stop at the present end of the file, and continue when the file has grown. The file need not exist
    yet. `warn` gets the fault of each damaged line.
    """

    def __init__(self, path: Path, *, warn: Callable[[VestigeError], None]) -> None:
        self.path = path
        self.warn = warn
        self.ended = False

    def __iter__(self) -> Iterator[ObservationEpoch]:
        """Return an iterator that may continue after it stopped."""
        return _GrowingEpochs(self)

    @property
    def n_bytes(self) -> int:
        """Size of the file in bytes, 0 before the file exists."""
        return self.path.stat().st_size if self.path.exists() else 0

    @property
    def begun(self) -> bool:
        """Whether the file exists and has a complete first line."""
        return self.path.exists() and GrowingLines(self.path).take() is not None

    def missing(self) -> InputFileError:
        """Return the fault of a file that does not exist, or has no complete first line yet."""
        found = "an empty file" if self.path.exists() else "no file"
        return InputFileError(self.path, "line 1", found, FIRST_LINE)

    def end(self) -> None:
        """Mark the file as complete, which also completes its last epoch."""
        self.ended = True


class _GrowingEpochs:
    def __init__(self, file: GrowingObservations) -> None:
        self._file = file
        self._lines = GrowingLines(file.path)
        self._parser: EpochParser | None = None
        self._finished = False

    def __iter__(self) -> Iterator[ObservationEpoch]:
        return self

    def __next__(self) -> ObservationEpoch:
        while (line := self._lines.take()) is not None:
            epoch = self._taken(*line)
            if epoch is not None:
                return epoch
        if self._file.ended and not self._finished and self._parser is not None:
            self._finished = True
            epoch = self._last(self._parser)
            if epoch is not None:
                return epoch
        raise StopIteration

    def _taken(self, number: int, line: str) -> ObservationEpoch | None:
        parser = self._parser or self._opened(line)
        self._parser = parser
        begun = parser.begun
        try:
            return parser.take(number, line)
        except VestigeError as error:
            if not begun:
                raise
            self._file.warn(error)
            return None

    def _opened(self, line: str) -> EpochParser:
        kind = kind_of_line(line)
        if kind is None:
            raise InputFileError(self._file.path, "line 1", line, FIRST_LINE)
        return OBSERVATION_READERS[kind][1](self._file.path)

    def _last(self, parser: EpochParser) -> ObservationEpoch | None:
        try:
            return parser.finish()
        except VestigeError as error:
            self._file.warn(error)
            return None
