"""Compute profiles of delay in m, or of power in dB, as functions of time, with the exact derivative.

Every profile has its first value before its start, and its last value after its end. So a profile has a value at every
time. `start_s` and `stop_s` of the attack, and not a profile, switch the attack on and off. The table says which values
and rates are continuous:

| profile | value | rate |
|---|---|---|
| `Constant` | continuous | continuous: 0 |
| `Ramp` | continuous | jumps at the start and the end; continuous with `smooth`, which makes half a cosine |
| `Sine` | continuous | continuous: 0 at the start, at the turn and at the end |
| `Trapezoid` | continuous | jumps at four corners; continuous with `smooth`, which makes half cosines |
| `Table` | continuous: straight lines | jumps at the points |

In a scenario a plain number means a `Constant`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import BeforeValidator, Discriminator, Tag, ValidationInfo

from vestige.spoofer.profile_table import read_profile_table


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """Profile with one value at all times.

    Attributes
    ----------
    level
        Value in m or dB; −inf dB means no signal.
    """

    level: float
    kind: Literal["constant"] = "constant"

    def value(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the value at each time in s after the scenario's start."""
        return np.full(t_s.shape, self.level)

    def rate(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the derivative per s at each time, which is 0."""
        return np.zeros(t_s.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """Profile that changes from one value to another value, in a straight line or as half a cosine.

    Attributes
    ----------
    first, last
        Values before `start_s` and after `stop_s`.
    start_s, stop_s
        Times in s after the scenario's start.
    smooth
        Whether half a cosine replaces the straight line.
    """

    first: float
    last: float
    start_s: float
    stop_s: float
    smooth: bool = False
    kind: Literal["ramp"] = "ramp"

    def __post_init__(self) -> None:
        _ascending(self.start_s, self.stop_s)
        _finite(self.first, self.last)

    def value(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the value at each time in s after the scenario's start."""
        return self.first + (self.last - self.first) * _share(t_s, self.start_s, self.stop_s, self.smooth)

    def rate(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the derivative per s at each time; at a corner, return the derivative after the corner."""
        return (self.last - self.first) * _share_rate(t_s, self.start_s, self.stop_s, self.smooth)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sine:
    """Profile that approaches a value and departs again, with rate 0 at the turn [WFO, Sec. VI-B].

    The profile is half a cosine from `first` to `turn`, and another half cosine from `turn` to `last`. The delay of the
    spoofing signal in [WFO] falls until the spoofing signal reaches the true signal, and then rises again.

    Attributes
    ----------
    first, turn, last
        Values before `start_s`, at `turn_s` and after `stop_s`.
    start_s, turn_s, stop_s
        Times in s after the scenario's start.
    """

    first: float
    turn: float
    last: float
    start_s: float
    turn_s: float
    stop_s: float
    kind: Literal["sine"] = "sine"

    def __post_init__(self) -> None:
        _ascending(self.start_s, self.turn_s, self.stop_s)
        _finite(self.first, self.turn, self.last)

    def value(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the value at each time in s after the scenario's start."""
        approach = (self.first - self.turn) * (1 - _share(t_s, self.start_s, self.turn_s, smooth=True))
        departure = (self.last - self.turn) * _share(t_s, self.turn_s, self.stop_s, smooth=True)
        return self.turn + approach + departure

    def rate(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the derivative per s at each time."""
        approach = (self.turn - self.first) * _share_rate(t_s, self.start_s, self.turn_s, smooth=True)
        departure = (self.last - self.turn) * _share_rate(t_s, self.turn_s, self.stop_s, smooth=True)
        return approach + departure


@dataclass(frozen=True, slots=True, kw_only=True)
class Trapezoid:
    """Profile that goes from a base value to a plateau and back.

    Attributes
    ----------
    base, top
        Value outside the trapezoid, and value on the plateau.
    start_s, stop_s
        Times at which the profile leaves the base and reaches the base again, in s after the scenario's start.
    rise_s, fall_s
        Duration of each flank in s.
    smooth
        Whether the flanks are half cosines instead of straight lines.
    """

    base: float
    top: float
    start_s: float
    stop_s: float
    rise_s: float
    fall_s: float
    smooth: bool = False
    kind: Literal["trapezoid"] = "trapezoid"

    def __post_init__(self) -> None:
        _ascending(self.start_s, self.start_s + self.rise_s)
        _ascending(self.stop_s - self.fall_s, self.stop_s)
        _finite(self.base, self.top)
        if self.start_s + self.rise_s > self.stop_s - self.fall_s:
            raise ValueError("the flanks of a trapezoid are longer than the trapezoid")

    def value(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the value at each time in s after the scenario's start."""
        up = _share(t_s, self.start_s, self.start_s + self.rise_s, self.smooth)
        down = _share(t_s, self.stop_s - self.fall_s, self.stop_s, self.smooth)
        return self.base + (self.top - self.base) * (up - down)

    def rate(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the derivative per s at each time; at a corner, return the derivative after the corner."""
        up = _share_rate(t_s, self.start_s, self.start_s + self.rise_s, self.smooth)
        down = _share_rate(t_s, self.stop_s - self.fall_s, self.stop_s, self.smooth)
        return (self.top - self.base) * (up - down)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Profile with straight lines between points, which are in the scenario or in a CSV file (`profile_table`).

    The points of a file are read when the profile is made. So the loaded scenario no longer depends on the file.

    Attributes
    ----------
    path
        CSV file with the header `time_s,value` and a point in each line; empty if the points are in the scenario.
    time_s, values
        Times in s after the scenario's start in ascending order, and the value at each time.
    """

    path: str = ""
    time_s: tuple[float, ...] = ()
    values: tuple[float, ...] = ()
    kind: Literal["table"] = "table"

    def __post_init__(self) -> None:
        if self.path and not self.time_s:
            time_s, values = read_profile_table(Path(self.path))
            object.__setattr__(self, "time_s", time_s)
            object.__setattr__(self, "values", values)
        if len(self.time_s) < 2 or len(self.time_s) != len(self.values):
            raise ValueError("a table has two points or more, each with a time and a value")
        _ascending(*self.time_s)
        _finite(*self.values)

    def value(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the value at each time in s after the scenario's start."""
        return np.interp(t_s, self.time_s, self.values)

    def rate(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the derivative per s at each time; at a point, return the derivative after the point."""
        slopes = np.concatenate([[0.0], np.diff(self.values) / np.diff(self.time_s), [0.0]])
        return slopes[np.searchsorted(self.time_s, t_s, side="right")]


ALL_PROFILES = (Constant, Ramp, Sine, Trapezoid, Table)
AnyProfile = Constant | Ramp | Sine | Trapezoid | Table


def _tag(value: Any) -> str:
    if isinstance(value, int | float | str):
        return "number"
    kind = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return str(kind)


def _with_points(table: Any, info: ValidationInfo) -> Any:
    """Return the table of a profile with its points; if the table names a CSV file, read the points from this file.

    The path of the file is relative to the folder of the scenario file. The points are lists in TOML, and tuples in a
    `Table`.
    """
    if not isinstance(table, dict):
        return table
    if not (table.get("path") and isinstance(table["path"], str)):
        return {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    if "time_s" in table or "values" in table:
        raise ValueError("the points of a table are given or in a file, not both")
    time_s, values = read_profile_table((info.context or {}).get("folder", Path()) / table["path"])
    return table | {"time_s": time_s, "values": values}


Profile = Annotated[
    Annotated[float, Tag("number")]
    | Annotated[Constant, Tag("constant")]
    | Annotated[Ramp, Tag("ramp")]
    | Annotated[Sine, Tag("sine")]
    | Annotated[Trapezoid, Tag("trapezoid")]
    | Annotated[Table, BeforeValidator(_with_points), Tag("table")],
    Discriminator(_tag),
]


def as_profile(profile: AnyProfile | float) -> AnyProfile:
    """Return a plain number as a `Constant`, and a profile unchanged."""
    return Constant(level=float(profile)) if isinstance(profile, int | float) else profile


def _share(t_s: Float[np.ndarray, " n"], start_s: float, stop_s: float, smooth: bool) -> Float[np.ndarray, " n"]:
    """Return the completed share of a transition from `start_s` to `stop_s`, 0 to 1."""
    share = np.clip((t_s - start_s) / (stop_s - start_s), 0.0, 1.0)
    return np.sin(np.pi / 2 * share) ** 2 if smooth else share


def _share_rate(t_s: Float[np.ndarray, " n"], start_s: float, stop_s: float, smooth: bool) -> Float[np.ndarray, " n"]:
    """Return the derivative of `_share` in 1/s."""
    rate = 1 / (stop_s - start_s)
    if smooth:
        return np.pi / 2 * rate * np.sin(np.pi * np.clip((t_s - start_s) * rate, 0.0, 1.0))
    return np.where((t_s >= start_s) & (t_s < stop_s), rate, 0.0)


def _ascending(*times_s: float) -> None:
    if not (np.all(np.isfinite(times_s)) and np.all(np.diff(times_s) > 0)):
        raise ValueError(f"times of a profile are finite and ascend, found {', '.join(f'{t:g}' for t in times_s[:4])}")


def _finite(*values: float) -> None:
    if not np.all(np.isfinite(values)):
        raise ValueError("finite values; to switch a signal on or off, use start_s and stop_s of the attack")


def extremes(profile: AnyProfile | float) -> tuple[float, float]:
    """Return the smallest and the largest value of a profile."""
    match profile:
        case Constant():
            values: tuple[float, ...] = (profile.level,)
        case Ramp():
            values = (profile.first, profile.last)
        case Sine():
            values = (profile.first, profile.turn, profile.last)
        case Trapezoid():
            values = (profile.base, profile.top)
        case Table():
            values = profile.values
        case _:
            values = (float(profile),)
    return min(values), max(values)


def fastest(profile: AnyProfile | float) -> float:
    """Return the largest magnitude of a profile's rate, in m/s for a delay and in dB/s for a power."""
    match profile:
        case Ramp():
            return _flank(profile.last - profile.first, profile.stop_s - profile.start_s, profile.smooth)
        case Sine():
            approach = _flank(profile.turn - profile.first, profile.turn_s - profile.start_s, smooth=True)
            return max(approach, _flank(profile.last - profile.turn, profile.stop_s - profile.turn_s, smooth=True))
        case Trapezoid():
            return _flank(profile.top - profile.base, min(profile.rise_s, profile.fall_s), profile.smooth)
        case Table():
            return float(np.max(np.abs(np.diff(profile.values) / np.diff(profile.time_s))))
        case _:
            return 0.0


def _flank(step: float, duration_s: float, smooth: bool) -> float:
    return abs(step) / duration_s * (np.pi / 2 if smooth else 1.0)
