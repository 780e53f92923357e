"""Compute the powers of a search on a GPU, by overlap-save correlation in batches of many blocks and Doppler bins.

One call processes about 0.2 s of samples. The samples go to the GPU as int16 and become overlapping blocks of
complex64. The spectra of the blocks are multiplied with the spectra of the codes at the shift of every bin. A batched
inverse FFT gives the correlations. Then the largest power over the bins is found for each code offset. Only this power
is copied from the GPU: 4 bytes for each code, grid and offset. `overlap_save` explains how blocks are cut and how a bin
becomes a shift.

Calls may come from several threads. Each call takes one of `_LANES` lanes with its own stream and batch, so a call can
compute while another call sends or receives. `Device` has all operations that need the GPU, and this file has
operations on arrays only. `cuda_device.CudaDevice` is the device for CuPy. The tests use a device for numpy, so that no
GPU is needed.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from queue import SimpleQueue
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Int8, Int16

from vestige.sample_processor.search.engines.cuda_device import cuda_device, first_line
from vestige.sample_processor.search.engines.engine import EngineUnavailableError
from vestige.sample_processor.search.engines.fft_engine import FftEngine
from vestige.sample_processor.search.engines.overlap_save import OverlapSave

_LANES = 2
_BATCH_BYTES = 1 << 28  # memory in bytes for the inverse transforms of a lane; cuFFT needs the same amount again
_BLOCK = 1 << 20  # approximate number of code offsets in a call
_CHECKED = 100  # number of code offsets whose powers a GPU must compute correctly before the GPU is used


@runtime_checkable
class Device(Protocol):
    """Operations of the engine on the arrays of a GPU.

    Attributes
    ----------
    xp
        Module whose arrays all operations use: cupy, or numpy in tests.
    """

    xp: Any

    def stream(self) -> AbstractContextManager[object]:
        """Return a context in which the GPU works in order, independently of other contexts."""
        ...

    def constant(self, values: np.ndarray) -> Any:
        """Return values as an array that every stream may read."""
        ...

    def plan(self, rows: Any) -> Any:
        """Return the plan that `inverse` needs for arrays of the shape of `rows`."""
        ...

    def forward(self, blocks: Any) -> Any:
        """Return the FFT of `blocks`, complex64[…, length], over the last axis."""
        ...

    def multiply(self, spectra: Any, code: Any, shifts: Any, rows: Any) -> None:
        """Fill rows[block, bin, k] with spectra[block, k] · code[k − shifts[bin]], modulo the length.

        `rows` may have more bins than `shifts` has elements. The additional bins do not change.
        """
        ...

    def inverse(self, rows: Any, plan: Any) -> None:
        """Replace `rows`, complex64[blocks, bins, length], by the inverse FFT over the last axis, times the length."""
        ...

    def raise_to_powers(self, rows: Any, n_bins: int, best: Any) -> None:
        """Set best[block, offset] to the maximum of its value and all |rows[block, bin, offset]|² of `n_bins` bins."""
        ...

    def download(self, values: Any) -> Float32[np.ndarray, "..."]:
        """Return float32 values as a numpy array, after all earlier work of the stream."""
        ...


@dataclass(frozen=True, slots=True)
class _Lane:
    """A stream, a batch complex64[blocks, bins, length] for inverse transforms, and the plan for the transforms."""

    stream: AbstractContextManager[object]
    rows: Any
    plan: Any


class CudaEngine:
    """Engine that computes powers of codes of equal length on a GPU; the docstring of the module explains the method.

    Parameters
    ----------
    codes
        Codes of ±1; each has 1, 2, 4, 8 or 16 ms of chips.
    device
        Operations of the GPU; None takes the current GPU.

    Raises
    ------
    EngineUnavailableError
        If CuPy or a GPU that CuPy can use is missing, or the GPU has too little memory.
    """

    uses_cores = False

    def __init__(self, codes: Int8[np.ndarray, "codes chips"], device: Device | None = None) -> None:
        if device is None:
            device = cuda_device()
        self._device, self._cut = device, OverlapSave.of(codes.shape[1])
        self.loss_db = self._cut.loss_db
        blocks_in_call = max(1, _BLOCK // self._cut.offsets)
        self.block = blocks_in_call * self._cut.offsets
        shape = (*_batch(self._cut, 2 * blocks_in_call), self._cut.length)
        self._lanes: SimpleQueue[_Lane] = SimpleQueue()
        try:
            self._spectra = device.constant(self._cut.spectra(codes))
            self._shifts = device.constant(self._cut.shifts.astype(np.int32))
            for _ in range(_LANES):
                rows = device.xp.empty(shape, np.complex64)
                self._lanes.put(_Lane(device.stream(), rows, device.plan(rows)))
        except MemoryError as error:
            found = f"the GPU has too little free memory ({first_line(error)})"
            raise EngineUnavailableError("cuda", found, "close what else uses the GPU") from error

    def powers(
        self,
        chips: Int16[np.ndarray, "grids 2 n"],
        n_offsets: int,
        threshold: float = 0.0,  # noqa: ARG002  (this engine computes all cells)
    ) -> Float32[np.ndarray, "codes grids n_offsets"]:
        """Return the largest power over the Doppler bins, for every code, grid and code offset."""
        lane = self._lanes.get()
        try:
            with lane.stream:
                return self._powers(chips, n_offsets, lane)
        finally:
            self._lanes.put(lane)

    def _powers(
        self, chips: Int16[np.ndarray, "grids 2 n"], n_offsets: int, lane: _Lane
    ) -> Float32[np.ndarray, "codes grids n_offsets"]:
        """Return the powers of `chips`, computed with the stream and the batch of one lane."""
        xp, n_grids = self._device.xp, chips.shape[0]
        in_grid = -(-n_offsets // self._cut.offsets)
        spectra = self._device.forward(self._blocks(xp.asarray(chips), in_grid))
        n_blocks, n_bins = n_grids * in_grid, self._shifts.size
        best = xp.zeros((self._spectra.shape[0], n_blocks, self._cut.offsets), np.float32)
        blocks_at_once, bins_at_once, _ = lane.rows.shape
        for code, out in zip(self._spectra, best, strict=True):
            for block in range(0, n_blocks, blocks_at_once):
                some = slice(block, block + blocks_at_once)
                for low in range(0, n_bins, bins_at_once):
                    shifts = self._shifts[low : low + bins_at_once]
                    rows = lane.rows[: spectra[some].shape[0]]
                    self._device.multiply(spectra[some], code, shifts, rows)
                    self._device.inverse(lane.rows, lane.plan)
                    self._device.raise_to_powers(rows, shifts.size, out[some])
        found = self._device.download(best)
        return found.reshape(self._spectra.shape[0], n_grids, -1)[:, :, :n_offsets]

    def _blocks(self, chips: Any, in_grid: int) -> Any:
        """Return overlapping blocks complex64[grids · in_grid, length] of int16[grids, 2, n], padded with zeros."""
        xp, length, offsets = self._device.xp, self._cut.length, self._cut.offsets
        n_grids, _, n = chips.shape
        total = (in_grid - 1) * offsets + length
        samples = xp.zeros((n_grids, total, 2), np.float32)
        samples[:, : min(n, total)] = xp.swapaxes(chips, 1, 2)[:, :total]
        samples = samples.view(np.complex64)[..., 0]
        size = samples.itemsize
        strides = (total * size, offsets * size, size)
        blocks = xp.lib.stride_tricks.as_strided(samples, (n_grids, in_grid, length), strides)
        return blocks.reshape(n_grids * in_grid, length)


def _batch(cut: OverlapSave, n_blocks: int) -> tuple[int, int]:
    """Return the numbers of blocks and bins that are transformed at once: whole blocks, or a part of a block's bins."""
    transforms = max(1, _BATCH_BYTES // (8 * cut.length))
    n_bins = cut.shifts.size
    if transforms >= 2 * n_bins:
        parts = -(-n_blocks // min(transforms // n_bins, n_blocks))
        return -(-n_blocks // parts), n_bins
    return 1, -(-n_bins // -(-n_bins // transforms))


@cache
def checked_gpu() -> str:
    """Return the name of the current GPU after it has computed the same powers as the engine `fft`.

    Raises
    ------
    EngineUnavailableError
        If CuPy or a GPU that CuPy can use is missing, or if the GPU fails or computes other powers.
    """
    device = cuda_device()
    rng = np.random.default_rng(1)
    codes = (1 - 2 * rng.integers(0, 2, (1, 5115))).astype(np.int8)
    chips = rng.integers(-20, 21, (1, 2, 5115 + _CHECKED), dtype=np.int16)
    expected = FftEngine(codes).powers(chips, _CHECKED)
    try:
        powers = CudaEngine(codes, device).powers(chips, _CHECKED)
    except EngineUnavailableError:
        raise
    except Exception as error:  # errors of CUDA have no other common class
        found = f"{device.name} fails in a short check ({first_line(error)})"
        raise EngineUnavailableError("cuda", found, "check the versions of CuPy and the driver") from error
    if not np.allclose(powers, expected, rtol=0, atol=1e-4 * expected.max()):
        found = f"{device.name} computes other powers than the engine fft in a short check"
        raise EngineUnavailableError("cuda", found, "report it with the versions of CuPy and the driver")
    return device.name
