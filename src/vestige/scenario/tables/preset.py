"""Replace a preset in a table, such as `preset = "2014"`, by all numbers of the model that the preset names.

Other keys of the table replace single values of the preset. The preset is replaced before the table is validated, so
the scenario contains the numbers and never the name of the preset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from vestige.scenario.toml.toml_file import InconsistentSettingsError

_LOWEST_DEG, _HIGHEST_DEG = 5.0, 90.0  # lowest and highest elevation of a preset in degrees


@dataclass(frozen=True, slots=True, eq=False)
class Presets:
    """Annotation of a scenario key whose table may name a preset in place of the numbers of a model.

    `named` gives the model for each value of the key `preset`. `at_elevation` gives the model for a value of the key
    `elevation_deg`.
    """

    named: Mapping[str, Callable[[], Any]]
    at_elevation: Callable[[float], Any] | None = None

    def expand(self, table: Any) -> Any:
        """Return a table with its preset replaced by numbers; return any value without a preset unchanged.

        The function raises `InconsistentSettingsError` if the preset does not exist, the elevation is not a number from
        5 to 90°, or the table has both `preset` and `elevation_deg`.
        """
        if not isinstance(table, dict) or not {"preset", *self._elevation} & table.keys():
            return table
        rest = {key: value for key, value in table.items() if key not in {"preset", *self._elevation}}
        if len(rest) + 1 < len(table):
            raise InconsistentSettingsError(
                "preset", "elevation_deg as well", "one of the two, because both choose a model"
            )
        return asdict(self._model(table)) | rest

    def _model(self, table: Mapping[str, Any]) -> Any:
        if "preset" in table:
            if not (isinstance(table["preset"], str) and table["preset"] in self.named):
                raise InconsistentSettingsError("preset", table["preset"], ", ".join(self.named))
            return self.named[table["preset"]]()
        degrees = table["elevation_deg"]
        number = isinstance(degrees, (int, float)) and not isinstance(degrees, bool)
        if not (number and _LOWEST_DEG <= degrees <= _HIGHEST_DEG):
            raise InconsistentSettingsError(
                "elevation_deg", degrees, f"a number from {_LOWEST_DEG:g} to {_HIGHEST_DEG:g}"
            )
        assert self.at_elevation is not None  # noqa: S101  (the key is known)
        return self.at_elevation(degrees)

    @property
    def _elevation(self) -> tuple[str, ...]:
        return () if self.at_elevation is None else ("elevation_deg",)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.expand, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        reference = handler(schema)
        model = handler.resolve_ref_schema(reference)
        if "properties" not in model:  # `OrOwn` makes a schema with two alternatives
            model = handler.resolve_ref_schema(model["oneOf"][0])
        keys: dict[str, Any] = {"preset": {"enum": list(self.named), "title": "Preset", "type": "string"}}
        if self.at_elevation is not None:
            span = {"minimum": _LOWEST_DEG, "maximum": _HIGHEST_DEG}
            keys["elevation_deg"] = {"title": "Elevation Deg", "type": "number", **span}
        if "preset" not in model["properties"]:
            model["properties"] |= keys
            model["oneOf"] = [
                *({"required": [key]} for key in keys),
                {"required": model.pop("required", []), "not": {"anyOf": [{"required": [key]} for key in keys]}},
            ]
        return reference
