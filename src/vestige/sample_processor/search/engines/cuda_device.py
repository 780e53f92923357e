"""Run the functions of the CUDA engine that need a GPU: FFTs by cuFFT, and two kernels.

Only this module imports CuPy. The speed of the GPU's memory limits the speed of a search. The kernel `multiply` writes
each product once. The inverse FFT reads the product and writes the correlation. The kernel `raise_to_powers` reads the
correlation once. Together the FFT and the kernels read or write the 8 bytes of each number 4 to 6 times.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from jaxtyping import Float32

from vestige.sample_processor.search.engines.engine import EngineUnavailableError

_THREADS = 256  # number of threads of a GPU block; the length of every transform is a multiple of this number
_KERNELS = r"""
extern "C" __global__ void multiply(
    const float2* spectra, const float2* code, const int* shifts, float2* rows, int stride, int length)
{
    const int k = blockIdx.x * blockDim.x + threadIdx.x;
    const int bin = blockIdx.y, block = blockIdx.z;
    const float2 s = spectra[(size_t)block * length + k];
    const float2 c = code[(k - shifts[bin]) & (length - 1)];
    rows[((size_t)block * stride + bin) * length + k] = make_float2(s.x * c.x - s.y * c.y, s.x * c.y + s.y * c.x);
}

extern "C" __global__ void raise_to_powers(
    const float2* rows, float* best, int bins, int stride, int length, int offsets)
{
    const int i = blockIdx.x * blockDim.x + threadIdx.x;
    const int block = blockIdx.y;
    if (i >= offsets) return;
    float most = best[(size_t)block * offsets + i];
    for (int bin = 0; bin < bins; ++bin) {
        const float2 y = rows[((size_t)block * stride + bin) * length + i];
        most = fmaxf(most, y.x * y.x + y.y * y.y);
    }
    best[(size_t)block * offsets + i] = most;
}
"""


class CudaDevice:
    """Current GPU, which the engine uses as its `Device` through CuPy.

    Attributes
    ----------
    xp
        The module cupy.
    name
        Name of the GPU.

    Raises
    ------
    EngineUnavailableError
        If CuPy is not installed, finds no GPU, or cannot compile for the GPU.
    """

    def __init__(self) -> None:
        try:
            self.xp: Any = import_module("cupy")
            self._cupyx: Any = import_module("cupyx")
            self._cufft: Any = self.xp.cuda.cufft  # this line loads the library cuFFT
        except ImportError as error:
            found = f"CuPy cannot be imported ({first_line(error)})"
            raise EngineUnavailableError("cuda", found, "pip install 'vestige[cuda]'") from error
        try:
            number = self.xp.cuda.Device().id
            self.name = str(self.xp.cuda.runtime.getDeviceProperties(number)["name"].decode())
            kernels = self.xp.RawModule(code=_KERNELS)
            self._multiply, self._raise = kernels.get_function("multiply"), kernels.get_function("raise_to_powers")
            self.forward(self.xp.zeros(_THREADS, np.complex64))
            self.xp.cuda.get_current_stream().synchronize()
        except Exception as error:  # errors of CUDA have no other common class
            found = f"CuPy {self.xp.__version__} finds no GPU that it can use ({first_line(error)})"
            raise EngineUnavailableError("cuda", found, "see what nvidia-smi says") from error

    def stream(self) -> Any:
        """Return a stream that does not wait for other streams."""
        return self.xp.cuda.Stream(non_blocking=True)

    def constant(self, values: np.ndarray) -> Any:
        """Return the values as an array on the GPU, which every stream may read."""
        there = self.xp.asarray(values)
        self.xp.cuda.get_current_stream().synchronize()
        return there

    def plan(self, rows: Any) -> Any:
        """Return the plan of cuFFT for the inverse transforms of an array, including the work area."""
        n_blocks, n_bins, length = rows.shape
        return self._cufft.Plan1d(length, self._cufft.CUFFT_C2C, n_blocks * n_bins)

    def forward(self, blocks: Any) -> Any:
        """Return the FFT of `blocks` over the last axis."""
        return self.xp.fft.fft(blocks, axis=-1)

    def multiply(self, spectra: Any, code: Any, shifts: Any, rows: Any) -> None:
        """Fill rows[block, bin, k] with spectra[block, k] · code[k − shifts[bin]], modulo the length."""
        n_blocks, stride, length = rows.shape
        numbers = (np.int32(stride), np.int32(length))
        self._multiply(
            (length // _THREADS, shifts.size, n_blocks), (_THREADS,), (spectra, code, shifts, rows, *numbers)
        )

    def inverse(self, rows: Any, plan: Any) -> None:
        """Replace `rows` by their inverse FFT over the last axis, without the factor 1/length."""
        plan.fft(rows, rows, self._cufft.CUFFT_INVERSE)

    def raise_to_powers(self, rows: Any, n_bins: int, best: Any) -> None:
        """Set best[block, offset] to the maximum of its value and all |rows[block, bin, offset]|² of `n_bins` bins."""
        n_blocks, stride, length = rows.shape
        offsets = best.shape[-1]
        numbers = (np.int32(n_bins), np.int32(stride), np.int32(length), np.int32(offsets))
        self._raise((-(-offsets // _THREADS), n_blocks), (_THREADS,), (rows, best, *numbers))

    def download(self, values: Any) -> Float32[np.ndarray, "..."]:
        """Return the values as a numpy array in page-locked memory, to which the GPU writes directly."""
        out: np.ndarray = self._cupyx.empty_pinned(values.shape, np.float32)
        values.get(out=out)
        return out


@cache
def cuda_device() -> CudaDevice:
    """Return the current GPU; the kernels are compiled once in a process.

    Raises
    ------
    EngineUnavailableError
        If CuPy is not installed, finds no GPU, or cannot compile for the GPU.
    """
    return CudaDevice()


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message that is not empty, or the error's class name if all are empty."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0] if lines else type(error).__name__
