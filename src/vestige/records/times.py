"""Store Galileo times in arrays with full precision, as whole seconds and fractions of a second."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64

from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, eq=False)
class GalileoTimes:
    """Array of times in Galileo System Time."""

    second: Int64[np.ndarray, "*n"]  # whole seconds since the GST epoch (`GalileoTime.gst_seconds`)
    fraction: Float[np.ndarray, "*n"]  # fraction of the second, [0, 1), in s

    @classmethod
    def of(cls, times: Iterable[GalileoTime]) -> GalileoTimes:
        """Return an array of the given times."""
        times = tuple(times)
        return cls(
            np.array([time.gst_seconds for time in times], np.int64),
            np.array([time.fraction for time in times], np.float64),
        )

    @classmethod
    def after(cls, start: GalileoTime, elapsed_s: Float[np.ndarray, "*n"]) -> GalileoTimes:
        """Return the times `elapsed_s` after a start, with exactly the values of `start + elapsed_s`."""
        whole = np.floor(elapsed_s)
        return cls(start.gst_seconds + whole.astype(np.int64), start.fraction + (elapsed_s - whole))._carried()

    def __len__(self) -> int:
        return len(self.second)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array."""
        return self.second.shape

    def reshaped(self, shape: tuple[int, ...]) -> GalileoTimes:
        """Return the times in an array of another shape; a single time is repeated for every element."""
        second, fraction = self.second, self.fraction
        if self.second.size == 1:
            return GalileoTimes(np.broadcast_to(second, shape), np.broadcast_to(fraction, shape))
        return GalileoTimes(second.reshape(shape), fraction.reshape(shape))

    def at(self, *place: int) -> GalileoTime:
        """Return the time at an index."""
        return GalileoTime.from_gst_seconds(int(self.second[place]), float(self.fraction[place]))

    def __getitem__(self, part: slice | np.ndarray) -> GalileoTimes:
        """Return the times at the given indices of the first axis."""
        return GalileoTimes(self.second[part], self.fraction[part])

    def since(self, origin: GalileoTime) -> Float[np.ndarray, "*n"]:
        """Return the times in s after an origin, with exactly the values of `time - origin`."""
        return (self.second - origin.gst_seconds) + (self.fraction - origin.fraction)

    def __sub__(self, other: GalileoTimes) -> Float[np.ndarray, "*n"]:
        """Return the difference self − other in s."""
        return (self.second - other.second) + (self.fraction - other.fraction)

    def __add__(self, seconds: Float[np.ndarray, "*n"]) -> GalileoTimes:
        """Return the times that are later by `seconds`."""
        whole = np.floor(seconds)
        return GalileoTimes(self.second + whole.astype(np.int64), self.fraction + (seconds - whole))._carried()

    def _carried(self) -> GalileoTimes:
        """Return the times with every fraction in [0, 1) s, as `GalileoTime.normalized` does for a single time."""
        whole = np.floor(self.fraction)
        fraction = self.fraction - whole
        rounded = fraction >= 1.0  # a tiny negative fraction rounds up to 1.0
        return GalileoTimes(self.second + whole.astype(np.int64) + rounded, np.where(rounded, 0.0, fraction))
