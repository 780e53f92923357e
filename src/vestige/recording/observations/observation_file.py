"""Read E1 observation files of any format, and interpolate the observations to any time.

The first line of a file tells its format. Files are read epoch by epoch, so a day of observations needs no more memory
than a minute of observations.
"""

from __future__ import annotations

import itertools
import statistics
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from vestige.errors import InputFileError
from vestige.recording.observations.csv_observations import CsvParser, is_csv_observations
from vestige.recording.observations.interpolation import SAME_TIME_S, interpolate, is_final
from vestige.recording.observations.observation_epoch import EpochParser, read_epochs
from vestige.recording.observations.rinex_observations import RinexParser, is_rinex_observations
from vestige.recording.text_lines import numbered_lines
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

# format: (test of the first line, parser)
OBSERVATION_READERS: dict[str, tuple[Callable[[str], bool], Callable[[Path], EpochParser]]] = {
    "RINEX": (lambda line: is_rinex_observations(line) or line[60:].startswith("CRINEX VERS"), RinexParser),
    "CSV": (is_csv_observations, CsvParser),
}

FIRST_LINE = "RINEX observations, or CSV with gst_week, gst_second, svid, pseudorange_m"  # expected first line
GAP_INTERVALS = 2  # longest gap in intervals: one epoch may be missing, and a longer gap begins a new track
INTERVAL_EPOCHS = 16  # number of epochs used to find the interval


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservationFile:
    """File of E1 observations, whose iterators yield the epochs in time order."""

    path: Path
    kind: str

    def __iter__(self) -> Iterator[ObservationEpoch]:
        """Yield the epochs in time order.

        The function raises the errors of the parser of the file's format.
        """
        return read_epochs(self.path, OBSERVATION_READERS[self.kind][1](self.path))


def observation_kind(path: Path) -> str | None:
    """Return the format of the observation file `path`, or None if the file is no observation file."""
    try:
        line = next(numbered_lines(path), (1, ""))[1]
    except InputFileError:
        return None
    return kind_of_line(line)


def kind_of_line(line: str) -> str | None:
    """Return the format of an observation file with the first line `line`, or None."""
    return next((kind for kind, (recognise, _) in OBSERVATION_READERS.items() if recognise(line)), None)


def open_observations(path: Path) -> ObservationFile:
    """Return the observation file at `path`.

    The function raises `InputFileError` if the first line of the file is neither a RINEX observation header nor the
    header of a CSV table of observations.
    """
    kind = observation_kind(path)
    if kind is None:
        raise InputFileError(path, "line 1", next(numbered_lines(path), (1, "an empty file"))[1], FIRST_LINE)
    return ObservationFile(path=path, kind=kind)


class ObservationTrack:
    """E1 observations at any time from a file.

    While the requested times increase, the file is read in one pass. For a time whose epochs were dropped, the file is
    read again from the start.

    Parameters
    ----------
    file
        File of the observations. A file that still grows gives the epochs so far, and new epochs in later calls.
    max_gap_s
        Longest time in s over which to interpolate; by default twice the median interval between the first 16 epochs.
    """

    def __init__(self, file: Iterable[ObservationEpoch], *, max_gap_s: float | None = None) -> None:
        self._file = file
        self._stated_s = max_gap_s
        self._lead: list[ObservationEpoch] = []
        self._lead_epochs = iter(file)
        self._restart()

    @property
    def max_gap_s(self) -> float:
        """Longest time in s over which to interpolate; 0 while the interval is unknown."""
        if self._stated_s is not None:
            return self._stated_s
        self._lead += itertools.islice(self._lead_epochs, INTERVAL_EPOCHS - len(self._lead))
        steps = [after.time - before.time for before, after in itertools.pairwise(self._lead)]
        return GAP_INTERVALS * statistics.median(steps) + 1e-6 if steps else 0.0

    def _restart(self) -> None:
        self._epochs: Iterator[ObservationEpoch] = iter(self._file)
        self._window: deque[ObservationEpoch] = deque()
        self._dropped: GalileoTime | None = None

    def at(self, time: GalileoTime) -> dict[int, E1Observation]:
        """Return by SVID the observations that are interpolated to a receiver-clock time.

        The module `interpolation` describes the method.

        The function raises `InputFileError` if the part of the file that has to be read is damaged.
        """
        max_gap_s = self.max_gap_s
        self._read_around(time, 2 * max_gap_s)
        return interpolate(tuple(self._window), time, max_gap_s=max_gap_s)

    def settled(self, time: GalileoTime) -> bool:
        """Return whether the result of `at` for a time is final, even if the file grows.

        The function raises the errors of `at`.
        """
        max_gap_s = self.max_gap_s
        self._read_around(time, 2 * max_gap_s)
        return max_gap_s > 0 and is_final(tuple(self._window), time, max_gap_s=max_gap_s)

    def _read_around(self, time: GalileoTime, reach: float) -> None:
        """Read the epochs up to `reach` seconds before and after `time`, which `at` needs to interpolate values."""
        reach = max(reach, SAME_TIME_S)  # `reach` is 0 if the file has a single epoch, which gives no interval
        if self._dropped is not None and time - self._dropped <= reach:
            self._restart()
        while not self._window or self._window[-1].time - time <= reach:
            epoch = next(self._epochs, None)
            if epoch is None:
                break
            self._window.append(epoch)
            self._drop_before(time, reach)
        self._drop_before(time, reach)

    def _drop_before(self, time: GalileoTime, reach: float) -> None:
        while self._window and time - self._window[0].time > reach:
            self._dropped = self._window.popleft().time
