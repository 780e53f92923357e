"""Read scenario files, and make the JSON schema of scenario files."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.recording import RecordingScenario
from vestige.scenario.toml.renamed_keys import with_new_names
from vestige.scenario.toml.toml_file import overridden, read_toml, validated

Scenario = RecordingScenario | CampaignScenario
_ADAPTER: TypeAdapter[Any] = TypeAdapter(Annotated[Scenario, Field(discriminator="kind")])


def load_scenario(path: Path | str, settings: Iterable[str] = ()) -> Scenario:
    """Return the scenario that a TOML file describes.

    Parameters
    ----------
    path
        Path of the file.
    settings
        Values that replace values of the file, each as `table.key=value`, as for `vestige run --set`.

    Returns
    -------
    CampaignScenario | RecordingScenario
        Scenario of the kind that the file names.

    Raises
    ------
    InputFileError
        If the file cannot be read, is not TOML, or does not describe a valid scenario. The message gives the position
        of the error in the file.
    VestigeError
        If a setting cannot be applied to the file.

    Examples
    --------
    >>> import vestige as vs
    >>> scenario = vs.load_scenario("scenarios/quick.toml", ["receiver.cn0_dbhz=37"])
    >>> scenario.epochs, scenario.receiver.cn0_dbhz
    (20000, 37.0)
    """
    path = Path(path)
    scenario: Scenario = validated(_ADAPTER, with_new_names(overridden(read_toml(path), settings)), path)
    return scenario


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema with which an editor checks scenario files."""
    result: dict[str, Any] = _without_infinities(_ADAPTER.json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "vestige scenario"} | result


def _without_infinities(schema: Any) -> Any:
    """Return a JSON schema without infinite defaults, which JSON cannot express."""
    if isinstance(schema, dict):
        return {
            key: _without_infinities(value)
            for key, value in schema.items()
            if not (key == "default" and isinstance(value, float) and not math.isfinite(value))
        }
    return [_without_infinities(value) for value in schema] if isinstance(schema, list) else schema
