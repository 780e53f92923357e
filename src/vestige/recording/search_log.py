"""What exhaustive searches have found so far, in a file: no interruption loses it, and the same search goes on from it.

The file is replaced as a whole, after the new one is on the disk, so it is complete at any moment. It holds what
identifies the searches (`of`), so that nobody goes on with another one's state, and one state for each name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from vestige.errors import InputFileError
from vestige.output import replacement
from vestige.sample_processor.search.exhaustive_search import SearchState
from vestige.sample_processor.search.peak import Peak
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchLog:
    """The states of searches, and the file that keeps them.

    Attributes
    ----------
    path
        The file.
    of
        What identifies the searches: recording, codes, settings; text and numbers.
    states
        By name.
    """

    path: Path
    of: Mapping[str, str | float]
    states: dict[str, SearchState] = field(default_factory=dict)

    @classmethod
    def open(cls, path: Path, of: Mapping[str, str | float]) -> SearchLog:
        """Return the log of a file, an empty one if there is no such file.

        Raises
        ------
        InputFileError
            If the file is something else, or of other searches.
        """
        if not path.exists():
            return cls(path=path, of=of)
        try:
            content = json.loads(path.read_bytes())
            found, states = dict(content["of"]), {name: _state(one) for name, one in content["states"].items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputFileError(path, "content", error, "what an exhaustive search has kept") from error
        for key in {**of, **found}:
            if found.get(key) != of.get(key):
                raise InputFileError(path, f"search of another {key}", found.get(key), of.get(key))
        return cls(path=path, of=of, states=states)

    def keep(self, name: str, state: SearchState) -> None:
        """Take over a state, and write the file."""
        self.states[name] = state
        content = {"of": dict(self.of), "states": {key: asdict(one) for key, one in self.states.items()}}
        with replacement(self.path) as part:
            part.write_text(json.dumps(content, indent=1) + "\n")


def _state(content: dict[str, Any]) -> SearchState:
    peaks = tuple(Peak(**{**one, "start_time": GalileoTime(**one["start_time"])}) for one in content["peaks"])
    state = SearchState(**{**content, "peaks": peaks, "block_start": GalileoTime(**content["block_start"])})
    if not (isinstance(state.blocks, int) and state.blocks >= 0 and 0 <= state.done <= state.total):
        raise ValueError(f"no state of a search: {state.blocks} blocks, {state.done} of {state.total} hypotheses")
    return state
