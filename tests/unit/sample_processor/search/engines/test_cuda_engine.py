"""The CUDA engine with numpy in place of CuPy on every machine, and as it is where there is a GPU."""

from __future__ import annotations

import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

from builders import START, random_chips
from cupy_stand_in import cupy_stand_in
from engine_vector import CHECKED, MILLISECONDS, N_OFFSETS, direct_powers, engine_vector
from numpy_device import NumpyDevice
from search_builder import arrival, e6_source
from vestige.sample_processor.search.engines import choice, cuda_engine
from vestige.sample_processor.search.engines.cuda_device import CudaDevice, cuda_device
from vestige.sample_processor.search.engines.cuda_engine import CudaEngine, Device
from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, GRIDS, EngineUnavailableError
from vestige.sample_processor.search.engines.fft_engine import FftEngine
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.speed import expected_seconds


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Device:
    """CuPy's side of the engine with a stand-in for CuPy, which runs the kernels on the processor."""
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("needs a C++ compiler (c++) for the kernels")
    with pytest.MonkeyPatch.context() as patch:
        for name, module in cupy_stand_in(compiler, tmp_path_factory.mktemp("kernels")).items():
            patch.setitem(sys.modules, name, module)
        return CudaDevice()


DEVICES = ("numpy", "compiled", "gpu")
# The longest integrations of each device that are no slow tests: the direct sum takes long, and more so the kernels on
# the processor. The FFT engine, which computes the same, is quickly tested at 8 ms too.
QUICK_MS = {"numpy": 2, "compiled": 2, "gpu": 16}


@pytest.fixture(params=DEVICES)
def device(request: pytest.FixtureRequest) -> Device:
    if request.param == "numpy":
        return NumpyDevice()
    if request.param == "compiled":
        return request.getfixturevalue("compiled")
    try:
        return cuda_device()
    except EngineUnavailableError as error:
        pytest.skip(f"needs a GPU: {error.found}")


@pytest.mark.parametrize(
    ("ms", "device"),
    [
        pytest.param(ms, name, marks=[pytest.mark.slow] if ms > QUICK_MS[name] else [])
        for ms in MILLISECONDS
        for name in DEVICES
    ],
    indirect=["device"],
)
def test_cuda_engine_is_the_direct_sum(ms: int, device: Device) -> None:
    codes, x = engine_vector(ms)
    n = codes.shape[1]
    engine = CudaEngine(codes, device)
    fft = FftEngine(codes)
    powers = engine.powers(x, N_OFFSETS)
    step = CHIP_RATE_HZ / (fft.block + n - 1)
    rounded = np.rint(GRIDS[n].bins_hz / step) * step
    expected = direct_powers(codes, x, np.outer(rounded, np.arange(n) / CHIP_RATE_HZ))
    assert powers.shape == (2, 2, N_OFFSETS)
    assert np.max(np.abs(powers[:, :, CHECKED] - expected)) < 1e-5 * expected.max()
    assert np.unravel_index(np.argmax(powers), powers.shape) == (1, 1, 333)
    assert engine.loss_db == fft.loss_db
    assert engine.block % fft.block == 0


@pytest.mark.parametrize("batch", [1 << 18, 11 << 18, 47 << 18, 1 << 28])  # bytes: 1, 11, 47 and 1024 transforms
def test_batches_of_any_size_give_what_the_fft_engine_gives(
    batch: int, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1 ms, two codes, three blocks and a bit on each grid; 21 bins of 32,768 in one batch or in several."""
    monkeypatch.setattr(cuda_engine, "_BATCH_BYTES", batch)
    monkeypatch.setattr(cuda_engine, "_BLOCK", 60_000)
    rng = np.random.default_rng(4)
    codes = (1 - 2 * rng.integers(0, 2, (2, 5115))).astype(np.int8)
    engine, fft = CudaEngine(codes, device), FftEngine(codes)
    assert engine.block == 2 * fft.block
    n_offsets = 3 * fft.block + 100
    x = np.rint(12 * rng.standard_normal((2, 2, n_offsets + 5115))).astype(np.int16)
    expected = fft.powers(x, n_offsets)
    powers = engine.powers(x, n_offsets)
    assert powers.shape == expected.shape
    assert np.max(np.abs(powers - expected)) < 1e-5 * expected.max()
    one = engine.powers(x[1:, :, 7:], 1)
    assert one.shape == (2, 1, 1)
    np.testing.assert_allclose(one[:, 0, 0], expected[:, 1, 7], rtol=1e-3)


def test_calls_from_several_threads_do_not_mix(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cuda_engine, "_BLOCK", 1)
    rng = np.random.default_rng(5)
    codes = (1 - 2 * rng.integers(0, 2, (1, 5115))).astype(np.int8)
    engine = CudaEngine(codes, device)
    blocks = [np.rint(12 * rng.standard_normal((2, 2, 5115 + 900))).astype(np.int16) for _ in range(12)]
    alone = [engine.powers(one, 900) for one in blocks]
    with ThreadPoolExecutor(6) as pool:
        together = list(pool.map(lambda one: engine.powers(one, 900), blocks))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("ms", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_a_search_finds_the_same_bits_as_with_fft(ms: int, device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exact cells decide: peaks are equal, not just near."""
    monkeypatch.setattr(cuda_engine, "cuda_device", lambda: device)
    monkeypatch.setitem(choice._WHERE, "cuda", lambda: "a test")
    chips = random_chips(np.random.default_rng(8), 81_840)
    signals = [arrival(chips, 0.0011, 55.0, 4930.0), arrival(chips, 0.0032, 58.0, -4960.0, phase=2.0)]
    source = e6_source(signals, 0.0037 + ms * 1e-3, 4)
    peaks = []
    for engine in ("cuda", "fft"):
        search = ExhaustiveSearch(integration_s=ms * 1e-3, engine=engine)  # type: ignore[arg-type]
        *_, last = search.run(source, [chips], START, START + 1, 7.3)
        peaks.append(last.peaks)
    assert len(peaks[0]) == 2
    assert peaks[0] == peaks[1]
    assert expected_seconds(ExhaustiveSearch(integration_s=1e-3, engine="cuda"), 1e6) > 0


def test_without_cupy_the_error_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cupy", None)
    with pytest.raises(
        EngineUnavailableError, match=r"engine cuda: CuPy cannot be imported .*vestige\[cuda\]"
    ) as error:
        CudaDevice()
    assert "\n" not in str(error.value)


def test_without_a_gpu_the_error_says_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_device() -> None:
        raise RuntimeError("cudaErrorNoDevice: no CUDA-capable device is detected\nmore")

    cupy = SimpleNamespace(__version__="14.2.0", cuda=SimpleNamespace(Device=no_device, cufft=None))
    for name, module in {"cupy": cupy, "cupyx": SimpleNamespace()}.items():
        monkeypatch.setitem(sys.modules, name, module)
    with pytest.raises(EngineUnavailableError) as error:
        CudaDevice()
    assert str(error.value) == (
        "engine cuda: CuPy 14.2.0 finds no GPU that it can use "
        "(cudaErrorNoDevice: no CUDA-capable device is detected): see what nvidia-smi says, or take --engine auto"
    )


class _Named(NumpyDevice):
    name = "a test"


class _Wrong(_Named):
    def raise_to_powers(self, rows: np.ndarray, n_bins: int, best: np.ndarray) -> None:
        super().raise_to_powers(rows, n_bins - 1, best)


class _Failing(_Named):
    def inverse(self, rows: np.ndarray, plan: tuple[int, ...]) -> None:
        raise RuntimeError("CUFFT_INTERNAL_ERROR\nmore")


class _Full(_Named):
    def plan(self, rows: np.ndarray) -> tuple[int, ...]:
        raise MemoryError("Out of memory allocating 1 byte")


def test_a_gpu_is_used_once_it_has_computed_what_the_fft_engine_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    def check(device: Device) -> str:
        monkeypatch.setattr(cuda_engine, "cuda_device", lambda: device)
        cuda_engine.checked_gpu.cache_clear()
        return cuda_engine.checked_gpu()

    try:
        assert check(_Named()) == "a test"
        with pytest.raises(EngineUnavailableError, match="a test computes other powers than the engine fft"):
            check(_Wrong())
        with pytest.raises(EngineUnavailableError, match=r"a test fails in a short check \(CUFFT_INTERNAL_ERROR\): "):
            check(_Failing())
        with pytest.raises(EngineUnavailableError, match=r"too little free memory \(Out of memory allocating 1 byte\)"):
            check(_Full())
    finally:
        cuda_engine.checked_gpu.cache_clear()
