"""All satellites of a sky in view of a receiver, as arrays over epochs and satellites."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float

from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.line_of_sight import LineOfSight, ReceiverMotion, line_of_sight
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class Sky:
    """All satellites that are in view at some epoch, n epochs by m satellites."""

    svids: tuple[int, ...]  # one for each column, ascending
    # this and what follows as in `LineOfSight`; also while a satellite is not in view
    range_m: Float[np.ndarray, "n m"]
    rate_mps: Float[np.ndarray, "n m"]
    acceleration_mps2: Float[np.ndarray, "n m"]
    azimuth_rad: Float[np.ndarray, "n m"]
    elevation_rad: Float[np.ndarray, "n m"]
    satellite_clock_m: Float[np.ndarray, "n m"]
    satellite_clock_mps: Float[np.ndarray, "n m"]
    in_view: Bool[np.ndarray, "n m"]  # whether it is at or above the elevation mask


def sky(
    ephemerides: Sequence[Ephemeris],
    start: GalileoTime,
    elapsed_s: Float[np.ndarray, " n"],
    motion: ReceiverMotion,
    *,
    mask_deg: float = 5.0,
) -> Sky:
    """Return the satellites that a receiver has in view at reception times `start` + `elapsed_s` in system time.

    Raises
    ------
    ValueError
        If a satellite has two ephemerides.
    """
    svids = [ephemeris.svid for ephemeris in ephemerides]
    if len(set(svids)) != len(svids):
        raise ValueError("one ephemeris for each satellite")
    mask = np.radians(mask_deg)
    seen = {}
    for ephemeris in sorted(ephemerides, key=lambda one: one.svid):
        sight = line_of_sight(ephemeris, start, elapsed_s, motion)
        if np.any(sight.elevation_rad >= mask):
            seen[ephemeris.svid] = sight
    empty = np.zeros((elapsed_s.size, 0))
    columns = {
        field.name: np.stack([getattr(sight, field.name) for sight in seen.values()], axis=1) if seen else empty
        for field in fields(LineOfSight)
    }
    return Sky(svids=tuple(seen), in_view=columns["elevation_rad"] >= mask, **columns)
