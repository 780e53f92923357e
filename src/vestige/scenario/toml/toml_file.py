"""Read TOML scenario files, replace values by `--set` options, and report errors with their position in the file."""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Iterable, Mapping
from datetime import date, time
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from vestige.crypto.file_bytes import read_text
from vestige.crypto.file_toml import DEEPEST, parse_toml
from vestige.errors import InputFileError, SettingError, VestigeError

NOTHING = "none"  # value of a setting that removes a key
OURS, OWN = "a kind of vestige", "a user's own kind"  # tags that pydantic adds to the keys in an error's position
LARGEST_NUMBER = 1e15
_MAX_FILE_BYTES = 1 << 20
_BARE = re.compile(r"[A-Za-z_][\w.-]*(:[A-Za-z_]\w*)?", re.ASCII)
_WORDS_OF_TOML = ("true", "false", "inf", "nan")
_POWER_OF_AN_ATTACK = re.compile(r"attack\.\d+\.\w+_db(\.level)?")


class Section(BaseModel):
    """Table of a scenario file, in which an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class InconsistentSettingsError(SettingError):
    """Error for a value that is invalid, alone or together with other values of the scenario.

    `place` is the key with the error, relative to the checked table, for example `receiver.clock`.
    """


def read_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file as a dictionary.

    The function raises `InputFileError` if the file cannot be read, is not TOML, or exceeds the limits of `parse_toml`.
    """
    try:
        return parse_toml(read_text(path, at_most=_MAX_FILE_BYTES, expected="a TOML file"))
    except ValueError as error:  # `parse_toml` raises this error for invalid TOML and for integers of over 4300 digits
        raise InputFileError(path, "TOML", str(error), "valid TOML") from error


def overridden(raw: Mapping[str, Any], settings: Iterable[str]) -> dict[str, Any]:
    """Return the tables with values replaced; each setting is `table.key=value`, with the value in TOML.

    A bare word is read as text, for example `fidelity=samples` or `processor.detector=my_module:MyDetector`.

    TOML has no null value. So the bare word `none`, which is not a TOML value, removes a key or a whole table, for
    example `receiver.multipath=none`. A removed key gets its default, or is missing if the key has no default. A
    removed model is not simulated.

    The function raises `VestigeError` if a setting does not have the form `table.key=value`, its value is not TOML, or
    the key cannot be set or removed.
    """
    result: dict[str, Any] = {key: _copy(value) for key, value in raw.items()}
    for setting in settings:
        name, equals, text = setting.partition("=")
        *tables, key = name.strip().split(".")
        if not equals or not key:
            raise VestigeError(f"--set {setting}: expected table.key=value")
        if (n_parts := len(tables) + 1) > DEEPEST:
            raise VestigeError(f"--set {name[:40]}…: found a key of {n_parts} parts, expected at most {DEEPEST}")
        place: Any = result
        for table in tables:
            inner = _inside(place, table)
            if not isinstance(inner, dict | list):
                raise VestigeError(f"--set {setting}: {table} is not a table")
            place = inner
        if isinstance(place, list):
            raise VestigeError(f"--set {setting}: {key} is not a key, but one of several tables")
        if text.strip() != NOTHING:
            place[key] = _value(setting, text)
        elif key in place:
            del place[key]
        else:
            raise VestigeError(f"--set {setting}: there is no {name.strip()} to remove")
    return result


def _value(setting: str, text: str) -> Any:
    """Return the single TOML value in `text`, or the text itself if `text` is a bare word."""
    if _BARE.fullmatch(text.strip()) and text.strip() not in _WORDS_OF_TOML:
        return text.strip()
    try:
        parsed = parse_toml(f"value = {text}")
    except ValueError as error:
        raise VestigeError(f"--set {setting}: found {text!r}, expected a TOML value ({error})") from error
    if parsed.keys() != {"value"}:
        raise VestigeError(f"--set {setting}: found {text!r}, expected one TOML value")
    return parsed["value"]


def _inside(place: Any, name: str) -> Any:
    """Return the inner table `name` of a table; a missing inner table is created.

    In an array of tables, `name` is the number of a table, counted from 0. The result is None if the array has no table
    with this number.
    """
    if isinstance(place, dict):
        return place.setdefault(name, {})
    known = {str(number): one for number, one in enumerate(place)}
    return known.get(name)


def _copy(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _copy(inner) for key, inner in value.items()}
    return [_copy(inner) for inner in value] if isinstance(value, list) else value


def validated(adapter: TypeAdapter[Any], raw: Mapping[str, Any], path: Path) -> Any:
    """Return the object that the tables describe, or raise an `InputFileError` with the position of the first error.

    Strings and Boolean values are not converted to numbers. The tables are validated as JSON, because strict validation
    of Python values refuses a list where a model has a tuple.

    Errors are an unknown key, a missing key, a value of the wrong type, a value outside its range, and values that do
    not fit together.
    """
    _check_values(raw, "", path)
    try:
        return adapter.validate_json(json.dumps(raw), strict=True, context={"folder": path.parent})
    except ValidationError as error:
        misfit = misfit_of(error, adapter, raw)
        raise InputFileError(path, misfit.place or "top level", misfit.found, misfit.expected) from error


def misfit_of(error: ValidationError, adapter: TypeAdapter[Any], raw: Mapping[str, Any]) -> InconsistentSettingsError:
    """Return the first error of a validation by pydantic as an error of vestige, with position and expected value.

    A misspelt key that is required gives two errors: an unknown key and a missing key. The unknown key is reported,
    because it shows the misspelling.
    """
    first = min(error.errors(), key=lambda one: one["type"] not in _UNKNOWN_KEY)
    place = _place(raw, first["loc"])
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return InconsistentSettingsError(
            ".".join(part for part in (place, cause.place) if part), cause.found, cause.expected
        )
    if first["type"].startswith("union_tag"):  # the key `kind` is missing or unknown
        if near := difflib.get_close_matches("kind", set(_table_of(raw, first["loc"])) - {"kind"}):
            return InconsistentSettingsError(place or "top level", f"an unknown key {near[0]}", "kind")
        kinds = first["ctx"].get("expected_tags")
        if kinds is None and not place:
            kinds = " or ".join(
                repr(kind) for kind in adapter.json_schema().get("discriminator", {}).get("mapping", ())
            )
        if not place and "tag" not in first["ctx"] and (misspelt := _unknown_at_the_top(adapter, raw)):
            unknown, near_key = misspelt
            return InconsistentSettingsError(
                "top level", f"an unknown key {unknown}, and no kind", f"{near_key}, and kind = {kinds}"
            )
        place = ".".join(filter(None, (place, "kind")))
        return InconsistentSettingsError(place, first["ctx"].get("tag", "nothing"), kinds or "a kind")
    found, expected = _found_and_expected(first, adapter, raw)
    return InconsistentSettingsError(place, found, expected)


_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")
_KEYS_LISTED = "`vestige check --schema` and docs/scenarios.md list them"
_NUMBER, _WHOLE, _TRUTH = "a number", "a whole number", "true or false"
# text that describes the expected value, by the type of the pydantic error
_EXPECTED = {
    "missing": "a value: the key is needed",
    "greater_than_equal": "at least {ge:g}",
    "greater_than": "more than {gt:g}",
    "less_than_equal": "at most {le:g}",
    "less_than": "less than {lt:g}",
    "multiple_of": "a multiple of {multiple_of:g}",
    "finite_number": "a finite number",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "int_type": _WHOLE,
    "int_from_float": _WHOLE,
    "float_type": _NUMBER,
    "bool_type": _TRUTH,
    "string_type": "a text",
    "list_type": "a list",
    "tuple_type": "a list",
    "model_type": "a table",
    "dataclass_type": "a table",
    "dict_type": "a table",
    "model_attributes_type": "a table",
}


def _found_and_expected(first: ErrorDetails, adapter: TypeAdapter[Any], raw: Mapping[str, Any]) -> tuple[object, str]:
    """Return the found and the expected value at the position of an error in the tables."""
    if first["type"] in _UNKNOWN_KEY:
        *loc, unknown = first["loc"]
        schema, table = adapter.json_schema(), _table_of(raw, tuple(loc))
        keys = _keys_of_table(schema, raw, tuple(loc))
        if near := difflib.get_close_matches(str(unknown), keys, n=1) or _longer(str(unknown), keys):
            return f"an unknown key {unknown}", near[0]
        if "kind" in table or unknown in _keys(schema):  # the key may belong to another table or another kind
            kind = f" of kind {table['kind']}" if "kind" in table else ""
            return f"an unknown key {unknown}", f"a key of this table{kind}: {_KEYS_LISTED}"
        return f"an unknown key {unknown}", f"one of the keys: {_KEYS_LISTED}"
    found = "nothing" if first["type"] == "missing" else first["input"]
    if (expected := _EXPECTED.get(first["type"])) is not None:
        if isinstance(found, str) and expected in (
            _NUMBER,
            _WHOLE,
            _TRUTH,
        ):  # the text "40" would look like a number in a message without quotes
            found = f'the text "{found}"'
        return found, expected.format(**first.get("ctx", {}))
    if isinstance(found, dict):
        found = ", ".join(f"{key} = {value}" for key, value in found.items())
    return found, first["msg"].removeprefix("Value error, ")


def _inside_of(raw: Any, part: int | str) -> bool:
    """Return whether a part of a position is a key or an index in the file, and not a tag that pydantic adds."""
    return part in raw if isinstance(raw, dict) else isinstance(raw, list) and part in range(len(raw))


def _table_of(raw: Any, loc: tuple[int | str, ...]) -> Mapping[str, Any]:
    """Return the table at the position of an error; the result is empty if there is no table at this position."""
    for part in loc:
        raw = raw[part] if _inside_of(raw, part) else raw
    return raw if isinstance(raw, dict) else {}


def _keys_of_table(schema: Mapping[str, Any], raw: Any, loc: tuple[int | str, ...]) -> set[str]:
    """Return the keys that a JSON schema permits in the table at a position, for the kind that the table names."""
    definitions = schema.get("$defs", {})
    tables = _variants(schema, definitions, raw)
    for part in loc:
        if _inside_of(raw, part):
            raw = raw[part]
            inner = (
                one.get("items") if isinstance(part, int) else one.get("properties", {}).get(part) for one in tables
            )
            tables = [found for one in inner if one for found in _variants(one, definitions, raw)]
    return set().union(*(one.get("properties", ()) for one in tables))


def _variants(schema: Mapping[str, Any], definitions: Mapping[str, Any], raw: Any) -> list[Mapping[str, Any]]:
    """Return the schemas that may describe a value; a value with a kind gets only the schemas of this kind."""
    if "$ref" in schema:
        return _variants(definitions[schema["$ref"].rpartition("/")[2]], definitions, raw)
    inner = [one for name in ("anyOf", "oneOf", "allOf") for one in schema.get(name, ())]
    if inner:
        return [found for one in inner for found in _variants(one, definitions, raw)]
    kind = schema.get("properties", {}).get("kind", {})
    kinds = kind.get("enum", [kind["const"]] if "const" in kind else [])
    named = raw.get("kind") if isinstance(raw, dict) else None
    return [schema] if named is None or not kinds or named in kinds else []


def _keys(schema: Any) -> set[str]:
    """Return all keys that any table of a JSON schema may have."""
    if isinstance(schema, dict):
        return set(schema.get("properties", ())).union(*map(_keys, schema.values()))
    return set().union(*map(_keys, schema)) if isinstance(schema, list) else set()


def _longer(beginning: str, keys: Iterable[str]) -> list[str]:
    """Return a list with the shortest key that begins with `beginning` and `_`, such as `cn0_dbhz` for `cn0`."""
    return sorted((key for key in keys if key.startswith(f"{beginning}_")), key=lambda key: (len(key), key))[:1]


def _unknown_at_the_top(adapter: TypeAdapter[Any], raw: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return an unknown top-level key of a file without `kind`, and the most similar key.

    The result is None if all top-level keys are known.
    """
    schema = adapter.json_schema()
    kinds = schema.get("discriminator", {}).get("mapping", {}).values()
    tables = [schema.get("$defs", {}).get(ref.rpartition("/")[2], {}) for ref in kinds]
    known = set().union(*(table.get("properties", ()) for table in tables))
    unknown = next((key for key in raw if key not in known), None)
    if unknown is None or not known:
        return None
    near = difflib.get_close_matches(unknown, known, n=1) or _longer(unknown, known)
    return unknown, near[0] if near else f"one of the keys: {_KEYS_LISTED}"


def _check_values(value: Any, place: str, path: Path, depth: int = 0) -> None:
    """Raise `InputFileError` for a number that is not finite or too large, a bare date or time, or too deep nesting.

    The power of an attack may be −inf dB.
    """
    if depth > DEEPEST:
        raise InputFileError(path, f"{place[:40]}…", "tables and lists in each other", f"at most {DEEPEST}")
    if isinstance(value, dict):
        for key, inner in value.items():
            _check_values(inner, f"{place}.{key}" if place else key, path, depth + 1)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            _check_values(inner, f"{place}.{index}", path, depth + 1)
    elif isinstance(value, date | time):  # `date` includes `datetime`
        raise InputFileError(path, place, value, "a text in quotes, or a number")
    elif isinstance(value, (int, float)) and not abs(value) <= LARGEST_NUMBER:
        if value == -math.inf and _POWER_OF_AN_ATTACK.fullmatch(place):
            return  # a power of −inf dB is allowed, and means no signal
        finite = isinstance(value, int) or math.isfinite(value)  # an integer may be too large for `math.isfinite`
        expected = f"a number between {-LARGEST_NUMBER:g} and {LARGEST_NUMBER:g}" if finite else "a finite number"
        raise InputFileError(path, place, value, expected)


def _place(raw: Any, loc: tuple[int | str, ...]) -> str:
    """Return the dotted keys of a position, without the names of kinds that the validator adds between the keys."""
    parts = []
    for part in loc:
        if part in (OURS, OWN) or (isinstance(raw, dict) and part not in raw and raw.get("kind") == part):
            continue
        if isinstance(raw, str | int | float):
            break  # the rest of the position contains only the possible kinds
        parts.append(str(part))
        inside = raw.get(part) if isinstance(raw, dict) else None
        raw = raw[part] if isinstance(raw, list) and isinstance(part, int) and part < len(raw) else inside
    return ".".join(parts)
