"""An assistance folder into which files still come: RECS from the server, keys from the receiver.

The folder is read again when something in it has changed, RECS and BGD files only if they have changed themselves, and
of the RECS only those of the next quarter of an hour are kept, also where the recording is far ahead. Reading takes a
fifth of the time at most, however large the files are. What is wrong with a file is no problem as long as it may be
half written: it is told when it stays so.
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

AHEAD_S, RENEWED_S = 900.0, 60.0  # RECS are read so far ahead, and again when less than the second is left
BEHIND_S = 1.0
PATIENCE_S = 5.0  # longer than writing a file takes
REST = 4.0  # times as long as reading took

_Stamp = tuple[frozenset[tuple[Path, int, int]], int]


class LiveMessage(Protocol):
    """A message that grows."""

    path: Path  # file of the recording that it is from

    @property
    def version(self) -> int:
        """Another number when it holds something new."""

    def contents(self, settings: Settings) -> Contents | None:
        """Return what it holds by now; None for nothing."""


class GrowingAssistance:
    """Assistance folder that still receives files.

    `message` is the navigation message that the receiver decodes itself. `warn` is called once with each fault of a
    file. All other parameters are those of `read_assistance`.
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
        self._remembered: FileCache = {}
        self._stamp: _Stamp | None = None
        self._window = (GalileoTime(0, 1), GalileoTime(0, 0))  # none
        self._not_before_s = 0.0
        self._wrong: dict[str, tuple[float, VestigeError]] = {}  # since when
        self.found = AssistanceFolder(assistance=Assistance(), files=(), problems=(), missing=())

    @property
    def until(self) -> GalileoTime:
        """Time up to which RECS were read; those after it are not in `found`, though they may be in the folder."""
        return self._window[1]

    def look(self, first: GalileoTime, last: GalileoTime, *, at_once: bool = False) -> bool:
        """Bring `found` up to date, for RECS from one time to another; return whether something changed.

        A change soon after reading is taken in later, unless it has to be `at_once`.

        Raises `VestigeError` as `read_assistance`.
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
            while not self._covers(first, last):  # no RECS for long
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
        """Return whether the RECS that were read hold the next one after `first`, or all until after `last`."""
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
            remembered=self._remembered,
            message=None if self._message is None else (self._message.path, self._message.contents),
        )
        self._window = window

    def tell(self) -> None:
        """Warn of what is wrong now, without patience."""
        for _, problem in self._wrong.values():
            self._warn(problem)

    def _files(self) -> _Stamp:
        """Return what changes when a file of the folder, or one folder below, or the message changes."""
        found = set()
        for path in (*self.path.glob("*"), *self.path.glob("*/*")):
            try:
                state = path.stat()
            except OSError:  # gone since it was listed
                continue
            found.add((path, state.st_size, state.st_mtime_ns))
        return frozenset(found), 0 if self._message is None else self._message.version
