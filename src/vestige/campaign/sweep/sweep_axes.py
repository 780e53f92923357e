"""Read the axes of a sweep, which are keys of a scenario with their values, and form all combinations."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from urllib.parse import quote

from vestige.crypto.file_toml import parse_toml
from vestige.errors import VestigeError

Value = bool | int | float | str

MAX_CAMPAIGNS = 1000
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?"
_RANGE = re.compile(rf"\s*({_NUMBER})\s*:\s*({_NUMBER})\s*:\s*({_NUMBER})\s*")
_LARGEST_INTEGER = 2**63  # largest magnitude of an integer in TOML v1.0.0
_MAX_NAME = 200  # largest number of characters in the name of a store; file systems allow up to 255 characters


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A key of a scenario and its values in a sweep."""

    key: str
    values: tuple[Value, ...]


def parse_axis(text: str) -> Axis:
    """Return the axis that `key=start:stop:step` or `key=a,b,c` (TOML values) describes.

    A range contains `start`, and also contains `stop` if a step reaches `stop`. The function raises `VestigeError` if
    the text has another form or contains a value twice. The function also raises `VestigeError` if the step of a range
    is 0 or leads away from `stop`, or if the range has more than `MAX_CAMPAIGNS` values.
    """
    key, equals, listed = (part.strip() for part in text.partition("="))
    if not key or not equals:
        raise VestigeError(f"--sweep {text}: expected table.key=start:stop:step or table.key=a,b,c")
    try:
        values = _range(*match.groups()) if (match := _RANGE.fullmatch(listed)) else _list(listed)
    except ValueError as error:
        raise VestigeError(f"--sweep {text}: {error}") from error
    if len({(isinstance(value, bool), value) for value in values}) < len(values):
        raise VestigeError(f"--sweep {text}: found a value twice, expected each value once")
    return Axis(key=key, values=values)


def grid(axes: Sequence[Axis]) -> tuple[dict[str, Value], ...]:
    """Return the settings of every campaign, for all combinations of values; the last axis changes fastest.

    The function raises `VestigeError` if two axes have the same key, or there are more than `MAX_CAMPAIGNS` campaigns.
    """
    keys = [axis.key for axis in axes]
    if len(set(keys)) < len(keys):
        raise VestigeError(f"--sweep: found {', '.join(keys)}, expected each key once")
    if (count := math.prod(len(axis.values) for axis in axes)) > MAX_CAMPAIGNS:
        raise VestigeError(f"--sweep: found {count} campaigns, expected at most {MAX_CAMPAIGNS}")
    return tuple(dict(zip(keys, values, strict=True)) for values in itertools.product(*(axis.values for axis in axes)))


def store_name(settings: Mapping[str, Value]) -> str:
    """Return the file name of a campaign's store, which consists of the settings of the campaign.

    All characters except ASCII letters, digits and `_.-~=,+` are written as `%XX`.

    The function raises `VestigeError` if the name is too long for a file.
    """
    name = quote(",".join(as_settings(settings)), safe="=,+", errors="surrogateescape") + ".zarr"
    if len(name) > _MAX_NAME:
        raise VestigeError(f"--sweep: {name[:40]}…: found {len(name)} characters, expected at most {_MAX_NAME}")
    return name


def as_settings(settings: Mapping[str, Value]) -> tuple[str, ...]:
    """Return settings as texts `key=value`, the form that `load_scenario` takes."""
    return tuple(f"{key}={_toml(value)}" for key, value in settings.items())


def _range(start: str, stop: str, step: str) -> tuple[Value, ...]:
    """Return start, start + step, … up to stop; decimal arithmetic avoids rounding errors."""
    first, last, by = Decimal(start), Decimal(stop), Decimal(step)
    if not by or (last - first) / by < 0:
        raise ValueError(f"steps of {step} from {start} never reach {stop}")
    if (steps := (last - first) / by) >= MAX_CAMPAIGNS:
        raise ValueError(f"more than {MAX_CAMPAIGNS} values")
    values = [first + i * by for i in range(int(steps) + 1)]
    return tuple(int(value) if value == int(value) else float(value) for value in values)


def _list(text: str) -> tuple[Value, ...]:
    try:
        (values,) = parse_toml(f"values = [{text}]").values()
    except ValueError as error:  # the text is no TOML, or continues after the end of the list
        raise ValueError(f"found {text!r}, expected start:stop:step or TOML values a,b,c") from error
    if not values or not all(isinstance(value, Value) for value in values):
        raise ValueError(f"found {text!r}, expected numbers, texts or booleans")
    if any(isinstance(value, int) and abs(value) > _LARGEST_INTEGER for value in values):
        raise ValueError("found a whole number of more than 64 bits, which TOML does not have")
    return tuple(values)


def _toml(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + re.sub(r'["\\\x00-\x1f\x7f]', lambda found: f"\\u{ord(found[0]):04x}", value) + '"'
    return repr(value)
