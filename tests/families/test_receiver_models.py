"""Laws of every error model of the receiver: what holds for one must hold for all."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from extend_page import page_part
from vestige.receiver import errors
from vestige.receiver.errors.bias import BiasResiduals
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.empirical_ionosphere import EmpiricalIonosphere
from vestige.receiver.errors.error_process import Streams, named_streams
from vestige.receiver.errors.ionosphere import HeavyTailedIonosphere
from vestige.receiver.errors.multipath import LmsLiteMultipath
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Case:
    """A model as every law sees it: a process, and what `advance` returns as named columns.

    `white` makes a column of (nearly) independent values of it; None where there is only one draw.
    """

    model: Any
    zero: Any
    names: tuple[str, ...]
    start: Callable[[Any, Streams], Any] = lambda model, streams: model.process(streams)
    start_zero: Callable[[Any, Streams], Any] = lambda model, streams: model.process(streams)
    white: Callable[[Columns], np.ndarray] | None = None
    errors: tuple[str, ...] | None = None

    def process(self, streams: Streams, *, zero: bool = False) -> Callable[[np.ndarray], Columns]:
        process = self.start_zero(self.zero, streams) if zero else self.start(self.model, streams)

        def advance(times_s: np.ndarray) -> Columns:
            found = process.advance(times_s)
            if isinstance(found, tuple):
                return dict(zip(self.names, found, strict=True))
            if isinstance(found, np.ndarray):
                return dict(zip(self.names, [found], strict=True))
            return {name: getattr(found, name) for name in self.names}

        return advance


RAYS = ("delay_m", "amplitude", "amplitude_e1", "doppler_hz")
GUSTS = page_part("my_error:Gusts")  # of a user: docs/extend.md
SAMPLES_M = np.random.default_rng(1).laplace(size=50)
CORE = {"core_sigma_m": 1.24, "tail_start_m": 2.65, "tail_scale_m": 1.17}
NO_TAIL = {"core_sigma_m": 0.0, "tail_start_m": 2.65, "tail_scale_m": 1.17, "tail_probability": 0.0}


def one_run(model: Any, streams: Streams) -> Any:
    return model.process(streams, receiver=named_streams(1))


def tracked(cn0_dbhz: float) -> Callable[[Any, Streams], Any]:
    return lambda model, streams: model.process(streams, cn0_dbhz=cn0_dbhz)


def ionosphere(model: Any, zero: Any) -> Case:
    return Case(model, zero, ("iono_m",), white=lambda columns: columns["iono_m"])


def multipath(model: LmsLiteMultipath) -> Case:
    zero = LmsLiteMultipath(power_db=-inf, mean_excess_m=40.0, n_rays=model.n_rays, mean_rays=model.mean_rays)
    return Case(
        model, zero, RAYS, white=lambda columns: columns["amplitude"][:, 0].real, errors=("amplitude", "amplitude_e1")
    )


CASES = {
    "clock": Case(
        TwoStateClock(),
        TwoStateClock(h0_s=0.0, h_minus_2_hz=0.0),
        ("clock_m", "drift_mps"),
        white=lambda columns: np.diff(columns["drift_mps"]),
    ),
    "ionosphere": ionosphere(HeavyTailedIonosphere.solar_maximum_2014(), HeavyTailedIonosphere(**NO_TAIL)),
    "truncated ionosphere": ionosphere(
        HeavyTailedIonosphere(truncated=True, **CORE), HeavyTailedIonosphere(truncated=True, **NO_TAIL)
    ),
    "slow ionosphere": ionosphere(
        HeavyTailedIonosphere(correlation="gauss-markov", tau_s=0.2, **CORE),
        HeavyTailedIonosphere(correlation="gauss-markov", **NO_TAIL),
    ),
    "empirical ionosphere": ionosphere(
        EmpiricalIonosphere(samples_m=SAMPLES_M), EmpiricalIonosphere(samples_m=np.zeros(7))
    ),
    "multipath": multipath(LmsLiteMultipath.elevation_5_30()),
    "lasting multipath": multipath(
        LmsLiteMultipath(power_db=-15.8, mean_excess_m=40.0, n_rays=3, speed_mps=20.0, slope_db_per_us=15.0)
    ),
    "counted multipath": multipath(
        LmsLiteMultipath(power_db=-15.8, mean_excess_m=40.0, n_rays=9, mean_rays=2.5, mean_life_s=0.1)
    ),
    "tracking noise": Case(
        BetzTrackingNoise(),
        BetzTrackingNoise(),
        ("code_m", "carrier_m", "doppler_hz"),
        start=tracked(35.0),
        start_zero=tracked(inf),
        white=lambda columns: columns["code_m"],
    ),
    "bias": Case(
        BiasResiduals(bgd_sigma_m=0.2, hardware_sigma_m=0.3, hardware_drift_mps=1e-4),
        BiasResiduals(),
        ("bias_m",),
        start=one_run,
        start_zero=one_run,
    ),
    "my_error:Gusts": ionosphere(GUSTS(quiet_m=1.0, disturbed_m=6.0), GUSTS(quiet_m=0.0, disturbed_m=0.0)),
}


def cases(*without: str) -> Any:
    chosen = {name: case for name, case in CASES.items() if name not in without}
    return pytest.mark.parametrize("case", chosen.values(), ids=chosen.keys())


every_case = cases()

STEPS_S = st.lists(st.one_of(st.just(0.0), st.floats(1e-3, 50.0)), min_size=1, max_size=60)


def bits(columns: Columns) -> dict[str, bytes]:
    return {name: column.tobytes() for name, column in columns.items()}


def test_every_model_has_a_case() -> None:
    files = Path(errors.__file__).parent.glob("*.py")
    modules = [importlib.import_module(f"{errors.__name__}.{file.stem}") for file in files]
    classes = {one for module in modules for one in vars(module).values() if inspect.isclass(one)}
    models = {one for one in classes if hasattr(one, "process") and not getattr(one, "_is_protocol", False)}
    assert {type(case.model) for case in CASES.values()} == {*models, GUSTS}


@every_case
@settings(max_examples=25)
@given(steps_s=STEPS_S, cuts=st.lists(st.integers(0, 60), max_size=4), svid=st.integers(1, 36))
def test_pieces_are_the_whole(case: Case, steps_s: list[float], cuts: list[int], svid: int) -> None:
    times_s = np.cumsum(steps_s)
    whole = case.process(named_streams(7, svid))(times_s)
    advance = case.process(named_streams(7, svid))
    pieces = [advance(piece) for piece in np.split(times_s, sorted(min(cut, times_s.size) for cut in cuts))]
    joined = {name: np.concatenate([piece[name] for piece in pieces]) for name in case.names}
    assert bits(joined) == bits(whole)


@every_case
def test_long_pieces_are_the_whole(case: Case) -> None:
    """Vector instructions work on whole registers, so the ends of long arrays are a case of their own."""
    times_s = np.arange(5000) * 0.1
    whole = case.process(named_streams(7, 3))(times_s)
    advance = case.process(named_streams(7, 3))
    pieces = [advance(piece) for piece in np.split(times_s, [1, 2, 1000, 1003, 4999])]
    assert bits({name: np.concatenate([piece[name] for piece in pieces]) for name in case.names}) == bits(whole)


@every_case
def test_shapes(case: Case) -> None:
    columns = case.process(named_streams(7, 3))(np.arange(5.0))
    rays = (case.model.n_rays,) if isinstance(case.model, LmsLiteMultipath) else ()
    assert {column.shape for column in columns.values()} == {(5, *rays)}
    assert all(np.all(np.isfinite(column)) for column in columns.values())


@every_case
def test_without_variance_there_is_no_error(case: Case) -> None:
    columns = case.process(named_streams(7, 3), zero=True)(np.arange(500.0))
    signal = np.random.default_rng(2).standard_normal(500)
    for name in case.errors or case.names:
        for column in columns[name].reshape(500, -1).T:
            assert (signal + column).tobytes() == (signal.astype(column.dtype) + 0).tobytes()


@every_case
def test_the_seed_and_the_satellite_decide(case: Case) -> None:
    times_s = np.arange(50.0)
    here, again, other_seed, other_satellite = (
        case.process(named_streams(*labels))(times_s) for labels in ((7, 3), (7, 3), (8, 3), (7, 4))
    )
    assert bits(here) == bits(again)
    for other in (other_seed, other_satellite):
        for name in case.names:
            same = (here[name] == other[name]) & (here[name] != 0)
            assert not np.any(same)


@cases("bias")  # drawn once a run: see its unit test
def test_satellites_are_independent(case: Case) -> None:
    assert case.white is not None
    times_s = np.arange(20_000.0)
    one, two = (case.white(case.process(named_streams(7, svid))(times_s)) for svid in (3, 4))
    # 5 standard deviations, an error of 6e-7; what memory is left after a second (2 %) widens them by less than 1 %.
    assert abs(np.corrcoef(one, two)[0, 1]) < 5 / np.sqrt(one.size)


@every_case
def test_each_variable_has_a_stream_of_its_own(case: Case) -> None:
    asked: list[str] = []

    def streams(name: str) -> np.random.Generator:
        asked.append(name)
        return named_streams(7, 3)(name)

    case.process(streams)(np.arange(5.0))
    assert asked
    assert len(set(asked)) == len(asked)


@cases("bias")  # a function of time, without memory
def test_time_does_not_run_backwards(case: Case) -> None:
    advance = case.process(named_streams(7, 3))
    advance(np.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="forward"):
        advance(np.array([1.5]))
    with pytest.raises(ValueError, match="forward"):
        case.process(named_streams(7, 3))(np.array([1.0, np.nan]))
