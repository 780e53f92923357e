"""Store the progress of exhaustive searches in a log file, so that an interrupted search continues from this progress.

Each new log replaces the old log only after the new log is on the disk, so the log file is complete at any moment. The
log names the recording, the codes and the settings of the searches (`of`). So a search never continues from the
progress of another search. The log contains the progress of each search, by the name of the search.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from vestige.crypto.file_bytes import read_bytes
from vestige.errors import InputFileError
from vestige.output import replacement
from vestige.sample_processor.search.exhaustive_search import SearchState

EXPECTED_LOG = "the log of an exhaustive search"
_MAX_BYTES = 1 << 26  # largest size of a log file in bytes; the progress of one search takes some kB


@dataclass(frozen=True, slots=True, kw_only=True)
class _Content:
    of: dict[str, str | float]
    states: dict[str, SearchState]


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchLog:
    """Progress of exhaustive searches, and the log file in which the progress is stored."""

    path: Path
    of: Mapping[str, str | float]  # identity of the searches: recording, codes and settings as text and numbers
    states: dict[str, SearchState] = field(default_factory=dict)  # progress of each search by name

    @classmethod
    def open(cls, path: Path, of: Mapping[str, str | float]) -> SearchLog:
        """Return the log in a file, or an empty log if the file does not exist.

        The function raises `InputFileError` if the file is not a log of searches, or if the log has another identity
        than `of`.
        """
        if not path.exists():
            return cls(path=path, of=of)
        try:
            content = TypeAdapter(_Content).validate_python(json.loads(read_bytes(path, at_most=_MAX_BYTES)))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            place = ".".join(map(str, first["loc"]))[:80] or "content"
            raise InputFileError(path, place, first["input"], f"{EXPECTED_LOG}: {first['msg']}") from error
        except (ValueError, RecursionError) as error:
            raise InputFileError(path, "content", str(error), EXPECTED_LOG) from error
        for name, state in content.states.items():
            if not (state.blocks >= 0 and 0 <= state.done <= state.total):
                found = f"{state.blocks} blocks, {state.done} of {state.total} hypotheses"
                raise InputFileError(path, f"states.{name[:80]}", found, EXPECTED_LOG)
        for key in {**of, **content.of}:
            if content.of.get(key) != of.get(key):
                raise InputFileError(path, f"search of another {key}", content.of.get(key), of.get(key))
        return cls(path=path, of=of, states=content.states)

    def keep(self, name: str, state: SearchState) -> None:
        """Store the progress of a search under the name of the search, and write the log file."""
        self.states[name] = state
        content = {"of": dict(self.of), "states": {key: asdict(one) for key, one in self.states.items()}}
        with replacement(self.path) as part:
            part.write_text(json.dumps(content, indent=1) + "\n")
