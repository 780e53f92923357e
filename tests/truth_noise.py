"""The simulated world behind snapshots, replaced by noise: whatever judges them afterwards cannot have looked at it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.receiver.snapshots.searches import DrawnSearches, SearchFinds
from vestige.records import Band
from vestige.records.snapshot_block import SnapshotBlock
from vestige.theory.search_budget import SEARCH_P_FA
from vestige.time import GalileoTime

SIMULATED = ("vestige.receiver", "vestige.spoofer", "vestige.signal_generator", "vestige.simulated", "vestige.scenario")
# What a receiver has: its own settings, and what the searches found that it was told to make
_RECEIVED = (FixSettings, SearchFinds, GalileoTime)
_PLAIN = (str, bytes, bool, int, float, complex, type(None), type)


def ask_all(block: SnapshotBlock) -> None:
    """Have the simulated receiver answer all that it can be asked: what front ends say, and what searches find."""
    for band in block.front_end:
        assert block.front_end[band] is not None
    assert Band.E6 in block.front_end
    if isinstance(block.searches, DrawnSearches):
        assert block.searches.finds(SEARCH_P_FA) is block.searches.finds(SEARCH_P_FA)


def noise_like(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return noise of the shape and dtype of an array."""
    drawn = 1e3 * rng.standard_normal(values.shape)
    if values.dtype.kind == "c":
        return (drawn + 1e3j * rng.standard_normal(values.shape)).astype(values.dtype)
    if values.dtype.kind == "f":
        return drawn.astype(values.dtype)
    if values.dtype.kind == "b":
        return np.asarray(drawn > 0)
    return rng.integers(0, 100, values.shape).astype(values.dtype) if values.dtype.kind in "iu" else values


def make_noise_of_the_truth(*roots: object, seed: int = 11) -> int:
    """Replace every array and number of the simulated world that can be reached; return how many those were.

    Numbers are NaN afterwards. What was given to the receiver stays: records, which are of another module.
    """
    rng, replaced = np.random.default_rng(seed), 0
    seen: dict[int, Any] = {}
    todo: list[Any] = list(roots)
    while todo:
        one = todo.pop()
        if id(one) in seen or isinstance(one, (*_PLAIN, *_RECEIVED, np.ndarray)):
            continue
        seen[id(one)] = one
        todo += list(_inside(one))
        if not type(one).__module__.startswith(SIMULATED):
            continue
        for name, value in _attributes(one):
            if isinstance(value, np.ndarray):
                object.__setattr__(one, name, noise_like(value, rng))
                replaced += 1
            elif isinstance(value, float):
                object.__setattr__(one, name, np.nan)
                replaced += 1
    return replaced


def _attributes(one: Any) -> Iterator[tuple[str, Any]]:
    names = {field.name for field in dataclasses.fields(one)} if dataclasses.is_dataclass(one) else set()
    names |= set(getattr(one, "__dict__", ()))
    for kind in type(one).__mro__:
        names |= set(getattr(kind, "__slots__", ()))
    for name in sorted(names):
        if not name.startswith("__") and name in getattr(one, "__dict__", {}):
            yield name, one.__dict__[name]
        elif not name.startswith("__") and hasattr(type(one), name) and hasattr(one, name):
            yield name, getattr(one, name)


def _inside(one: Any) -> Iterator[Any]:
    if isinstance(one, Mapping) and type(one) is dict:
        yield from one.values()
    elif isinstance(one, list | tuple | set | frozenset):
        yield from one
    elif type(one).__module__.startswith("vestige."):
        yield from (value for _, value in _attributes(one))
