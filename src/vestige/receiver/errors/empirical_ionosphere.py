"""Draw the ionosphere residual E6 − E1 from the distribution of measured samples in a file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr

from vestige.crypto.file_bytes import read_bytes
from vestige.errors import InputFileError
from vestige.receiver.errors.error_process import Streams
from vestige.receiver.errors.ionosphere import PASS_TAU_S, Correlation, IonosphereProcess

IONOSPHERE_COLUMN = "e6_minus_e1_m"  # header of the CSV file
LARGEST_FILE = 1 << 28  # largest size in bytes, about 10 million samples
LARGEST_RESIDUAL_M = 1000.0  # largest plausible residual in m; the worst ionosphere causes 100 m


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EmpiricalIonosphere:
    """Ionosphere residual with the distribution of given samples, correlated in time as `HeavyTailedIonosphere`.

    The distribution function F is linear between the sorted samples. Sample number k of n has F = (k − ½)/n. No draw
    lies below the smallest or above the largest sample.

    Attributes
    ----------
    samples_m
        Differential residuals E6 − E1 in m, in any order.
    correlation, tau_s, code_only
        Parameters of `HeavyTailedIonosphere`.
    """

    samples_m: Float[np.ndarray, " n"]
    correlation: Correlation = "iid"
    tau_s: float = PASS_TAU_S
    code_only: bool = False
    kind: Literal["empirical"] = "empirical"

    def __post_init__(self) -> None:
        if self.samples_m.size == 0 or not np.all(np.isfinite(self.samples_m)):
            raise ValueError("a distribution needs at least one sample, and finite samples only")

    def process(self, streams: Streams) -> IonosphereProcess:
        """Return a realisation for one satellite from its streams."""
        ordered = np.sort(self.samples_m)
        places = (np.arange(ordered.size) + 0.5) / ordered.size

        def quantile(z: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
            return np.interp(ndtr(z), places, ordered)

        return IonosphereProcess(quantile, self.correlation, self.tau_s, streams)


def read_residuals(path: Path) -> Float[np.ndarray, " n"]:
    """Read residuals in m from a CSV file with the header `e6_minus_e1_m` and one number on each line.

    The function raises `InputFileError` if the file cannot be read, is longer than `LARGEST_FILE`, has another header
    or no sample, or does not end with a line end. The function also raises `InputFileError` if a line is not a number
    within ±`LARGEST_RESIDUAL_M`.
    """
    lines = _text(path).split("\n")
    if lines[0].strip() != IONOSPHERE_COLUMN:
        raise InputFileError(path, "line 1", lines[0].strip(), IONOSPHERE_COLUMN)
    if lines.pop() != "":
        raise InputFileError(path, f"line {len(lines) + 1}", "no line end, end of the file", "a whole line")
    samples = np.empty(len(lines) - 1)
    for number, line in enumerate(lines[1:], start=2):
        try:
            value = float(line) if line.isascii() and "_" not in line else math.nan
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST_RESIDUAL_M:
            raise InputFileError(path, f"line {number}", line.strip(), f"a number within ±{LARGEST_RESIDUAL_M:g}")
        samples[number - 2] = value
    if not samples.size:
        raise InputFileError(path, "file", "no samples", "at least one")
    return samples


def _text(path: Path) -> str:
    """Return the contents of a regular file of limited size as Latin-1 text, without a byte-order mark."""
    data = read_bytes(path, at_most=LARGEST_FILE)
    return data.removeprefix(b"\xef\xbb\xbf").decode("latin-1").replace("\r\n", "\n")
