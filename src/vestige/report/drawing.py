"""Reduce many epochs to a drawing of limited size.

The module has two methods, and the page states the method that was used. *Stretches* are groups of consecutive epochs
that are drawn with a common value: a mean, a largest value, or the statuses that occurred. Every epoch of a stretch
contributes to the common value. *Chosen rows* are single epochs: every k-th epoch, and epochs of interest of several
kinds, for example alarms. Epochs of a kind are left out only if the kind has more epochs than its share of the limit.
Counts and statistics use all epochs.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped, UInt8

_NOTHING_16 = 0xFFFF
_NOTHING_8 = 0xFF


def packed(values: Shaped[np.ndarray, "*n"]) -> dict[str, str]:
    """Return an array in the form that the script of the page reads: type, and little-endian values in base64."""
    little = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    return {"type": values.dtype.name, "base64": base64.b64encode(little.tobytes()).decode()}


def scaled(values: Float[np.ndarray, "*n"], top: float, *, bits: int) -> dict[str, str]:
    """Return values between 0 and `top` as whole numbers of 8 or 16 bits; the largest whole number means NaN."""
    nothing, kind = (_NOTHING_8, np.uint8) if bits == 8 else (_NOTHING_16, np.uint16)
    steps = np.round(np.nan_to_num(values) / top * (nothing - 1))
    return packed(np.where(np.isnan(values), nothing, steps).astype(kind))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretches:
    """Stretches of `length` consecutive epochs; the last stretch may be shorter."""

    starts: Int[np.ndarray, " n_stretches"]  # first epoch of each stretch
    begin_s: Float[np.ndarray, " n_stretches"]  # time of the first epoch of each stretch
    end_s: Float[np.ndarray, " n_stretches"]  # time of the last epoch of each stretch, plus one interval
    length: int

    def mean(self, values: Float[np.ndarray, "n_epochs ..."]) -> Float[np.ndarray, "n_stretches ..."]:
        """Return the mean of the finite values in each stretch; NaN if a stretch has no finite value."""
        known = np.isfinite(values)
        total = np.add.reduceat(np.where(known, values, 0.0), self.starts, axis=0)
        count = np.add.reduceat(known.astype(np.int64), self.starts, axis=0)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def largest(self, values: Float[np.ndarray, "n_epochs ..."]) -> Float[np.ndarray, "n_stretches ..."]:
        """Return the largest known value in each stretch; NaN if a stretch has no known value."""
        return np.fmax.reduceat(values, self.starts, axis=0)

    def occurring(self, places: Int[np.ndarray, " n_epochs"], where: Bool[np.ndarray, " n_epochs"]) -> UInt8Array:
        """Return as bits which numbers from 0 to 7 occur in each stretch, at the epochs where `where` is true."""
        bits = np.where(where, 1 << places.astype(np.int64), 0).astype(np.uint8)
        return np.bitwise_or.reduceat(bits, self.starts)

    def drawn(self) -> dict[str, Any]:
        """Return the start times and end times of the stretches for the script."""
        return {"begin": packed(self.begin_s), "end": packed(self.end_s)}


UInt8Array = UInt8[np.ndarray, " n_stretches"]


def stretches(time_s: Float[np.ndarray, " n_epochs"], interval_s: float, limit: int) -> Stretches:
    """Divide epochs at the given times into at most `limit` stretches of equal length; the last stretch may be shorter.

    The function raises `ValueError` if there is no epoch.
    """
    if not time_s.size:
        raise ValueError("no epoch to draw")
    length = -(-time_s.size // limit)
    starts = np.arange(0, time_s.size, length)
    last = np.minimum(starts + length, time_s.size) - 1
    return Stretches(starts=starts, begin_s=time_s[starts], end_s=time_s[last] + interval_s, length=length)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Single epochs chosen for a drawing."""

    places: Int[np.ndarray, " n_rows"]
    every: dict[str, int]  # k by kind of epoch: every k-th epoch of this kind is drawn


def chosen_rows(
    of_interest: Mapping[str, Bool[np.ndarray, " n_epochs"]], everything: Bool[np.ndarray, " n_epochs"], limit: int
) -> Rows:
    """Return the epochs to draw: all epochs if `limit` allows, otherwise every k-th epoch and epochs of interest.

    Half of `limit` is for every k-th epoch. The kinds of epochs of interest share the other half of `limit` equally.
    """
    if np.count_nonzero(everything) <= limit:
        return Rows(places=np.flatnonzero(everything), every={"epochs": 1})
    share = limit // 2
    places, every = [], {}
    for kind, mask in ({"epochs": everything} | dict(of_interest)).items():
        found = np.flatnonzero(mask & everything)
        every[kind] = max(1, -(-found.size // share))
        share = limit // 2 // len(of_interest)
        places.append(found[:: every[kind]])
    return Rows(places=np.unique(np.concatenate(places)), every=every)


def outermost(values: Float[np.ndarray, " n"], count: int) -> Bool[np.ndarray, " n"]:
    """Return a mask of the smallest and the largest value in each of `count` equal parts."""
    found = np.zeros(values.size, dtype=bool)
    for part in np.array_split(np.arange(values.size), min(count, max(1, values.size))):
        known = part[np.isfinite(values[part])]
        if known.size:
            found[known[np.argmin(values[known])]] = found[known[np.argmax(values[known])]] = True
    return found
