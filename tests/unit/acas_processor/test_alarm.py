from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from builders import START
from vestige.acas_processor.alarm import AlarmState, StateChange, state_block
from vestige.records import Status


def _fold(epochs: list[tuple[float, Status]], hold_s: float = 90.0) -> tuple[list[Status], list[StateChange]]:
    state, shown, changes = AlarmState(hold_s=hold_s), [], []
    for time_s, status in epochs:
        state, change = state.step(11, START + time_s, status, f"at {time_s:g}")
        shown.append(state.shown[11])
        changes += [change] if change else []
    return shown, changes


def test_an_attack_that_is_seen_now_and_then_is_one_alarm() -> None:
    flicker = [(30.0 * n, Status.SPOOFED if 4 <= n <= 12 and n % 2 == 0 else Status.AUTHENTIC) for n in range(20)]
    shown, changes = _fold(flicker)
    assert [(one.before, one.after) for one in changes] == [
        (Status.NOT_AVAILABLE, Status.AUTHENTIC),
        (Status.AUTHENTIC, Status.SPOOFED),
        (Status.SPOOFED, Status.AUTHENTIC),
    ]
    assert [one.alarm for one in changes] == [False, True, False]
    assert [one.reason for one in changes] == ["at 0", "at 120", "at 450"]
    assert [n for n, status in enumerate(shown) if status is Status.SPOOFED] == list(range(4, 15))


def test_a_state_falls_step_by_step() -> None:
    """SPOOFED at 0, SUSPECT at 60: at 90 the first has had its time, at 150 the second."""
    shown, _ = _fold([(0, Status.SPOOFED), (60, Status.SUSPECT), (90, Status.AUTHENTIC), (150, Status.NOT_AVAILABLE)])
    assert shown == [Status.SPOOFED, Status.SPOOFED, Status.SUSPECT, Status.AUTHENTIC]


def test_a_status_is_held_for_three_recs_of_the_service() -> None:
    """One RECS each 30 s: 60 s after an alarm it still stands, 90 s after it does not."""
    state, _ = AlarmState().step(11, START, Status.SUSPECT, "")
    for time_s, shown in (
        (30.0, Status.SUSPECT),
        (60.0, Status.SUSPECT),
        (89.9, Status.SUSPECT),
        (90.0, Status.AUTHENTIC),
    ):
        state, _ = state.step(11, START + time_s, Status.AUTHENTIC, "")
        assert state.shown[11] is shown
    status = np.array([[list(Status).index(one)] for one in (Status.SUSPECT, *[Status.AUTHENTIC] * 3)], np.int8)
    block = state_block(status, np.array([0.0, 60.0, 89.9, 90.0]))[:, 0]
    assert [list(Status)[one] for one in block] == [*[Status.SUSPECT] * 3, Status.AUTHENTIC]


def test_a_satellite_that_e1_lost_is_not_authentic_and_an_alarm_stands() -> None:
    state, _ = AlarmState().step(11, START, Status.AUTHENTIC, "")
    state, change = state.lost(11, START + 1.0, "gone")
    assert change == StateChange(
        time=START + 1.0, svid=11, before=Status.AUTHENTIC, after=Status.NOT_AVAILABLE, reason="gone"
    )
    state, change = state.lost(11, START + 2.0, "gone")
    assert change is None
    state, _ = state.step(11, START + 30.0, Status.SPOOFED, "")
    state, change = state.lost(11, START + 119.0, "gone")
    assert (state.shown[11], change) == (Status.SPOOFED, None)
    state, change = state.lost(11, START + 120.0, "gone")
    assert state.shown[11] is Status.NOT_AVAILABLE


def test_satellites_do_not_share_a_state() -> None:
    state, _ = AlarmState().step(11, START, Status.SPOOFED, "")
    state, change = state.step(12, START, Status.AUTHENTIC, "")
    assert state.shown == {11: Status.SPOOFED, 12: Status.AUTHENTIC}
    assert change is not None
    assert not change.alarm


@given(
    st.lists(st.tuples(st.sampled_from([1, 30, 31, 60]), st.sampled_from(list(Status))), min_size=1, max_size=30),
    st.sampled_from([1.0, 30.0, 90.0]),
)
def test_blocks_are_folds(steps: list[tuple[int, Status]], hold_s: float) -> None:
    time_s = np.cumsum([float(step) for step, _ in steps])
    status = np.array([[list(Status).index(one)] for _, one in steps], np.int8)
    block = state_block(status, time_s, hold_s)[:, 0]
    shown, _ = _fold(list(zip(time_s.tolist(), (one for _, one in steps), strict=True)), hold_s)
    assert [list(Status)[one] for one in block] == shown
