from __future__ import annotations

import pickle

import numpy as np
import pytest

from vestige.sample_processor.search.engines import choice
from vestige.sample_processor.search.engines.choice import choose_engine, make_engine
from vestige.sample_processor.search.engines.engine import Engine, EngineUnavailableError
from vestige.sample_processor.search.engines.fft_engine import FftEngine

CODES = np.ones((1, 5115), np.int8)


def _missing() -> str:
    raise EngineUnavailableError("cuda", "no GPU", "buy one")


def test_auto_takes_the_fastest_that_runs_and_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "FASTEST_FIRST", ("cuda", "segment", "fft"))
    monkeypatch.setitem(choice._WHERE, "cuda", lambda: "a GPU")
    assert str(choose_engine("auto")) == "cuda (a GPU)"
    monkeypatch.setitem(choice._WHERE, "cuda", _missing)
    assert str(choose_engine("auto")) == "segment (processor); no cuda: no GPU"
    monkeypatch.setattr("numba.config.DISABLE_JIT", True)
    assert str(choose_engine("auto")) == "fft (processor); no cuda: no GPU; no segment: numba does not compile"
    assert isinstance(make_engine("auto", CODES), FftEngine)
    with pytest.raises(EngineUnavailableError, match="engine segment: numba does not compile: unset NUMBA_DISABLE_JIT"):
        choose_engine("segment")


def test_an_engine_that_is_named_is_taken_or_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    assert str(choose_engine("fft")) == "fft (processor)"
    for name in ("segment", "fft"):
        engine = make_engine(name, CODES)  # type: ignore[arg-type]
        assert isinstance(engine, Engine)
        assert engine.uses_cores
    monkeypatch.setitem(choice._WHERE, "cuda", _missing)
    with pytest.raises(EngineUnavailableError, match="engine cuda: no GPU: buy one, or take --engine auto") as error:
        make_engine("cuda", CODES)
    again = pickle.loads(pickle.dumps(error.value))  # noqa: S301
    assert (str(again), again.engine) == (str(error.value), "cuda")
