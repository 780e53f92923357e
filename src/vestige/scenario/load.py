"""From a scenario file to the scenario that it describes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from vestige.scenario.recording import RecordingScenario
from vestige.scenario.toml_file import overridden, read_toml, validated

Scenario = RecordingScenario
_ADAPTER: TypeAdapter[Any] = TypeAdapter(Annotated[RecordingScenario, Field()])


def load_scenario(path: Path | str, settings: Iterable[str] = ()) -> RecordingScenario:
    """Return the scenario in a TOML file.

    Parameters
    ----------
    path
        The file.
    settings
        Values that replace those of the file, `table.key=value` each.

    Raises
    ------
    InputFileError
        If the file is not TOML, has an unknown key, or a value outside its range; with the place.
    """
    path = Path(path)
    scenario: RecordingScenario = validated(_ADAPTER, overridden(read_toml(path), settings), path)
    return scenario
