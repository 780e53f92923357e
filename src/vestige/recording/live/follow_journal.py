"""Keep the journal of a receiver that follows a recording, so that an interrupted receiver can continue.

`verdicts.jsonl` has one line for each verdict, each position and each change of state. `state.json` contains the number
of valid bytes in `verdicts.jsonl` and the SHA-256 of these bytes. `state.json` also contains the last snapshot and the
receiver's state, with a second SHA-256. `state.json` is replaced as a whole after the lines were written. If a run is
killed between the two writes, the newest lines are not valid yet. The next run cuts the invalid lines off, processes
the snapshot again from the stored state, and writes the lines again. No line is lost, and no line appears twice. If the
valid lines or the state were changed, the journal raises an error and cuts nothing off.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError

from vestige.acas_processor.monitoring.state import ReceiverState
from vestige.crypto.file_bytes import open_file, read_bytes
from vestige.errors import InputFileError
from vestige.folder_lock import only_writer
from vestige.output import check_output, naming, replacement
from vestige.time import GalileoTime

LINES, STATE = "verdicts.jsonl", "state.json"
FORMAT = 3
_MAX_BYTES = 1 << 24

_BLOCK_BYTES = 1 << 20
_Count = Annotated[int, Field(ge=0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowProgress:
    """Progress in following a recording: the last snapshot, and the receiver state after this snapshot."""

    index: _Count  # number of the last snapshot
    sent: GalileoTime  # time of transmission of the snapshot's RECS
    state: ReceiverState  # receiver state after the snapshot
    time_tag_error_s: float = 0.0  # error of the samples' time tag in s, positive if ahead of Galileo System Time


@dataclass(frozen=True, slots=True, kw_only=True)
class _State:
    format: int
    settings: dict[str, str]
    n_bytes: _Count
    sha256: str  # hash of the first `n_bytes` bytes
    progress: FollowProgress | None
    progress_sha256: str  # hash of `progress` as JSON


_PROGRESS = TypeAdapter(FollowProgress | None)


def _hash_of(progress: FollowProgress | None) -> str:
    """Return the SHA-256 of `progress` as JSON, which shows whether a number was changed by hand."""
    return hashlib.sha256(json.dumps(_PROGRESS.dump_python(progress, mode="json")).encode()).hexdigest()


class FollowJournal:
    """Context manager of a journal folder that is open for a single writer.

    `settings` has the name and the text of each setting on which the verdicts depend. A folder with other settings is
    refused.

    The constructor raises `InputFileError` if the folder contains other files, was made with other settings, is
    damaged, or is in use.
    """

    def __init__(self, folder: Path, settings: Mapping[str, str]) -> None:
        self._folder, self._settings = folder, dict(settings)
        self._adapter = TypeAdapter(_State)
        with ExitStack() as held:
            self._lock = held.enter_context(only_writer(folder))
            self.progress, self._n_bytes, self._hash = self._opened()
            check_output(folder / LINES, ())  # a link to another file is refused
            self._lines = held.enter_context((folder / LINES).open("ab"))
            self._lines.truncate(self._n_bytes)
            self._held = held.pop_all()

    def _opened(self) -> tuple[FollowProgress | None, int, hashlib._Hash]:
        if not (self._folder / STATE).exists():
            if any(not path.name.startswith(f".{STATE}") for path in self._folder.iterdir()):
                expected = f"a folder that is empty, or has a {STATE}"
                raise InputFileError(self._folder, "folder", "files of another origin", expected)
            self._keep(0, hashlib.sha256(), None)
        state = self._read()
        found, left = hashlib.sha256(), state.n_bytes
        if left:
            with open_file(self._folder / LINES) as lines, naming(self._folder / LINES):
                while left and (block := lines.read(min(left, _BLOCK_BYTES))):
                    found.update(block)
                    left -= len(block)
        if left or found.hexdigest() != state.sha256:
            what = f"{state.n_bytes - left} bytes" if left else f"other contents in its first {state.n_bytes} bytes"
            expected = f"{state.n_bytes} bytes as they were written; put the file back, or use another folder for -o"
            raise InputFileError(self._folder / LINES, "lines", what, expected)
        return state.progress, state.n_bytes, found

    def _read(self) -> _State:
        path = self._folder / STATE
        try:
            content = json.loads(read_bytes(path, at_most=_MAX_BYTES))
            if isinstance(content, dict) and content.get("format") != FORMAT:
                raise InputFileError(path, "format", content.get("format"), FORMAT)
            state = self._adapter.validate_python(content)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            place = ".".join(map(str, first["loc"]))[:80] or "content"
            raise InputFileError(path, place, first["input"], first["msg"]) from error
        except (ValueError, RecursionError) as error:
            raise InputFileError(path, "content", str(error), "JSON") from error
        if _hash_of(state.progress) != state.progress_sha256:
            expected = "the state as it was written; put the file back, or use another folder for -o"
            raise InputFileError(path, "progress", "other contents", expected)
        for name in sorted(state.settings.keys() | self._settings.keys()):
            then, now = state.settings.get(name, "nothing"), self._settings.get(name, "nothing")
            if then != now:
                raise InputFileError(path, name, now, f"{then}, with which this folder was begun")
        return state

    def record(self, lines: Sequence[str], progress: FollowProgress) -> None:
        """Store the lines of a snapshot and the progress.

        After an interruption, either lines and progress are both valid, or neither lines nor progress are valid.
        """
        data = "".join(f"{line}\n" for line in lines).encode()
        with naming(self._folder / LINES):
            self._lines.write(data)
            self._lines.flush()
            os.fsync(self._lines.fileno())
        self._n_bytes += len(data)
        self._hash.update(data)
        self._keep(self._n_bytes, self._hash, progress)
        self.progress = progress

    def _keep(self, n_bytes: int, hash_of_lines: hashlib._Hash, progress: FollowProgress | None) -> None:
        state = _State(
            format=FORMAT,
            settings=self._settings,
            n_bytes=n_bytes,
            sha256=hash_of_lines.hexdigest(),
            progress=progress,
            progress_sha256=_hash_of(progress),
        )
        # `json.dumps` writes an infinite limit as `Infinity`, which `json.loads` reads as infinite
        text = json.dumps(self._adapter.dump_python(state, mode="json"))
        with replacement(self._folder / STATE) as part:
            part.write_text(text, encoding="utf-8")
        os.fsync(self._lock)

    def __enter__(self) -> FollowJournal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with naming(self._folder / LINES):
            self._held.close()
