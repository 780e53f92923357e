"""The fold over blocks: how the epochs are cut changes no bit, and nothing looks at what comes later."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import Phase, given, strategies
from hypothesis import settings as hypothesis_settings

from block_builder import DrawnE6, DrawnSearches, Keys, MadeUpSky, cut, settings, spliced
from vestige.acas_processor.assess import TRAVEL_TIME_SPREAD_S
from vestige.acas_processor.monitoring.baseline import ReferenceLevels
from vestige.acas_processor.monitoring.state import ReceiverState
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.records import Status
from vestige.records.checks import CheckName
from vestige.records.snapshot_block import SearchBlock, SearchRequest, SnapshotBlock
from vestige.records.time_uncertainty import FIXED_S
from vestige.records.times import GalileoTimes

N = 24


def answers(
    processor: AcasProcessor, block: SnapshotBlock, cuts: list[int]
) -> tuple[list[VerdictBlock], ReceiverState]:
    """Return what the processor says of a block that is cut before some epochs, and its last state."""
    edges = [0, *sorted(set(cuts) - {0, len(block.time)}), len(block.time)]
    blocks = [cut(block, first, last) for first, last in pairwise(edges)]
    steps = list(processor.steps(blocks, assistance=Keys(without=(9,))))  # type: ignore[arg-type]
    return [step.block for step in steps], steps[-1].state


def joined(blocks: list[VerdictBlock]) -> dict[str, np.ndarray]:
    """Return every array of the answers, one after another."""
    names = ("status", "cause", "state", "due", "searched", "true_offset_m", "range_in_use_m", "earlier")
    found = {name: np.concatenate([getattr(one, name) for one in blocks]) for name in names}
    for name in blocks[0].checks:
        found[f"{name} statistic"] = np.concatenate([one.checks[name].statistic for one in blocks])
        found[f"{name} threshold"] = np.concatenate([one.checks[name].threshold for one in blocks])
        found[f"{name} failed"] = np.concatenate([one.failed[name] for one in blocks])
    positions = [one.position for one in blocks]
    found["position_m"] = np.concatenate([one.position_m for one in positions if one is not None])
    return found


@pytest.mark.slow
@hypothesis_settings(max_examples=6, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    seed=strategies.integers(0, 2**31),
    level=strategies.sampled_from([1, 2, 3]),
    trouble=strategies.sampled_from([0.0, 0.02, 0.2]),
    cuts=strategies.lists(strategies.integers(1, N - 1), max_size=6),
)
def test_the_cut_changes_no_bit(seed: int, level: int, trouble: float, cuts: list[int]) -> None:
    processor = AcasProcessor(level=level, monitoring=settings())
    whole = MadeUpSky(seed=seed, n=N, trouble=trouble).whole
    (at_once, last), (in_pieces, same_last) = answers(processor, whole, []), answers(processor, whole, cuts)
    one_by_one, also_last = answers(processor, whole, list(range(N)))
    expected = joined(at_once)
    for pieces in (in_pieces, one_by_one):
        for name, values in joined(pieces).items():
            np.testing.assert_array_equal(values, expected[name], err_msg=name)
    assert last == same_last == also_last
    verdicts = [list(block.verdicts()) for block in (at_once, one_by_one) for block in block]
    total = len(list(at_once[0].verdicts()))
    assert sum(map(len, verdicts)) == 2 * total
    texts = [(one.svid, one.status, one.reason, str(one.checks)) for one in at_once[0].verdicts()]
    assert texts == [
        (one.svid, one.status, one.reason, str(one.checks)) for block in one_by_one for one in block.verdicts()
    ]
    assert list(at_once[0].changes()) == [one for block in one_by_one for one in block.changes()]


def test_every_check_of_level_3_is_run_and_fails_somewhere() -> None:
    processor = AcasProcessor(level=3, monitoring=settings())
    still, loud = (MadeUpSky(seed=3, n=400, trouble=trouble).whole for trouble in (0.0, 0.2))
    learned_first = spliced(still, loud, 60)  # 20 RECS to learn reference levels from
    (block,), _ = answers(processor, learned_first, [])
    (quiet,), _ = answers(processor, still, [])
    for name, series in block.checks.items():
        assert series.run.any(), name
        assert not quiet.failed[name].mean() > 0.01, name
    assert {name for name, one in block.failed.items() if not one.any()} <= {
        "OSNMA availability",
        "clock slope",
        "clock limit",
    }


@pytest.mark.parametrize("level", [1, 2, 3])
def test_nothing_looks_at_what_comes_later(level: int) -> None:
    processor = AcasProcessor(level=level, monitoring=settings())
    quiet, loud = MadeUpSky(seed=5, n=N, trouble=0.05).whole, MadeUpSky(seed=6, n=N, trouble=0.9).whole
    (first,), _ = answers(processor, cut(quiet, 0, 12), [])
    states = [processor.step(None, cut(quiet, 0, 12), Keys()).state]  # type: ignore[arg-type]
    assert states[0].last == quiet.time.at(11)
    mixed = spliced(quiet, loud, 12)
    (later,), _ = answers(processor, mixed, [])
    expected = joined([first])
    for name, values in joined([later]).items():
        np.testing.assert_array_equal(values[:12], expected[name], err_msg=name)


def _of_statuses(rows: list[tuple[bool, int]]) -> tuple[AcasProcessor, SnapshotBlock]:
    """Epochs with a RECS each: whether E6 of the first satellite is in the wrong place, and how many are tracked."""
    processor = AcasProcessor(level=2, monitoring=replace(settings(), levels=ReferenceLevels(e1_power_db=0.0)))
    whole = MadeUpSky(seed=8, n=len(rows), every=1, trouble=0.0).whole
    hidden = np.array([[column >= tracked for column in range(len(whole.svids))] for _, tracked in rows])
    e1 = replace(whole.e1, pseudorange_m=np.where(hidden, np.nan, whole.e1.pseudorange_m))
    assert isinstance(whole.e6, DrawnE6)
    taps = whole.e6.taps.copy()
    wrong = [row for row, (spoofed, _) in enumerate(rows) if spoofed]
    taps[wrong, 0] = np.roll(taps[wrong, 0], 4, axis=-1)
    return processor, replace(whole, e1=e1, e6=DrawnE6(taps, whole.e6.noise_power))


@pytest.mark.parametrize(
    ("rows", "fixed_s"),
    [
        ([(False, 8)], FIXED_S),
        ([(False, 3)], TRAVEL_TIME_SPREAD_S),
        ([(False, 0)], None),
        ([(True, 8)], None),
    ],
)
def test_the_time_uncertainty_shrinks_when_all_is_quiet(rows: list[tuple[bool, int]], fixed_s: float | None) -> None:
    processor, block = _of_statuses(rows)
    block = replace(block, time_uncertainty_s=np.full(len(rows), 15.0))
    state = processor.step(None, block, Keys()).state  # type: ignore[arg-type]
    assert state.uncertainty.at(state.last) == pytest.approx(fixed_s or 15.0)
    later_s = state.uncertainty.at(state.last + 1000.0)
    assert later_s == pytest.approx(15.0 if fixed_s is None else fixed_s + 1000.0 * 2e-6)


def test_alarms_come_once_and_a_lost_satellite_is_due_for_an_hour() -> None:
    processor, block = _of_statuses([(n in (3, 4, 5), 8 if n < 8 else 5) for n in range(10)])
    step = processor.step(None, block, Keys())  # type: ignore[arg-type]
    assert [(one.svid, one.after) for one in step.changes if one.alarm] == [(block.svids[0], Status.SPOOFED)]
    assert step.block.due[9].all()
    gone = {one.svid: one.reason for one in step.verdicts if one.index == 9 and one.status is Status.NOT_AVAILABLE}
    assert gone == dict.fromkeys(block.svids[5:], "not seen on E1")
    late = replace(cut(block, 9, 10), time=GalileoTimes.of([step.state.last + 3600.0]))
    after = processor.step(step.state, late, Keys()).block  # type: ignore[arg-type]
    assert after.due[0].tolist() == [True] * 5 + [False] * 3


def test_the_exhaustive_search_is_made_at_the_start_on_suspicion_now_and_then_and_until_one_finds_a_signal_alone() -> (
    None
):
    n = 24
    processor, block = _of_statuses([(row in (4, 5, 9), 8) for row in range(n)])
    processor = replace(processor, level=3, monitoring=replace(processor.monitoring, exhaustive_period_s=8.0))
    assert isinstance(block.searches, DrawnSearches)
    signals = np.ones(block.searches.signals.shape)
    signals[18:20] = 2.0  # found with the search of epoch 18, which is due, and of 19
    quiet_e1 = _ExhaustiveOnly(signals, block.searches.earliest_m)
    found = processor.step(None, replace(block, searches=quiet_e1), Keys()).block  # type: ignore[arg-type]
    # 17 is 8 s after 9; the signal of 18 is met at the next search, with the RECS that is due, 25, or on suspicion
    assert np.flatnonzero(found.searched).tolist() == [0, 4, 5, 9, 17]
    signals[17] = 2.0
    found = processor.step(None, replace(block, searches=quiet_e1), Keys()).block  # type: ignore[arg-type]
    assert np.flatnonzero(found.searched).tolist() == [0, 4, 5, 9, 17, 18, 19, 20]
    twice = found.failed[CheckName.E6_EXHAUSTIVE_SEARCH].any(axis=1)
    assert np.flatnonzero(twice).tolist() == [17, 18, 19]


class _ExhaustiveOnly(DrawnSearches):
    """E1 has one signal of each satellite, whatever the exhaustive search finds."""

    def e1(self, request: SearchRequest) -> SearchBlock:
        found = self.exhaustive(request)
        return replace(found, signals=np.ones_like(found.signals), earliest_m=np.full_like(found.signals, np.nan))
