"""Which ranges are in use, and the position that rests on them: a made-up sky with exact ranges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from block_builder import START, SVIDS, DrawnSearches, Keys, MadeUpSky, cut, settings
from vestige.acas_processor.levels import POSITION
from vestige.acas_processor.monitoring.memory import FixMemory
from vestige.acas_processor.position.authentic_position import AuthenticPosition, authentic_positions
from vestige.acas_processor.position.possible_range import ApproximatePosition, KnownPositions, known_positions
from vestige.acas_processor.position.range_in_use import ranges_in_use, ranges_near
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.searches.searches import SearchResults
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import ecef_from_geodetic
from vestige.records import Status
from vestige.records.checks import CheckName

PROCESSOR = AcasProcessor(level=2, monitoring=settings())
A, S = Status.AUTHENTIC, Status.SPOOFED
M = len(SVIDS)


@pytest.fixture(scope="module")
def quiet() -> VerdictBlock:
    """One epoch with a RECS, everything authentic."""
    whole = cut(MadeUpSky(seed=1, n=2, every=1, trouble=0.0).whole, 0, 1)
    return PROCESSOR.step(None, whole, Keys()).block  # type: ignore[arg-type]


def _used(
    block: VerdictBlock,
    statuses: list[Status],
    *,
    shown: list[Status] | None = None,
    pushed_m: list[float] | None = None,
    found_m: list[float] | None = None,
    exhaustive_m: list[float] | None = None,
    clock_limit_s: float = 15.0,
    known: KnownPositions | None = None,
) -> tuple[VerdictBlock, AuthenticPosition | None]:
    """Return the block with other verdicts, pushed E1 ranges and searches, and its position."""
    measured = block.measured
    e1 = measured.snapshots.e1
    e1 = replace(e1, pseudorange_m=e1.pseudorange_m + np.array([pushed_m or [0.0] * M]))
    measured = replace(measured, snapshots=replace(measured.snapshots, e1=e1))

    def found(offsets_m: list[float] | None) -> SearchResults:
        empty = SearchResults.empty((1, M))
        return empty if offsets_m is None else replace(empty, earliest_m=np.array([offsets_m]))

    def as_array(values: list[Status]) -> np.ndarray:
        return np.array([[POSITION[one] for one in values]], np.int8)

    changed = replace(
        block,
        measured=measured,
        status=as_array(statuses),
        state=as_array(shown or statuses),
        e1_search=found(found_m),
        exhaustive_search=found(exhaustive_m),
    )
    changed = ranges_in_use(changed, PROCESSOR, np.array([clock_limit_s]))
    if known is not None:
        changed = ranges_near(changed, PROCESSOR, np.array([clock_limit_s]), known)
    return changed, next(authentic_positions(changed), None)


def _is_the_place(found: AuthenticPosition | None) -> bool:
    """Ranges have 1 m of noise."""
    assert found is not None
    apart = (found.latitude_deg - 48.1) * 111e3, (found.longitude_deg - 11.6) * 74e3, found.height_m - 500.0
    return bool(np.linalg.norm(apart) < 15.0)


def test_all_authentic_ranges_are_used_and_the_last_key_says_when(quiet: VerdictBlock) -> None:
    _, found = _used(quiet, [A] * M)
    assert _is_the_place(found)
    assert found is not None
    assert (found.svids, found.earlier) == (SVIDS, ())
    assert found.time == START
    assert found.latency_s == 50.0
    assert 0.3 < found.horizontal_sigma_m < 5.0


@pytest.mark.parametrize("status", [one for one in Status if one is not A])
@pytest.mark.parametrize("shown", [None, A], ids=["shown as it is", "shown as before"])
def test_a_range_that_is_not_authentic_is_not_used(quiet: VerdictBlock, status: Status, shown: Status | None) -> None:
    statuses = [status, *[A] * (M - 1)]
    _, found = _used(quiet, statuses, shown=[shown or status, *[A] * (M - 1)], pushed_m=[500.0] + [0.0] * (M - 1))
    assert _is_the_place(found)
    assert found is not None
    assert found.svids == SVIDS[1:]


def test_of_several_signals_the_earliest_is_used_whatever_the_verdict(quiet: VerdictBlock) -> None:
    nan = float("nan")
    pushed, found_m = [390e3] * M, [-390e3] * 5 + [nan] * (M - 5)
    block, found = _used(quiet, [S] * 5 + [Status.SUSPECT] * (M - 5), pushed_m=pushed, found_m=found_m)
    assert _is_the_place(found)
    assert found is not None
    assert found.svids == found.earlier == SVIDS[:5]
    assert np.isfinite(block.range_in_use_m[0]).tolist() == [True] * 5 + [False] * (M - 5)
    better, _ = _used(quiet, [S] * M, pushed_m=pushed, found_m=[-100.0] * M, exhaustive_m=[-390e3] + [nan] * (M - 1))
    assert better.true_offset_m[0].tolist() == [-390e3] + [-100.0] * (M - 1)
    short, _ = _used(quiet, [S] * M, pushed_m=pushed, found_m=[-390e3] * M, exhaustive_m=[-90e3, -390_010.0] * (M // 2))
    assert short.true_offset_m[0].tolist() == [-390e3, -390_010.0] * (M // 2), "earlier, or the same signal"


def test_of_two_signals_in_the_correlators_the_earlier_one_is_used(quiet: VerdictBlock) -> None:
    """The bank holds one signal where E1 says; noise is the second one, earlier or later.

    Moved by −90 m, E6 comes so much earlier than E1; by +90 m, later.
    """
    failed = dict(quiet.failed) | {CheckName.E6_SECOND_SIGNAL: np.ones((1, M), np.bool_)}
    block, _ = _used(replace(quiet, failed=failed), [S] * M)
    near = np.isfinite(block.range_in_use_m) & ~block.earlier
    assert near.any()
    assert np.abs(block.range_in_use_m - quiet.measured.snapshots.e1.pseudorange_m)[near].max() == 0.0

    def moved(by_m: float, check: CheckName) -> VerdictBlock:
        measured = quiet.measured
        banks = replace(measured.banks, offsets_m=measured.banks.offsets_m + by_m)
        detected = replace(measured.detected, range_offset_m=measured.detected.range_offset_m + by_m)
        changed = replace(
            quiet,
            failed=dict(quiet.failed) | {check: np.ones((1, M), np.bool_)},
            measured=replace(measured, banks=banks, detected=detected),
        )
        return _used(changed, [S] * M, pushed_m=[-by_m] * M)[0]

    for check in (CheckName.E6_SECOND_SIGNAL, CheckName.E1_E6_RANGE):
        late = moved(90.0, check)
        assert not np.isfinite(late.range_in_use_m).any()
    early = moved(-90.0, CheckName.E1_E6_RANGE)
    assert early.earlier.all()
    error_m = early.range_in_use_m - quiet.measured.snapshots.e1.pseudorange_m
    assert np.abs(error_m).max() < 10.0


def test_the_correlators_give_no_range_while_a_search_does_not_know_the_true_signal(quiet: VerdictBlock) -> None:
    """The correlators show E6 90 m before E1. A search finds two signals; the true one may come before both bands."""
    nan, m = float("nan"), np.ones((1, M))
    measured = quiet.measured
    changed = replace(
        quiet,
        failed=dict(quiet.failed) | {CheckName.E1_E6_RANGE: np.ones((1, M), np.bool_)},
        measured=replace(measured, detected=replace(measured.detected, range_offset_m=-90.0 * m)),
    )
    assert _used(changed, [S] * M)[0].earlier.all()
    undecided = replace(SearchResults.empty((1, M)), signals=2 * m, earliest_m=nan * m)
    for search in ("e1_search", "exhaustive_search"):
        block = ranges_in_use(
            replace(changed, status=np.full((1, M), POSITION[S], np.int8), **{search: undecided}),
            PROCESSOR,
            np.array([15.0]),
        )
        assert not np.isfinite(block.range_in_use_m).any()
    decided, _ = _used(changed, [S] * M, found_m=[-300.0] * M)
    assert decided.true_offset_m[0].tolist() == [-300.0] * M


def test_a_range_that_is_not_possible_is_not_used(quiet: VerdictBlock) -> None:
    """A false alarm of a search five seconds before E1: the clock alone would allow it, other satellites do not."""
    nan, far_m = float("nan"), -5 * SPEED_OF_LIGHT_MPS
    block, found = _used(quiet, [S] + [A] * (M - 1), found_m=[far_m] + [nan] * (M - 1))
    assert _is_the_place(found)
    assert np.isfinite(block.range_in_use_m[0]).tolist() == [False] + [True] * (M - 1)
    assert not block.earlier[0, 0]
    assert block.reason(0, 0).endswith("its range is not used: the ranges of the other satellites disagree with it")
    two, _ = _used(quiet, [S] * M, found_m=[far_m, -10.0] + [nan] * (M - 2))
    assert not np.isfinite(two.range_in_use_m).any(), "either of two may be wrong"
    alone, _ = _used(quiet, [S] * M, found_m=[far_m] + [nan] * (M - 1))
    assert np.isfinite(alone.range_in_use_m).sum() == 1
    known, _ = _used(quiet, [S] * M, found_m=[far_m] + [nan] * (M - 1), clock_limit_s=1e-3)
    assert not np.isfinite(known.range_in_use_m).any(), "the clock is not five seconds wrong"
    assert "no possible travel time and clock error" in known.reason(0, 0)


def _near(north_m: float, reach_m: float) -> KnownPositions:
    """Return a place so far north of the receiver, and its reach."""
    place = np.radians([48.1]) + north_m / 6.37e6, np.radians([11.6]), np.array([500.0])
    return KnownPositions(position_m=ecef_from_geodetic(*place), reach_m=np.array([reach_m]))


def test_a_found_signal_must_be_where_the_position_allows(quiet: VerdictBlock) -> None:
    """A false alarm 300 km before E1: travel times allow it, and it moves the fix; a place known to 10 km does not."""
    nan, far_m = float("nan"), -300e3
    one_false = [far_m] + [nan] * (M - 1)
    _, misled = _used(quiet, [S] + [A] * (M - 1), found_m=one_false)
    assert not _is_the_place(misled)
    for clock_limit_s in (15.0, 1e-6):  # by the other satellites, and by the clock
        block, found = _used(
            quiet, [S] + [A] * (M - 1), found_m=one_false, known=_near(5e3, 10e3), clock_limit_s=clock_limit_s
        )
        assert _is_the_place(found)
        assert np.flatnonzero(block.impossible[0] == 3).tolist() == [0]
        assert not np.isfinite(block.range_in_use_m[0, 0])
        assert block.reason(0, 0).endswith(
            "; its range is not used: no satellite has such a range at the known position"
        )
        assert np.isnan(block.true_offset_m).all()
        assert "range is not used" not in block.reason(0, 1)
    alone, _ = _used(quiet, [S] * M, found_m=one_false, known=_near(5e3, 10e3), clock_limit_s=1e-6)
    assert not np.isfinite(alone.range_in_use_m).any()


def test_a_signal_that_the_position_allows_stays(quiet: VerdictBlock) -> None:
    """E1 is 390 km late, the earliest signals are true: the place is right, and known to 10 km or to 400 km."""
    for known in (_near(5e3, 10e3), _near(-200e3, 400e3), _near(9e3, np.inf)):
        block, found = _used(quiet, [S] * M, pushed_m=[390e3] * M, found_m=[-390e3] * M, known=known)
        assert _is_the_place(found)
        assert block.earlier.all()
        assert not block.impossible.any()


def test_ranges_of_e1_are_the_business_of_the_checks(quiet: VerdictBlock) -> None:
    block, _ = _used(quiet, [A] * M, known=_near(900e3, 1e3), clock_limit_s=0.01)
    assert np.isfinite(block.range_in_use_m).all()
    found_m = [-100.0] + [float("nan")] * (M - 1)
    block, _ = _used(quiet, [A] * M, found_m=found_m, known=_near(900e3, 1e3), clock_limit_s=1e-3)
    assert np.flatnonzero(block.impossible[0] == 3).tolist() == [0], "the found one alone, whatever is wrong"


def test_the_last_fix_says_where_the_receiver_may_be() -> None:
    """It counts from the next epoch on, and its reach grows by 500 m/s; a place that is stated counts while nearer."""
    nan, fixed_m = float("nan"), np.full((5, 3), np.nan)
    fixed_m[[1, 3]] = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    time_s = np.array([0.0, 30.0, 60.0, 90.0, 120.0])
    known = known_positions(time_s, fixed_m, None, None)
    np.testing.assert_array_equal(known.position_m[:, 0], [nan, nan, 1.0, 1.0, 2.0])
    assert known.reach_m.tolist() == [np.inf, np.inf, 16e3, 31e3, 16e3]
    before = FixMemory(time_s=-30.0, position_m=(7.0, 0.0, 0.0))
    stated = ApproximatePosition(position_m=(9.0, 0.0, 0.0), reach_m=20e3)
    known = known_positions(time_s, fixed_m, before, stated)
    assert known.position_m[:, 0].tolist() == [7.0, 9.0, 1.0, 9.0, 2.0]
    assert known.reach_m.tolist() == [16e3, 20e3, 16e3, 20e3, 16e3]
    for at in (1, 2, 3):
        cut_before = known_positions(time_s[:at], fixed_m[:at], before, stated)
        np.testing.assert_array_equal(cut_before.reach_m, known.reach_m[:at])


@pytest.mark.parametrize("place", [((1.0, 2.0, 3.0), 0.0), ((np.nan, 2.0, 3.0), 5.0), ((1.0, 2.0, 3.0), np.inf)])
def test_a_position_needs_a_reach(place: tuple[tuple[float, float, float], float]) -> None:
    with pytest.raises(ValueError, match="a position within some metres"):
        ApproximatePosition(position_m=place[0], reach_m=place[1])


def test_a_quiet_fix_bounds_the_next_snapshots() -> None:
    """The searches of the second RECS find a signal 300 km before E1; level 1 has no searches and remembers nothing."""
    sky = MadeUpSky(seed=1, n=2, every=1, trouble=0.0).whole
    first, second = cut(sky, 0, 1), cut(sky, 1, 2)
    assert isinstance(second.searches, DrawnSearches)
    false = DrawnSearches(np.where(np.arange(M) == 0, 2.0, 1.0)[None], np.full((1, M), -300e3))
    second = replace(second, searches=false)
    start = PROCESSOR.step(None, first, Keys())  # type: ignore[arg-type]
    assert start.state.fix is not None
    after = PROCESSOR.step(start.state, second, Keys())  # type: ignore[arg-type]
    assert after.block.reason(0, 0).endswith("no satellite has such a range at the known position")
    assert after.state.fix == start.state.fix
    forgetful = replace(start.state, fix=None)
    assert PROCESSOR.step(forgetful, second, Keys()).block.earlier[0, 0]  # type: ignore[arg-type]
    both = cut(sky, 0, 2)
    both = replace(
        both,
        searches=DrawnSearches(
            *(
                np.concatenate(pair)
                for pair in (
                    (first.searches.signals, false.signals),
                    (first.searches.earliest_m, false.earliest_m),  # type: ignore[union-attr]
                )
            )
        ),
    )
    whole = PROCESSOR.step(None, both, Keys())  # type: ignore[arg-type]
    np.testing.assert_array_equal(whole.block.range_in_use_m[1:], after.block.range_in_use_m)
    assert whole.state.fix == after.state.fix
    low = AcasProcessor(level=1, monitoring=settings())
    assert low.step(None, first, Keys()).state.fix is None  # type: ignore[arg-type]


def test_three_ranges_are_no_position(quiet: VerdictBlock) -> None:
    nothing = Status.NOT_AVAILABLE
    assert _used(quiet, [A] * 3 + [nothing] * (M - 3))[1] is None
    assert _used(quiet, [A] * 4 + [nothing] * (M - 4))[1] is not None


def test_what_is_shown_as_an_alarm_is_not_used(quiet: VerdictBlock) -> None:
    assert _used(quiet, [A] * M, shown=[S] * M)[1] is None


def test_without_authenticated_data_a_range_is_in_use_and_in_no_position(quiet: VerdictBlock) -> None:
    snapshots = replace(quiet.measured.snapshots, data_authenticated=np.array([[False] + [True] * (M - 1)]))
    block, found = _used(replace(quiet, measured=replace(quiet.measured, snapshots=snapshots)), [A] * M)
    assert found is not None
    assert found.svids == SVIDS[1:]
    assert np.isfinite(block.range_in_use_m).all()


def test_without_orbits_there_is_none(quiet: VerdictBlock) -> None:
    assert _used(replace(quiet, measured=replace(quiet.measured, fixes=None)), [A] * M)[1] is None


@pytest.mark.parametrize(("uncertainty_s", "proven"), [(1.0, True), (29.9, True), (30.0, False), (45.0, False)])
@pytest.mark.parametrize("source", ["tags of a recording", "tags of a campaign", "--navigation"])
def test_tags_prove_orbits_only_if_the_clock_is_known_to_a_subframe(
    quiet: VerdictBlock, uncertainty_s: float, proven: bool, source: str
) -> None:
    """A tag is sent a subframe before its key; orbits that the user vouches for need no clock."""
    snapshots = replace(quiet.measured.snapshots, time_uncertainty_s=np.array([uncertainty_s]))
    processor = PROCESSOR
    if source == "tags of a recording":
        fix = replace(PROCESSOR.monitoring.fix, authenticated=frozenset(SVIDS))
        processor = replace(PROCESSOR, monitoring=replace(PROCESSOR.monitoring, fix=fix))
    if source == "tags of a campaign":
        snapshots = replace(snapshots, data_authenticated=np.ones((1, M), np.bool_))
    block = replace(quiet, measured=replace(quiet.measured, snapshots=snapshots))
    found = next(authentic_positions(ranges_in_use(block, processor, np.array([15.0]))))
    assert found.orbits_authenticated is (proven or source == "--navigation")
