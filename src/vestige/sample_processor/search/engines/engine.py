"""Define the interface of the engines that compute the powers of the exhaustive search.

An engine gets samples that are summed into chips. The engine returns, for every code offset, the largest power over the
Doppler bins. The power of a tested cell may be too low by up to `loss_db`. The search computes exact values
(`exact_cell`) at offsets with a power near or above the threshold, and only an exact value decides. So the values of a
found signal do not contain the errors of an engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Float64, Int16

from vestige.errors import UnsupportedError
from vestige.signals.definitions import E6C

CHIP_RATE_HZ = E6C.chip_rate_hz
DOPPLER_POINTS = 256  # number of points of the Doppler transform
CHIP_SIGMA = 12.0  # standard deviation of the sums over chips that an engine gets; rounding costs 0.003 dB
CLIP = 102  # largest value that an engine gets, 8.5 σ, so that a sum of 320 chips fits int16


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Doppler bins of a coherent sum, and the numbers that the segment engine needs to compute these bins.

    Attributes
    ----------
    segment_chips
        Number M of chips in a segment; the carrier is not removed within a segment.
    stride
        Step between the bins that are used, counted in bins; neighbouring bins are 1/(256 M) of the chip rate apart.
    split
        Number of groups of segments that are joined coherently, which is also the number of sub-bins of a bin.
    reach
        Number of bins on each side of the middle bin, before bins are split or left out.
    half_width_hz
        Largest distance of a Doppler from the middle of its pass, in Hz. At this distance a replica with the code
        Doppler of the middle loses at most 0.24 dB. A wider span needs several passes, each with its own middle.
    """

    segment_chips: int
    stride: int
    split: int
    reach: int
    half_width_hz: float

    @property
    def spacing_hz(self) -> float:
        """Distance between the bins in Hz, before bins are split or left out."""
        return CHIP_RATE_HZ / (self.segment_chips * DOPPLER_POINTS)

    @property
    def sub_bin_hz(self) -> float:
        """Distance of the outermost sub-bin from its bin in Hz."""
        return self.spacing_hz * (0.5 - 0.5 / self.split)

    @property
    def bins_hz(self) -> Float64[np.ndarray, " bins"]:
        """Doppler bins relative to the middle in Hz; for a sum over T seconds, the bins are 1/(2 T) apart to 0.1 %."""
        whole = np.arange(-(self.reach // self.stride) * self.stride, self.reach + 1, self.stride)
        parts = (np.arange(self.split) + 0.5) / self.split - 0.5
        return self.spacing_hz * (whole[:, None] + parts).reshape(-1)


# grid by the number of chips of the coherent sum, for 1, 2, 4, 8 and 16 ms
GRIDS = {
    5115: Grid(segment_chips=160, stride=4, split=1, reach=40, half_width_hz=5000.0),
    10_230: Grid(segment_chips=160, stride=2, split=1, reach=40, half_width_hz=5000.0),
    20_460: Grid(segment_chips=160, stride=1, split=1, reach=40, half_width_hz=5000.0),
    40_920: Grid(segment_chips=320, stride=1, split=1, reach=40, half_width_hz=2500.0),
    81_840: Grid(segment_chips=320, stride=1, split=2, reach=27, half_width_hz=5000.0 / 3),
}


@runtime_checkable
class Engine(Protocol):
    """Interface of an engine, which computes the powers of the exhaustive search.

    Attributes
    ----------
    loss_db
        Largest loss of the power of a tested cell against its exact value, in dB.
    block
        Number of code offsets that are best computed at once.
    uses_cores
        Whether calls from several threads run in parallel, each on a core of the processor.
    """

    loss_db: float
    block: int
    uses_cores: bool

    def powers(
        self, chips: Int16[np.ndarray, "grids 2 n"], n_offsets: int, threshold: float = 0.0
    ) -> Float32[np.ndarray, "codes grids n_offsets"]:
        """Return the largest |Σ chip · sample · e^{−j2πft}|² over the bins, for every code, grid and code offset.

        Parameters
        ----------
        chips
            Samples summed into chips, real and imaginary part, on each grid. The number of chips is `n_offsets` plus
            the length of the codes.
        threshold
            Threshold of the magnitude, in standard deviations of the noise per dimension. An engine may return zero for
            an offset whose cells are probably below the threshold. The share of lost detections is computed in
            `theory/screen_loss.py`.
        """
        ...


def chip_variance(chips: Int16[np.ndarray, "grids 2 n"]) -> float:
    """Return the variance, per dimension, of samples that are summed into chips."""
    return float(np.mean(np.square(chips, dtype=np.float32)))


class EngineUnavailableError(UnsupportedError):
    """An engine cannot run on this machine.

    Parameters
    ----------
    engine
        Name of the engine.
    found
        Reason why the engine cannot run, for example a missing library.
    remedy
        Action of the user that makes the engine run.
    """

    def __init__(self, engine: str, found: str, remedy: str) -> None:
        super().__init__(f"engine {engine}: {found}: {remedy}, or take --engine auto")
        self.engine, self.found, self.remedy = engine, found, remedy

    def __reduce__(self) -> tuple[type[EngineUnavailableError], tuple[str, str, str]]:
        """Return the class and the arguments that rebuild the error, because worker processes return pickled errors."""
        return type(self), (self.engine, self.found, self.remedy)
