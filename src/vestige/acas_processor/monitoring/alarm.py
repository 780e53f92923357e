"""Keep the state of each satellite, so that a receiver raises a single alarm for a single attack.

The verdict of a satellite may change at each RECS, and also between two RECS. The state of a satellite is therefore the
gravest status of the last `HOLD_S` seconds. A graver status raises the state at once. A state of alarm falls only after
`HOLD_S` seconds without a status as grave as the state. So an attack that is detected at least once in every `HOLD_S`
seconds raises a single alarm. AUTHENTIC is a statement about a range, and a satellite whose signal on E1 is lost has no
range. So the loss of the signal on E1 ends the state AUTHENTIC at once, but does not end a state of alarm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.levels import ALARMS, GRAVITY, POSITION
from vestige.records import Status
from vestige.time import GalileoTime

HOLD_S = 90.0  # time of 3 RECS of the service, which sends a RECS every 30 s
_NOT_AVAILABLE = POSITION[Status.NOT_AVAILABLE]


@dataclass(frozen=True, slots=True, kw_only=True)
class StateChange:
    """Change of the state of a satellite."""

    time: GalileoTime  # time of the snapshot that changed the state
    svid: int
    before: Status
    after: Status
    reason: str  # reason of the verdict that changed the state; "" if the state fell after `HOLD_S`

    @property
    def alarm(self) -> bool:
        """Whether the new state is a state of alarm."""
        return self.after in ALARMS


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmState:
    """State of all satellites after a block of epochs."""

    # last time of each status of each satellite, in s after the first epoch that the receiver ever processed
    seen: Mapping[int, Mapping[Status, float]] = field(default_factory=dict)
    shown: Mapping[int, Status] = field(default_factory=dict)  # state of each satellite

    def over(
        self,
        svids: tuple[int, ...],
        time_s: Float[np.ndarray, " n"],
        status: Int8[np.ndarray, "n m"],
        due: Bool[np.ndarray, "n m"],
        lost: Bool[np.ndarray, "n m"],
    ) -> tuple[Int8[np.ndarray, "n m"], AlarmState]:
        """Return the state of each satellite at each epoch (position in `Status`), and the state after the block.

        `time_s` ascends and counts from the first epoch that the receiver ever processed. The state of a satellite
        stays unchanged where `due` is False. `lost` is True where the signal of a satellite on E1 is lost.
        """
        n = time_s.size
        shown = np.array([POSITION[self.shown.get(svid, Status.NOT_AVAILABLE)] for svid in svids], np.int8)
        state = np.full(status.shape, _NOT_AVAILABLE, np.int8)
        last: dict[Status, Float[np.ndarray, "n m"]] = {}
        lost_s = _last_time(lost, time_s, np.full(len(svids), -np.inf))
        for one in GRAVITY[1:]:
            before_s = np.array([self.seen.get(svid, {}).get(one, -np.inf) for svid in svids])
            seen_s = _last_time((status == POSITION[one]) & due, time_s, before_s)
            if one is Status.AUTHENTIC:
                seen_s = np.where(lost_s >= seen_s, -np.inf, seen_s)
            last[one] = seen_s
            state[time_s[:, None] - seen_s < HOLD_S] = POSITION[one]
        rows = np.where(due, np.arange(n)[:, None], -1)
        latest = np.maximum.accumulate(rows, axis=0)
        state = np.where(latest < 0, shown, np.take_along_axis(state, np.maximum(latest, 0), axis=0)).astype(np.int8)
        return state, self._after(svids, state, last)

    def _after(
        self, svids: tuple[int, ...], state: Int8[np.ndarray, "n m"], last: Mapping[Status, Float[np.ndarray, "n m"]]
    ) -> AlarmState:
        statuses = tuple(POSITION)
        seen, shown = dict(self.seen), dict(self.shown)
        for column, svid in enumerate(svids):
            known = {one: float(times[-1, column]) for one, times in last.items()}
            seen[svid] = {one: time_s for one, time_s in known.items() if np.isfinite(time_s)}
            shown[svid] = statuses[state[-1, column]]
        return AlarmState(seen=seen, shown=shown)


def _last_time(
    where: Bool[np.ndarray, "n m"], time_s: Float[np.ndarray, " n"], before_s: Float[np.ndarray, " m"]
) -> Float[np.ndarray, "n m"]:
    """Return the time of the last true value at or before each epoch; −∞ without a true value."""
    times = np.where(where, time_s[:, None], -np.inf)
    return np.maximum(np.maximum.accumulate(times, axis=0), before_s)


def state_changes(
    svids: tuple[int, ...], state: Int8[np.ndarray, "n m"], before: AlarmState
) -> list[tuple[int, int, Status, Status]]:
    """Return each change of a state: row, column, state before the change, and state after the change."""
    statuses = tuple(POSITION)
    first = np.array([[POSITION[before.shown.get(svid, Status.NOT_AVAILABLE)] for svid in svids]], np.int8)
    earlier = np.concatenate([first, state[:-1]])
    rows, columns = np.nonzero(earlier != state)
    return [
        (row, column, statuses[earlier[row, column]], statuses[state[row, column]])
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
    ]
