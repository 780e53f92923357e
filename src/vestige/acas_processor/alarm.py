"""What a receiver shows of its verdicts: one alarm for each change of state, and no flicker.

Verdicts come one for each RECS and suspicion comes between them, so the state of a satellite is the gravest status of
the last `hold_s`: it is raised at once, and falls only when nothing as grave was seen for that long. An attack that a
check sees every now and then is one alarm, not hundreds. AUTHENTIC says something of a range, so it is not held for a
satellite that E1 has lost: there is no range. Alarms are.

`AlarmState.step` folds over epochs as they come, `state_block` says the same of arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int8

from vestige.acas_processor.mitigation import ALARMS, GRAVITY
from vestige.records import Status
from vestige.time import GalileoTime

HOLD_S = 90.0  # three RECS of the service, one each 30 s


@dataclass(frozen=True, slots=True, kw_only=True)
class StateChange:
    """A satellite's state changed.

    Attributes
    ----------
    time
        Of the snapshot that changed it.
    before, after
        States.
    reason
        Of the verdict that changed it; "" if nothing happened for long enough.
    """

    time: GalileoTime
    svid: int
    before: Status
    after: Status
    reason: str

    @property
    def alarm(self) -> bool:
        """Whether it is one to worry about: a state of alarm that was not there before."""
        return self.after in ALARMS


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmState:
    """State of all satellites.

    Attributes
    ----------
    hold_s
        How long a status counts, in s.
    seen
        When each status was last seen, by satellite.
    shown
        State of each satellite.
    """

    hold_s: float = HOLD_S
    seen: Mapping[int, Mapping[Status, GalileoTime]] = field(default_factory=dict)
    shown: Mapping[int, Status] = field(default_factory=dict)

    def step(self, svid: int, time: GalileoTime, status: Status, reason: str) -> tuple[AlarmState, StateChange | None]:
        """Return the state after a verdict, and the change if there is one.

        Parameters
        ----------
        svid, time, status, reason
            Of the verdict; times of a satellite must not go back.
        """
        seen = {**self.seen.get(svid, {}), status: time}
        before = self.shown.get(svid, Status.NOT_AVAILABLE)
        after = next(
            (one for one in reversed(GRAVITY) if one in seen and time - seen[one] < self.hold_s), Status.NOT_AVAILABLE
        )
        state = replace(self, seen={**self.seen, svid: seen}, shown={**self.shown, svid: after})
        if after is before:
            return state, None
        why = reason if after is status else ""
        return state, StateChange(time=time, svid=svid, before=before, after=after, reason=why)

    def lost(self, svid: int, time: GalileoTime, reason: str) -> tuple[AlarmState, StateChange | None]:
        """Return the same after an epoch in which E1 does not show a satellite."""
        alarms = {one: when for one, when in self.seen.get(svid, {}).items() if one in ALARMS}
        forgotten = replace(self, seen={**self.seen, svid: alarms})
        return forgotten.step(svid, time, Status.NOT_AVAILABLE, reason)


def state_block(
    status: Int8[np.ndarray, "n_epochs m"], time_s: Float[np.ndarray, " n_epochs"], hold_s: float = HOLD_S
) -> Int8[np.ndarray, "n_epochs m"]:
    """Return the state of every epoch and satellite, as the position in `Status`, as `AlarmState` folds it.

    Parameters
    ----------
    status
        Of every epoch, as the position in `Status`.
    time_s
        Ascending.
    hold_s
        As `AlarmState`.
    """
    positions = {one: position for position, one in enumerate(Status)}
    state = np.full(status.shape, positions[Status.NOT_AVAILABLE], np.int8)
    for one in GRAVITY[1:]:
        here = np.where(status == positions[one], time_s[:, None], -np.inf)
        held = time_s[:, None] - np.maximum.accumulate(here, axis=0) < hold_s
        state[held] = positions[one]
    return state
