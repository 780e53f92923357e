from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vestige.acas_processor.monitoring.alarm import HOLD_S, AlarmState, state_changes
from vestige.records import Status

STATUSES = tuple(Status)
GRAVITY = (Status.NOT_AVAILABLE, Status.AUTHENTIC, Status.SUSPECT, Status.NOT_DETECTED, Status.SPOOFED)
LOST = None


def _block(
    epochs: list[tuple[float, Status | None]], before: AlarmState | None = None
) -> tuple[list[Status], AlarmState, list[tuple[int, Status, Status]]]:
    """Return what is shown of one satellite, the state after it, and the changes; None is a lost satellite."""
    before = before or AlarmState()
    time_s = np.array([time for time, _ in epochs], np.float64)
    status = np.array([[STATUSES.index(one or Status.NOT_AVAILABLE)] for _, one in epochs], np.int8)
    lost = np.array([[one is LOST] for _, one in epochs])
    shown, after = before.over((11,), time_s, status, np.ones(status.shape, np.bool_), lost)
    changes = [(row, old, new) for row, _, old, new in state_changes((11,), shown, before)]
    return [STATUSES[one] for one in shown[:, 0]], after, changes


def test_an_attack_that_is_seen_now_and_then_is_one_alarm() -> None:
    flicker = [(30.0 * n, Status.SPOOFED if 4 <= n <= 12 and n % 2 == 0 else Status.AUTHENTIC) for n in range(20)]
    shown, _, changes = _block(flicker)
    assert changes == [
        (0, Status.NOT_AVAILABLE, Status.AUTHENTIC),
        (4, Status.AUTHENTIC, Status.SPOOFED),
        (15, Status.SPOOFED, Status.AUTHENTIC),
    ]
    assert [n for n, status in enumerate(shown) if status is Status.SPOOFED] == list(range(4, 15))


def test_a_state_falls_step_by_step() -> None:
    """SPOOFED at 0, SUSPECT at 60: at 90 the first has had its time, at 150 the second."""
    shown, *_ = _block([(0, Status.SPOOFED), (60, Status.SUSPECT), (90, Status.AUTHENTIC), (150, Status.NOT_AVAILABLE)])
    assert shown == [Status.SPOOFED, Status.SPOOFED, Status.SUSPECT, Status.AUTHENTIC]


def test_a_status_is_kept_for_three_recs_of_the_service() -> None:
    """One RECS each 30 s: 60 s after an alarm it still stands, 90 s after it does not."""
    times = (0.0, 30.0, 60.0, 89.9, 90.0)
    shown, *_ = _block([(time, Status.AUTHENTIC if time else Status.SUSPECT) for time in times])
    assert shown == [*[Status.SUSPECT] * 4, Status.AUTHENTIC]
    assert HOLD_S == 90.0


def test_a_satellite_that_e1_lost_is_not_authentic_and_an_alarm_stands() -> None:
    shown, *_ = _block(
        [(0, Status.AUTHENTIC), (1, LOST), (2, LOST), (30, Status.SPOOFED), (119, LOST), (120, LOST), (121, LOST)]
    )
    gone = Status.NOT_AVAILABLE
    assert shown == [Status.AUTHENTIC, gone, gone, Status.SPOOFED, Status.SPOOFED, gone, gone]


def test_satellites_do_not_share_a_state_and_what_is_not_due_stays() -> None:
    statuses = [Status.SPOOFED, Status.AUTHENTIC]
    status = np.array([[STATUSES.index(one) for one in statuses], [0, 0]], np.int8)
    due = np.array([[True, True], [False, False]])
    shown, after = AlarmState().over((11, 12), np.array([0.0, 500.0]), status, due, ~due & due)
    assert [[STATUSES[one] for one in row] for row in shown] == [statuses, statuses]
    assert after.shown == {11: Status.SPOOFED, 12: Status.AUTHENTIC}


@given(
    st.lists(st.tuples(st.sampled_from([1, 30, 31, 60]), st.sampled_from([*Status, LOST])), min_size=2, max_size=30),
    st.integers(1, 29),
)
def test_blocks_are_folds(steps: list[tuple[int, Status | None]], cut: int) -> None:
    """The state written out: the gravest status of the last 90 s, AUTHENTIC only since E1 lost the satellite last."""
    times = np.cumsum([float(step) for step, _ in steps]).tolist()
    epochs = list(zip(times, (one for _, one in steps), strict=True))
    expected = []
    for n, (now, _) in enumerate(epochs):
        last_lost = max((k for k, (_, one) in enumerate(epochs[: n + 1]) if one is LOST), default=-1)
        recent = [
            one
            for k, (time, one) in enumerate(epochs[: n + 1])
            if one is not LOST and now - time < HOLD_S and (one is not Status.AUTHENTIC or k > last_lost)
        ]
        expected.append(max(recent, key=GRAVITY.index, default=Status.NOT_AVAILABLE))
    shown, after, changes = _block(epochs)
    assert shown == expected
    cut = min(cut, len(epochs) - 1)
    first, between, some = _block(epochs[:cut])
    second, last, more = _block(epochs[cut:], between)
    assert first + second == expected
    assert last == after
    assert some + [(row + cut, old, new) for row, old, new in more] == changes
