"""Choose the engine of a search: the named engine, or the fastest engine that this machine can run."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Int8

from vestige.sample_processor.search.engines.engine import Engine, EngineUnavailableError

_log = logging.getLogger(__name__)

EngineName = Literal["auto", "cuda", "segment", "fft"]
FASTEST_FIRST: tuple[EngineName, ...] = ("cuda", "segment", "fft")  # order in which `auto` tries the engines


@dataclass(frozen=True, slots=True)
class EngineChoice:
    """Engine that was chosen for a search, and that this machine can run.

    Attributes
    ----------
    name
        `cuda`, `segment` or `fft`.
    where
        Name of the GPU on which the engine runs, or "processor".
    passed_over
        One line for each faster engine, with the reason why `auto` did not take that engine.
    """

    name: EngineName
    where: str
    passed_over: tuple[str, ...] = ()

    def __str__(self) -> str:
        why = f"; {'; '.join(self.passed_over)}" if self.passed_over else ""
        return f"{self.name} ({self.where}){why}"


def choose_engine(name: EngineName) -> EngineChoice:
    """Return the choice for a name: the named engine, or for `auto` the fastest engine that this machine can run.

    Raises
    ------
    EngineUnavailableError
        If this machine cannot run the named engine; the message says what was found and what to do.
    """
    if name != "auto":
        return EngineChoice(name, _WHERE[name]())
    passed_over: list[str] = []
    for one in FASTEST_FIRST:
        try:
            return EngineChoice(one, _WHERE[one](), tuple(passed_over))
        except EngineUnavailableError as error:
            passed_over.append(f"no {error.engine}: {error.found}")
    raise AssertionError("fft runs everywhere")


def make_engine(name: EngineName, codes: Int8[np.ndarray, "codes chips"]) -> Engine:
    """Return the named engine for codes of ±1 with equal length; `auto` takes the fastest engine of this machine.

    Raises
    ------
    EngineUnavailableError
        If this machine cannot run the named engine, or if the GPU has too little memory for the chosen engine.
    """
    choice = choose_engine(name)
    _log.info("engine of the exhaustive search: %s", choice)
    return _MAKE[choice.name](codes)


# engines are imported when they are used, because some engines compile code and `cuda` needs a GPU


def _make_cuda(codes: np.ndarray) -> Engine:
    from vestige.sample_processor.search.engines.cuda_engine import CudaEngine  # noqa: PLC0415

    return CudaEngine(codes)


def _make_segment(codes: np.ndarray) -> Engine:
    from vestige.sample_processor.search.engines.segment.segment_engine import SegmentEngine  # noqa: PLC0415

    return SegmentEngine(codes)


def _make_fft(codes: np.ndarray) -> Engine:
    from vestige.sample_processor.search.engines.fft_engine import FftEngine  # noqa: PLC0415

    return FftEngine(codes)


def _where_cuda() -> str:
    from vestige.sample_processor.search.engines.cuda_engine import checked_gpu  # noqa: PLC0415

    return checked_gpu()


def _where_segment() -> str:
    from numba import config  # noqa: PLC0415

    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        raise EngineUnavailableError("segment", "numba does not compile", "unset NUMBA_DISABLE_JIT")
    if sys.byteorder != "little":
        raise EngineUnavailableError("segment", "the processor is big-endian", "take fft")
    return "processor"


_MAKE: dict[str, Callable[[np.ndarray], Engine]] = {"cuda": _make_cuda, "segment": _make_segment, "fft": _make_fft}
_WHERE: dict[str, Callable[[], str]] = {"cuda": _where_cuda, "segment": _where_segment, "fft": lambda: "processor"}
