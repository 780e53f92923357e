"""Results of a campaign as figures read them, drawn from the correlator-domain model: a triangle in Gaussian noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from vestige.acas_processor.detectors import EarlyDetector, MaximumDetector
from vestige.acas_processor.measure import detect_block
from vestige.campaign.plan import Column, Coord
from vestige.campaign.run import run

CHIP_M = 299_792_458 / 5.115e6
DETECTORS = {"early": EarlyDetector(), "maximum": MaximumDetector()}

# time in s -> delay in m and amplitude against the line of sight
Spoofer = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def lift_off(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Approach the true signal from the right, weak; rest on it at 600 s; then louder, and away."""
    delay_m = 75 * (1 - np.sin(np.pi / 2 * np.clip((time_s - 100) / 500, 0, 1)))
    delay_m += 90 * (1 - np.cos(np.pi / 2 * np.clip((time_s - 700) / 600, 0, 1)))
    return delay_m, np.where(time_s < 600, 0.3, 0.3 + 1.2 * np.clip((time_s - 600) / 150, 0, 1))


def campaign_results(
    n_epochs: int = 400,
    *,
    cn0_dbhz: float = 35.0,
    svids: tuple[int, ...] = (11,),
    spoofer: Spoofer | None = None,
    unavailable: slice = slice(0, 0),
    seed: int = 1,
) -> xarray.Dataset:
    """Return results with the variables and attributes of a campaign.

    Parameters
    ----------
    unavailable
        Epochs without a correlation: NaN, as in a recording with gaps.
    """
    rng = np.random.default_rng(seed)
    time_s, offsets_m, integration_s, p_fa = np.arange(n_epochs, dtype=float), np.arange(-5, 6) * 15.0, 0.016, 1e-7
    variance = 1 / (10 ** (cn0_dbhz / 10) * integration_s)
    covariance = _triangle(offsets_m[:, None] - offsets_m) * variance
    shape = (n_epochs, len(svids), offsets_m.size)
    taps = (rng.standard_normal((*shape, 2)) @ [1, 1j]) @ np.linalg.cholesky(covariance / 2).T
    # E1 noise and a differential ionosphere with exponential tails
    tail_m = rng.choice([-1, 1], shape[:2]) * (2.65 + rng.exponential(1.17, shape[:2]))
    iono_m = np.where(rng.random(shape[:2]) < 0.1, tail_m, rng.normal(0, 1.24, shape[:2]))
    delay_m = iono_m + rng.normal(0, 0.8, shape[:2])
    phase_rad = rng.uniform(0, 2 * np.pi, len(svids)) + 2e-3 * np.cumsum(rng.standard_normal(shape[:2]), axis=0)
    taps += np.exp(1j * phase_rad)[..., None] * _triangle(delay_m[..., None] - offsets_m)
    truth: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    if spoofer is not None:
        later_m, amplitude = spoofer(time_s)
        power_db = 20 * np.log10(amplitude)
        truth = {
            "truth_prediction_error_m": (("epoch", "satellite"), delay_m),
            "predicted_phase_rad": (("epoch", "satellite"), phase_rad),
            "truth_spoofer_offset_m": (("epoch", "satellite", "attack"), _everywhere(later_m, len(svids))),
            "truth_spoofer_power_db": (("epoch", "satellite", "attack"), _everywhere(power_db, len(svids))),
        }
        turns = np.cumsum(np.abs(np.gradient(later_m))) / 6 + 0.002 * time_s
        spoofed = amplitude[:, None, None] * _triangle(later_m[:, None, None] - offsets_m)
        taps += np.exp(1j * phase_rad)[..., None] * np.exp(2j * np.pi * turns)[:, None, None] * spoofed
    noise_power = np.full(shape[:2], variance)
    taps[unavailable], noise_power[unavailable] = np.nan, np.nan

    threshold_sigma = float(np.sqrt(-2 * np.log(p_fa)))
    found = [
        [
            detect_block(taps[:, i], noise_power[:, i], offsets_m, detector=detector, threshold_sigma=threshold_sigma)
            for i in range(len(svids))
        ]
        for detector in DETECTORS.values()
    ]

    def column(name: str, dtype: type) -> tuple[tuple[str, ...], np.ndarray]:
        values = [[getattr(block, name) for block in blocks] for blocks in found]
        return ("detector", "epoch", "satellite"), np.moveaxis(np.array(values), 1, 2).astype(dtype)

    return xarray.Dataset(
        {
            "time_s": ("epoch", time_s),
            "taps": (("epoch", "satellite", "tap"), taps.astype(np.complex64)),
            "noise_power": (("epoch", "satellite"), noise_power.astype(np.float32)),
            "tap_index": column("tap", np.int8),
            "magnitude_sigma": column("magnitude_sigma", np.float32),
            "phase_rad": column("phase_rad", np.float32),
            "range_offset_m": column("range_offset_m", np.float32),
            **truth,
        },
        coords={
            "svid": ("satellite", np.array(svids)),
            "tap_offset_m": ("tap", offsets_m),
            "detector": ("detector", list(DETECTORS)),
            **({"attack": ("attack", ["0 lift-off"])} if truth else {}),
        },
        attrs={
            "p_fa": p_fa,
            "threshold_sigma": threshold_sigma,
            "cn0_dbhz": cn0_dbhz,
            "integration_s": integration_s,
            "fidelity": "correlators",
        },
    )


def _everywhere(values: np.ndarray, n_satellites: int) -> np.ndarray:
    """Return values over epochs as those of one attack on all satellites."""
    return np.repeat(values[:, None, None], n_satellites, axis=1)


def _triangle(distance_m: np.ndarray) -> np.ndarray:
    return np.clip(1 - np.abs(distance_m) / CHIP_M, 0, None)


@dataclass(frozen=True, kw_only=True)
class RecordedPlan:
    """A campaign whose results are known: how results come into a store."""

    results: xarray.Dataset
    breaks_at: int | None = None  # epoch at which the campaign ends as by an error

    @property
    def n_epochs(self) -> int:
        return self.results.sizes["epoch"]

    @property
    def columns(self) -> dict[str, Column]:
        return {
            str(name): Column(
                dims=tuple(map(str, values.dims)), dtype=str(values.dtype), units="1", long_name=str(name)
            )
            for name, values in self.results.data_vars.items()
        }

    @property
    def coords(self) -> dict[str, Coord]:
        return {
            str(name): Coord(dim=str(values.dims[0]), values=values.values, units="1", long_name=str(name))
            for name, values in self.results.coords.items()
        }

    @property
    def attrs(self) -> dict[str, Any]:
        return dict(self.results.attrs)

    def prepare(self) -> RecordedPlan:
        return self

    def advance(self, first: int, count: int) -> dict[str, np.ndarray]:
        return {"epoch": np.arange(first, first + count)}

    def measure(self, first: int, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        if self.breaks_at is not None and self.breaks_at in inputs["epoch"]:
            raise RuntimeError("an error in the middle of a campaign")
        part = self.results.isel(epoch=inputs["epoch"])
        return {str(name): np.ascontiguousarray(values.values) for name, values in part.data_vars.items()}


def stored(results: xarray.Dataset, path: Path) -> Path:
    """Return the store with these results, as a campaign writes it."""
    run(RecordedPlan(results=results), path)
    return path
