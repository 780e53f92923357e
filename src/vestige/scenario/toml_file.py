"""Scenario files as TOML: reading, overriding values from the command line, errors with their place in the file."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from vestige.errors import InputFileError, VestigeError


class Section(BaseModel):
    """A table of a scenario file; an unknown key in it is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def read_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises
    ------
    InputFileError
        If it is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"byte {error.start}", "bytes that are not UTF-8", "a TOML file") from error
    except tomllib.TOMLDecodeError as error:
        raise InputFileError(path, "TOML", str(error), "valid TOML") from error


def overridden(raw: Mapping[str, Any], settings: Iterable[str]) -> dict[str, Any]:
    """Return the tables with values replaced: each setting is `table.key=value`, the value in TOML.

    Raises
    ------
    VestigeError
        If a setting has not this form.
    """
    result: dict[str, Any] = {key: _copy(value) for key, value in raw.items()}
    for setting in settings:
        name, equals, text = setting.partition("=")
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError as error:
            raise VestigeError(f"--set {setting}: found {text!r}, expected a TOML value ({error})") from error
        *tables, key = name.strip().split(".")
        if not equals or not key:
            raise VestigeError(f"--set {setting}: expected table.key=value")
        place = result
        for table in tables:
            place = place.setdefault(table, {})
            if not isinstance(place, dict):
                raise VestigeError(f"--set {setting}: {table} is not a table")
        place[key] = value
    return result


def _copy(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _copy(inner) for key, inner in value.items()}
    return list(value) if isinstance(value, list) else value


def validated(adapter: TypeAdapter[Any], raw: Mapping[str, Any], path: Path) -> Any:
    """Return what the tables describe, or raise the first thing that is wrong with its place.

    Raises
    ------
    InputFileError
        For an unknown key, a missing one, or a value outside its range.
    """
    try:
        return adapter.validate_python(raw)
    except ValidationError as error:
        first = error.errors()[0]
        loc = first["loc"][1:] if first["loc"][:1] == (raw.get("kind"),) else first["loc"]  # the kind is no table
        place = ".".join(str(part) for part in loc) or "top level"
        found = "nothing" if first["type"] == "missing" else first["input"]
        raise InputFileError(path, place, found, first["msg"]) from error
