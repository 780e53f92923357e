"""The fold over blocks: how the epochs are cut changes no bit, and nothing looks at what comes later."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from block_builder import Keys, MadeUpSky, cut, settings
from hypothesis import given, strategies
from hypothesis import settings as hypothesis_settings

from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.state import ReceiverState
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.records.snapshot_block import SnapshotBlock

N = 40


def answers(
    processor: AcasProcessor, block: SnapshotBlock, cuts: list[int]
) -> tuple[list[VerdictBlock], ReceiverState]:
    """Return what the processor says of a block that is cut before some epochs, and its last state."""
    edges = [0, *sorted(set(cuts) - {0, len(block.time)}), len(block.time)]
    blocks = [cut(block, first, last) for first, last in zip(edges[:-1], edges[1:], strict=True)]
    steps = list(processor.steps(blocks, assistance=Keys(without=(9,))))  # type: ignore[arg-type]
    return [step.verdicts for step in steps], steps[-1].state


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


@hypothesis_settings(max_examples=15, deadline=None)
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
    assert texts == [(one.svid, one.status, one.reason, str(one.checks)) for block in one_by_one for one in block.verdicts()]
    assert list(at_once[0].changes()) == [one for block in one_by_one for one in block.changes()]


def test_every_check_of_level_3_is_run_and_fails_somewhere() -> None:
    processor = AcasProcessor(level=3, monitoring=settings())
    (block,), _ = answers(processor, MadeUpSky(seed=3, n=400, trouble=0.2).whole, [])
    (quiet,), _ = answers(processor, MadeUpSky(seed=3, n=400, trouble=0.0).whole, [])
    for name, series in block.checks.items():
        assert series.run.any(), name
        assert not quiet.failed[name].mean() > 0.01, name
    assert {name for name, one in block.failed.items() if not one.any()} <= {"OSNMA availability", "clock slope"}


@pytest.mark.parametrize("level", [1, 2, 3])
def test_nothing_looks_at_what_comes_later(level: int) -> None:
    processor = AcasProcessor(level=level, monitoring=settings())
    quiet, loud = MadeUpSky(seed=5, n=N, trouble=0.05).whole, MadeUpSky(seed=6, n=N, trouble=0.9).whole
    (first,), _ = answers(processor, cut(quiet, 0, 20), [])
    states = [processor.step(None, cut(quiet, 0, 20), Keys()).state]  # type: ignore[arg-type]
    assert states[0].last == quiet.time.at(19)
    mixed = _joined_blocks(quiet, loud, 20)
    (later,), _ = answers(processor, mixed, [])
    expected = joined([first])
    for name, values in joined([later]).items():
        np.testing.assert_array_equal(values[:20], expected[name], err_msg=name)


def _joined_blocks(before: SnapshotBlock, after: SnapshotBlock, epoch: int) -> SnapshotBlock:
    """Return the epochs before one of a block, and those from there on of another."""

    def rows(one: object, other: object) -> object:
        return replace(
            one,  # type: ignore[type-var]
            **{
                name: np.concatenate([getattr(one, name)[:epoch], getattr(other, name)[epoch:]])
                for name in one.__dataclass_fields__  # type: ignore[attr-defined]
                if isinstance(getattr(one, name), np.ndarray)
            },
        )

    return replace(
        before,
        e1=rows(before.e1, after.e1),
        front_end={band: rows(one, after.front_end[band]) for band, one in before.front_end.items()},
        e6=rows(before.e6, after.e6),
        searches=rows(before.searches, after.searches),
        osnma=rows(before.osnma, after.osnma),
    )
