"""Draw random numbers in blocks of epochs, so that the numbers do not depend on the division of a run into chunks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

DRAW_BLOCK = 500  # number of epochs that share a stream of draws, independent of the division into chunks

_T = TypeVar("_T")


def drawn_rows(first: int, n: int, draw: Callable[[int], _T]) -> _T:
    """Return n rows of draws from row `first` on, as an array or as a record of arrays.

    `draw` returns the `DRAW_BLOCK` rows of the block with the given number.
    """
    begin = first // DRAW_BLOCK
    drawn = [draw(block) for block in range(begin, max((first + n - 1) // DRAW_BLOCK, begin) + 1)]
    return rows_of(joined_blocks(drawn), slice(first % DRAW_BLOCK, first % DRAW_BLOCK + n))


def joined_blocks(parts: Sequence[_T]) -> _T:
    """Return arrays, or records of arrays, joined end to end."""
    arrays: Sequence[Any] = parts
    if isinstance(parts[0], np.ndarray):
        return np.concatenate(arrays)  # type: ignore[return-value]
    return _changed(parts[0], lambda name: np.concatenate([getattr(part, name) for part in arrays]))


def rows_of(value: _T, rows: slice) -> _T:
    """Return some rows of an array, or of each array in a record and in the records that it contains."""
    if isinstance(value, np.ndarray):
        return value[rows]  # type: ignore[return-value]
    if hasattr(value, "part"):
        return value.part(rows)
    return _changed(value, lambda name: rows_of(getattr(value, name), rows))


def _changed(record: Any, change: Callable[[str], Any]) -> Any:
    return replace(record, **{field.name: change(field.name) for field in fields(record)})
