"""Laws that hold for every check of level 3 and every optional one, and for that of a user beside them."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pydantic import TypeAdapter

from block_builder import QUIET, Keys, cut, every_trouble, settings, settings_of_every_check
from extend_page import page_part, page_scenario
from vestige.acas_processor.monitoring.state import ReceiverState
from vestige.acas_processor.own_check import OwnCheck
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import level_verdicts
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.records.checks import CheckName
from vestige.records.verdict import Outcome

N, SEED = 150, 9
STATE = TypeAdapter(ReceiverState)
OWN, OWN_WITH_MEMORY = "early power", "early power of 10 RECS"
NAMES = [*(name.value for name in CheckName), OWN, OWN_WITH_MEMORY]


@pytest.fixture(scope="module")
def processor() -> AcasProcessor:
    check = OwnCheck.of(page_part("my_check:EarlyPower")())
    twice = replace(check, spec=replace(check.spec, confirm=2))
    with_memory = OwnCheck.of(page_part("my_memory_check:EarlyPowerOfTen")())
    return AcasProcessor(level=3, monitoring=settings_of_every_check(), own_checks=(twice, with_memory))


def verdicts(processor: AcasProcessor, edges: list[int]) -> list[VerdictBlock]:
    whole = every_trouble(SEED)
    assert len(whole.time) == N
    blocks = [cut(whole, first, last) for first, last in pairwise(edges)]
    return [step.block for step in processor.steps(blocks, assistance=Keys())]  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def whole(processor: AcasProcessor) -> VerdictBlock:
    (block,) = verdicts(processor, [0, N])
    return block


@pytest.fixture(scope="module", params=["epoch by epoch", "in pieces", "state on disk"])
def pieces(request: pytest.FixtureRequest, processor: AcasProcessor) -> list[VerdictBlock]:
    if request.param == "epoch by epoch":
        return verdicts(processor, list(range(N + 1)))
    if request.param == "in pieces":
        return verdicts(processor, [0, 1, 7, QUIET + 1, 70, 71, N])
    whole, state, found = every_trouble(SEED), None, []
    for first, last in pairwise([0, 9, QUIET, 66, 98, N]):
        step = processor.step(state, cut(whole, first, last), Keys())  # type: ignore[arg-type]
        written = json.dumps(STATE.dump_python(step.state, mode="json"))
        state = STATE.validate_python(json.loads(written))
        assert state == step.state
        found.append(step.block)
    assert state is not None
    assert {CheckName.CLOCK_SLOPE, CheckName.E6_PHASE, CheckName.E6_FADING, OWN_WITH_MEMORY} <= state.memory.keys()
    return found


@pytest.mark.parametrize("name", NAMES)
def test_each_check_is_run_and_passes_and_fails(name: str, whole: VerdictBlock) -> None:
    """Without this, the laws below would compare nothing with nothing."""
    series, confirmed = whole.checks[name], whole.failed[name]  # type: ignore[index]
    assert np.any(series.run & ~series.failed)
    assert series.failed.any()
    assert confirmed.any()
    assert not confirmed[:QUIET].any()


@pytest.mark.parametrize("name", NAMES)
def test_the_cut_changes_no_bit(name: str, whole: VerdictBlock, pieces: list[VerdictBlock]) -> None:
    for values in ("statistic", "threshold"):
        joined = np.concatenate([getattr(one.checks[name], values) for one in pieces])  # type: ignore[index]
        assert joined.tobytes() == getattr(whole.checks[name], values).tobytes()  # type: ignore[index]
    joined = np.concatenate([one.failed[name] for one in pieces])  # type: ignore[index]
    assert joined.tobytes() == whole.failed[name].tobytes()  # type: ignore[index]


def test_the_cut_changes_no_verdict(whole: VerdictBlock, pieces: list[VerdictBlock]) -> None:
    for values in ("status", "cause", "state", "range_in_use_m"):
        joined = np.concatenate([getattr(one, values) for one in pieces])
        assert joined.tobytes() == getattr(whole, values).tobytes()
    reasons = [one.reason(epoch, 1) for one in pieces for epoch in range(len(one.status))]
    assert reasons == [whole.reason(epoch, 1) for epoch in range(N)]


@pytest.mark.parametrize("name", NAMES)
def test_a_reason_is_written_where_it_failed_or_was_not_run(name: str, whole: VerdictBlock) -> None:
    series = whole.checks[name]  # type: ignore[index]
    for outcome, where in (
        (Outcome.PASS, series.run & ~series.failed),
        (Outcome.FAIL, series.failed),
        (Outcome.NOT_RUN, ~series.run),
    ):
        for epoch, *satellite in np.argwhere(where)[:: max(1, np.count_nonzero(where) // 10)].tolist():
            result = series.result(epoch, *(satellite or [0]))
            assert (result.name, result.outcome) == (name, outcome)
            assert bool(result.reason) == (outcome is not Outcome.PASS)


def test_the_checks_of_a_user_are_the_last_rows(whole: VerdictBlock) -> None:
    assert [spec.name for spec in whole.specs[-2:]] == [OWN, OWN_WITH_MEMORY]


def test_the_check_of_a_user_can_be_the_cause(processor: AcasProcessor) -> None:
    own = processor.own_checks[0]
    once = replace(own, spec=replace(own.spec, confirm=1))
    alone = replace(processor, level=1, monitoring=settings(), own_checks=(once,))
    (block,) = verdicts(alone, [0, N])
    assert "times the power of noise before the signal" in " ".join(
        block.reason(*here) for here in np.argwhere(block.cause == 2).tolist()
    )


@pytest.mark.parametrize("module", ["my_check", "my_memory_check", "my_detector", "my_error", "my_attack"])
def test_stored_results_are_judged_again_alike(module: str) -> None:
    plan = ScenarioPlan(scenario=page_scenario(module, "epochs=30", "processor.level=2"))
    results = direct_results(plan)
    (found,) = level_verdicts(results, (2,))
    np.testing.assert_array_equal(results["status"].values, found.status)
    np.testing.assert_array_equal(results["cause"].values, found.cause)
    assert pickle.loads(pickle.dumps(plan)).attrs == plan.attrs  # noqa: S301
