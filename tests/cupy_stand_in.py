"""A stand-in for CuPy on machines without a GPU: numpy's arrays, scipy's FFT, and kernels compiled for the processor.

The kernels are the text that a GPU gets. A C++ compiler makes a library of them, in which a loop runs all threads of a
launch. So their index arithmetic and the sizes of their launches are tested wherever there is such a compiler.
"""

from __future__ import annotations

import ctypes
import subprocess
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import fft

_BEFORE = """
#include <math.h>
#include <stddef.h>
#define __global__
struct float2 { float x, y; };
struct dim3 { unsigned x, y, z; };
static thread_local dim3 blockIdx, blockDim, threadIdx;
static float2 make_float2(float x, float y) { return {x, y}; }
"""
_BEHIND = """
template <class... T> static void launch(void (*kernel)(T...), const unsigned* grid, unsigned threads, T... arguments)
{
    blockDim = {threads, 1, 1};
    for (unsigned z = 0; z < grid[2]; ++z)
        for (unsigned y = 0; y < grid[1]; ++y)
            for (unsigned x = 0; x < grid[0]; ++x)
                for (unsigned thread = 0; thread < threads; ++thread) {
                    blockIdx = {x, y, z};
                    threadIdx = {thread, 0, 0};
                    kernel(arguments...);
                }
}
extern "C" void launch_multiply(
    const unsigned* grid, unsigned threads,
    const float2* spectra, const float2* code, const int* shifts, float2* rows, int stride, int length)
{ launch(multiply, grid, threads, spectra, code, shifts, rows, stride, length); }
extern "C" void launch_raise_to_powers(
    const unsigned* grid, unsigned threads,
    const float2* rows, float* best, int bins, int stride, int length, int offsets)
{ launch(raise_to_powers, grid, threads, rows, best, bins, stride, length, offsets); }
"""


class _Array(np.ndarray):
    def get(self, *, out: np.ndarray) -> None:
        out[...] = self


class _Plan:
    """As `cupy.cuda.cufft.Plan1d`: transforms of one length, one behind the other in memory."""

    def __init__(self, length: int, kind: str, batch: int) -> None:
        assert kind == "C2C"
        self.shape = (batch, length)

    def fft(self, x: np.ndarray, out: np.ndarray, direction: str) -> None:
        assert direction == "inverse"
        assert x.flags.c_contiguous
        assert x.size == self.shape[0] * self.shape[1]
        out[...] = fft.ifft(x.reshape(self.shape), axis=1, norm="forward").reshape(x.shape)


def _raw_module(compiler: str, folder: Path) -> Any:
    class RawModule:
        def __init__(self, *, code: str) -> None:
            source, library = folder / "kernels.cpp", folder / "kernels.so"
            source.write_text(_BEFORE + code + _BEHIND)
            subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", library, source], check=True)  # noqa: S603
            self._library = ctypes.CDLL(str(library))

        def get_function(self, name: str) -> Any:
            launch = getattr(self._library, f"launch_{name}")

            def kernel(grid: tuple[int, ...], threads: tuple[int], arguments: tuple[Any, ...]) -> None:
                sizes = (ctypes.c_uint * 3)(*grid, *(1,) * (3 - len(grid)))
                passed = [
                    ctypes.c_void_p(one.ctypes.data) if isinstance(one, np.ndarray) else ctypes.c_int(int(one))
                    for one in arguments
                ]
                launch(sizes, ctypes.c_uint(threads[0]), *passed)

            return kernel

    return RawModule


def cupy_stand_in(compiler: str, folder: Path) -> dict[str, Any]:
    """Return modules cupy and cupyx for `sys.modules`; the kernels are compiled in a folder."""
    cuda = SimpleNamespace(
        Device=lambda: SimpleNamespace(id=0),
        Stream=lambda *, non_blocking: nullcontext(non_blocking),
        cufft=SimpleNamespace(Plan1d=_Plan, CUFFT_C2C="C2C", CUFFT_INVERSE="inverse"),
        get_current_stream=lambda: SimpleNamespace(synchronize=lambda: None),
        runtime=SimpleNamespace(getDeviceProperties=lambda _: {"name": b"a stand-in"}),
    )
    cupy = SimpleNamespace(
        __version__="0",
        RawModule=_raw_module(compiler, folder),
        asarray=lambda x: np.array(x).view(_Array),
        cuda=cuda,
        empty=lambda shape, dtype: np.full(shape, np.nan, dtype).view(_Array),
        fft=fft,
        lib=np.lib,
        swapaxes=np.swapaxes,
        zeros=lambda shape, dtype: np.zeros(shape, dtype).view(_Array),
    )
    return {"cupy": cupy, "cupyx": SimpleNamespace(empty_pinned=np.empty)}
