"""Read tables of a scenario whose kind is a class that the user wrote, such as `kind = "my_module:MyAttack"`.

The class is a frozen dataclass, and all keys of the table except `kind` are fields of the class. These keys are checked
like the keys of vestige's own kinds. An unknown key, a missing key or a value of the wrong type gives a one-line error
message with the position in the file.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, is_dataclass
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    PlainSerializer,
    PlainValidator,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    create_model,
)
from pydantic_core import CoreSchema, core_schema

from vestige.own_parts import OwnPartError, is_own, kind_of, part
from vestige.scenario.toml.toml_file import OURS, OWN, InconsistentSettingsError, Section, misfit_of

_SCHEMA = {
    "title": "a class of your own",
    "type": "object",
    "properties": {"kind": {"type": "string", "pattern": "^[A-Za-z_][A-Za-z0-9_.]*:[A-Za-z_][A-Za-z0-9_]*$"}},
    "required": ["kind"],
}


class NamedKind(BaseModel):
    """Table of a model; only the key `kind` and the keys that a subclass declares are used."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    kind: str


@dataclass(frozen=True, slots=True)
class OrOwn:
    """Annotation of a scenario key whose table may name a user's own class in place of a kind of vestige.

    `base` is the protocol or base class that the user's class must have. If `base` is None, the class is not imported,
    and only its name is kept (`NamedKind`).
    """

    base: type | None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        ours = handler(source)
        own = handler.generate_schema(
            Annotated[Any, PlainValidator(self._made), PlainSerializer(_tables), WithJsonSchema(_SCHEMA)]
        )
        return core_schema.tagged_union_schema({OURS: ours, OWN: own}, discriminator=whose)

    def _made(self, value: Any, info: ValidationInfo) -> Any:
        """Return the object that a table describes; an object that is not a table is returned unchanged."""
        if not isinstance(value, dict):
            return value  # a Python program gave the object itself
        kind = value["kind"]
        if self.base is None:
            return NamedKind(kind=kind)
        cls = named_part(kind, self.base, "kind")
        if not (is_dataclass(cls) and getattr(cls, "__dataclass_params__").frozen):  # noqa: B009  (unknown to mypy)
            raise InconsistentSettingsError(
                "kind", kind, f"a class with @dataclass(frozen=True), which {cls.__name__} is not"
            )
        adapter = _adapter(cls)
        raw = {"part": {key: inner for key, inner in value.items() if key != "kind"}}
        try:
            return adapter.validate_json(json.dumps(raw), strict=True, context=info.context).part
        except ValidationError as error:
            misfit = misfit_of(error, adapter, raw)
            place = misfit.place.removeprefix("part").removeprefix(".")
            raise InconsistentSettingsError(place, misfit.found, misfit.expected) from error


def named_part(kind: str, base: type, place: str = "") -> Any:
    """Return the class `kind`; raise `InconsistentSettingsError` if the class does not exist or does not fit `base`."""
    try:
        return part(kind, base)
    except OwnPartError as error:
        raise InconsistentSettingsError(place, f"{error.kind} and {error.found}", error.expected) from error


def _adapter(cls: Any) -> TypeAdapter[Any]:
    """Return the validator for the fields of a class; an unknown key is an error, as in a `Section`."""
    return TypeAdapter(create_model("Own", __base__=Section, part=(cls, ...)))


def _tables(value: Any) -> Any:
    """Return the table that describes an object of a user's class."""
    return {"kind": kind_of(type(value))} | TypeAdapter(type(value)).dump_python(value, mode="json")


def whose(value: Any) -> str:
    """Return `OWN` if the kind of a table or object is a user's own class, and `OURS` if vestige defines the kind."""
    if isinstance(value, dict):
        return OWN if is_own(value.get("kind")) else OURS
    return OURS if type(value).__module__.partition(".")[0] in ("vestige", "builtins") else OWN
