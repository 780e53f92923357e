"""Read an assistance folder that still receives files: RECS from the server, keys from the receiver.

The folder is read again when a file or the navigation message has changed, or when RECS of another time are needed. An
unchanged RECS or BGD file with unchanged signature files is read again only if RECS of another time are needed. The
RECS of the quarter of an hour after the first needed RECS are kept. If this quarter has no RECS, the RECS of a longer
time are kept. Later RECS are left out, even if the samples already cover a much longer time. Except for calls with
`at_once`, reading after changes takes at most a fifth of the time, even if the files are large. A file that another
process is still writing can look damaged, so a fault is reported only if the fault persists.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from vestige.errors import VestigeError
from vestige.recording.assistance.assistance_files import Contents, Settings
from vestige.recording.assistance.folder import AssistanceFolder, FileCache, read_assistance
from vestige.records import Assistance
from vestige.time import GalileoTime

# RECS are read up to `AHEAD_S` seconds ahead of the samples. RECS are read again when the samples come within
# `RENEWED_S` seconds of the last time up to which RECS were read, unless the next RECS is known.
AHEAD_S, RENEWED_S = 900.0, 60.0
BEHIND_S = 1.0
PATIENCE_S = 5.0  # time in s after which a fault is reported, longer than the time to write a file
REST = 4.0  # shortest pause after reading, as a multiple of the reading time

_Stamp = tuple[frozenset[tuple[Path, int, int]], int]


class LiveMessage(Protocol):
    """Navigation message that grows while a recording is processed."""

    path: Path  # path of the recording that contains the message

    @property
    def version(self) -> int:
        """Version of the content, a different number after each change."""

    def contents(self, settings: Settings) -> Contents | None:
        """Return the content that was decoded so far, or None if there is no content."""


class GrowingAssistance:
    """Assistance folder that still receives files.

    `message` is the navigation message that the receiver decodes itself. `warn` gets each persistent fault of a file at
    every call of `look`, so the same fault comes several times. All other parameters are the parameters of
    `read_assistance`.
    """

    def __init__(
        self,
        folder: Path,
        *,
        public_key: Path | None = None,
        merkle_tree: Path | None = None,
        certificates: Sequence[Path] = (),
        message: LiveMessage | None = None,
        warn: Callable[[VestigeError], None],
    ) -> None:
        self.path = folder
        self._message = message
        self._trust = {"public_key": public_key, "merkle_tree": merkle_tree}
        self._certificates = certificates
        self._warn = warn
        self._cache: FileCache = {}
        self._stamp: _Stamp | None = None
        self._window = (GalileoTime(0, 1), GalileoTime(0, 0))  # empty window, because the end lies before the start
        self._not_before_s = 0.0
        self._wrong: dict[str, tuple[float, VestigeError]] = {}  # time since which each fault persists, and the fault
        self.found = AssistanceFolder(assistance=Assistance(), files=(), problems=(), missing=())

    @property
    def until(self) -> GalileoTime:
        """Time up to which RECS were read; later RECS may be in the folder, but are not in `found`."""
        return self._window[1]

    def look(self, first: GalileoTime, last: GalileoTime, *, at_once: bool = False) -> bool:
        """Update `found` for the RECS from `first` to `last`, and return whether changed files or messages were read.

        If a file changes soon after the last reading, the change is read in a later call. With `at_once` the change is
        read in this call.

        The function raises `VestigeError` for the same reasons as `read_assistance`.
        """
        now_s = time.monotonic()
        stamp = self._files()
        changed = stamp != self._stamp and (at_once or now_s >= self._not_before_s)
        if changed or not self._covers(first, last):
            ahead_s = AHEAD_S
            if self._covers(first, last):
                self._read(self._window)
            else:
                self._read((first + -BEHIND_S, first + ahead_s))
            while not self._covers(first, last):  # the folder has no RECS in the window, so the window grows
                ahead_s *= 4
                self._read((first + -BEHIND_S, first + ahead_s))
            self._not_before_s = now_s + (1 + REST) * (time.monotonic() - now_s)
            changed, self._stamp = stamp != self._stamp, stamp
            self._wrong = {
                str(problem): self._wrong.get(str(problem), (now_s, problem)) for problem in self.found.problems
            }
        for since_s, problem in self._wrong.values():
            if now_s - since_s >= PATIENCE_S:
                self._warn(problem)
        return changed

    def _covers(self, first: GalileoTime, last: GalileoTime) -> bool:
        """Return whether the known RECS include the first RECS after `first`, or all RECS until after `last`."""
        since, until = self._window
        next_ones = (one for one in self.found.assistance.segments if one.transmit_time > first)
        return since <= first and (
            until - last >= RENEWED_S or any(until - one.transmit_time >= BEHIND_S for one in next_ones)
        )

    def _read(self, window: tuple[GalileoTime, GalileoTime]) -> None:
        self.found = read_assistance(
            self.path,
            public_key=self._trust["public_key"],
            merkle_tree=self._trust["merkle_tree"],
            certificates=self._certificates,
            window=window,
            cache=self._cache,
            message=None if self._message is None else (self._message.path, self._message.contents),
        )
        self._window = window

    def tell(self) -> None:
        """Warn of all present faults now, including faults that have not persisted for `PATIENCE_S`."""
        for _, problem in self._wrong.values():
            self._warn(problem)

    def _files(self) -> _Stamp:
        """Return a value that changes if the message, or a file in the folder or its direct subfolders, changes."""
        found = set()
        for path in (*self.path.glob("*"), *self.path.glob("*/*")):
            try:
                state = path.stat()
            except OSError:  # the file was removed after the listing
                continue
            found.add((path, state.st_size, state.st_mtime_ns))
        return frozenset(found), 0 if self._message is None else self._message.version
