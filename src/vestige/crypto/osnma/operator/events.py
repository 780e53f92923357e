"""Describe the events of an OSNMA operator that change its chain, keys or service.

The steps of each event follow [OSNMA-ICD, 5.5] and [OSNMA-RG, 4.2], as the official test vectors send the steps:

| event | from `announced` on | from `in_force` on | from `ended` on |
|---|---|---|---|
| chain renewal | end of chain; root keys of this chain and the next | nominal, next chain | |
| chain revocation | don't use, chain revoked; root key of the next chain | chain revoked, next chain | nominal |
| key renewal | new public key; DSM-PKR | new public key; DSM-PKR, root key signed with the new key | nominal |
| key revocation | don't use, key revoked; DSM-PKR, root key of the next chain | key revoked, next chain | nominal |
| alert | don't use, alert message; DSM-PKR with the notice | | no OSNMA at all |
| don't use | don't use, keys nominal | | nominal |
| silence | no OSNMA from some satellites, or from all | | OSNMA again |
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

from vestige.constants import HOUR_S, MAX_SVID, SUBFRAME_S
from vestige.errors import VestigeError
from vestige.time import GalileoTime


class OsnmaEventKind(Enum):
    """Kind of event of an OSNMA operator."""

    CHAIN_RENEWAL = "chain-renewal"
    CHAIN_REVOCATION = "chain-revocation"
    KEY_RENEWAL = "key-renewal"
    KEY_REVOCATION = "key-revocation"
    ALERT = "alert"
    DONT_USE = "dont-use"
    SILENCE = "silence"

    @property
    def has_step_2(self) -> bool:
        """Whether an event of this kind has step 2, in which a new chain or key comes into force."""
        return self not in (OsnmaEventKind.ALERT, OsnmaEventKind.DONT_USE, OsnmaEventKind.SILENCE)

    @property
    def has_end(self) -> bool:
        """Whether an event of this kind has the last step `ended`."""
        return self is not OsnmaEventKind.CHAIN_RENEWAL


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaEvent:
    """An event of the operator, whose times are starts of subframes.

    Parameters
    ----------
    kind
        Kind of the event.
    announced
        Time from which the event is on air (step 1).
    in_force
        Time from which the new chain or key is in force (step 2); None if step 2 does not happen, or the kind has no
        step 2.
    ended
        Time from which the status is nominal again, or OSNMA is on air again after a silence. After an alert, OSNMA is
        silent from this time on. None if the event does not end, and for a chain renewal, which is over from `in_force`
        on.
    svids
        Satellites without OSNMA, for the kind silence only. None means all satellites.

    Raises
    ------
    VestigeError
        If a time is not the start of a subframe, the times do not increase, or a field does not belong to the kind.
        Also if `ended` is given without the `in_force` that the kind needs, or if `svids` is empty or contains a number
        outside 1 to 36.

    Examples
    --------
    >>> OsnmaEvent(
    ...     kind=OsnmaEventKind.CHAIN_RENEWAL,
    ...     announced=GalileoTime(1400, 3600),
    ...     in_force=GalileoTime(1400, 7200),
    ... ).complete
    True
    """

    kind: OsnmaEventKind
    announced: GalileoTime
    in_force: GalileoTime | None = None
    ended: GalileoTime | None = None
    svids: frozenset[int] | None = None

    def __post_init__(self) -> None:
        name = f"OSNMA event {self.kind.value}"
        for field, allowed in (("in_force", self.kind.has_step_2), ("ended", self.kind.has_end)):
            if getattr(self, field) is not None and not allowed:
                raise VestigeError(f"{name}: {field} does not belong to it")
        if self.svids is not None:
            if self.kind is not OsnmaEventKind.SILENCE:
                raise VestigeError(f"{name}: svids belong to {OsnmaEventKind.SILENCE.value} alone")
            if not self.svids or not all(1 <= svid <= MAX_SVID for svid in self.svids):
                raise VestigeError(f"{name}: svids: found {sorted(self.svids)}, expected numbers from 1 to {MAX_SVID}")
        for time in self.times:
            if time.fraction or time.second % SUBFRAME_S:
                raise VestigeError(f"{name}: {time} is not the start of a subframe, a multiple of {SUBFRAME_S} s")
        if list(self.times) != sorted(set(self.times)):
            raise VestigeError(f"{name}: expected announced before in_force before ended")
        if self.ended is not None and self.in_force is None and self.kind.has_step_2:
            raise VestigeError(f"{name}: it cannot end without in_force")

    @property
    def times(self) -> tuple[GalileoTime, ...]:
        """Times of the event that are not None, in the order of the steps."""
        return tuple(time for time in (self.announced, self.in_force, self.ended) if time is not None)

    @property
    def complete(self) -> bool:
        """Whether the status is nominal again after the event, so that another event can follow."""
        if self.kind is OsnmaEventKind.ALERT:
            return False
        return (self.ended if self.kind.has_end else self.in_force) is not None


def overlap(events: Iterable[OsnmaEvent]) -> tuple[OsnmaEvent, OsnmaEvent] | None:
    """Return a pair of events that overlap; None if no events overlap.

    Only events that change the status are compared: all kinds except silence.
    """
    for before, after in pairwise(_in_order(events)):
        if not before.complete or after.announced < before.times[-1]:
            return before, after
    return None


def status_events(events: Iterable[OsnmaEvent]) -> tuple[OsnmaEvent, ...]:
    """Return the events that change the status (all kinds except silence) in the order of time.

    Raises
    ------
    VestigeError
        If an event begins before the previous event is over.
    """
    ordered = _in_order(events)
    if (pair := overlap(ordered)) is not None:
        before, after = pair
        raise VestigeError(
            f"OSNMA event {after.kind.value} of {after.announced} begins before the {before.kind.value} of "
            f"{before.announced} is over"
        )
    return ordered


def _in_order(events: Iterable[OsnmaEvent]) -> tuple[OsnmaEvent, ...]:
    changing = (event for event in events if event.kind is not OsnmaEventKind.SILENCE)
    return tuple(sorted(changing, key=lambda event: event.announced))


def key_withheld(events: Iterable[OsnmaEvent], svids: Iterable[int], time: GalileoTime) -> bool:
    """Return whether a receiver must not, or cannot ever, use the TESLA key of the subframe of `time`.

    After a revocation, a receiver uses no key of the revoked chain. A receiver uses no key while the status is "don't
    use". After "don't use" the receiver waits for a root key of an hour that begins after the announcement. After an
    alert the receiver uses no key any more. A key that is not sent during a silence follows from the keys after the
    silence.

    Parameters
    ----------
    events
        Events of the broadcast.
    svids
        All satellites that may be in view of the receiver.
    time
        Start of a subframe.
    """
    return any(event.announced <= time and _withholds(event, frozenset(svids), time) for event in events)


def _withholds(event: OsnmaEvent, svids: frozenset[int], time: GalileoTime) -> bool:
    """Return whether an event that has begun withholds the key of the subframe of `time`."""
    match event.kind:
        case OsnmaEventKind.CHAIN_REVOCATION | OsnmaEventKind.KEY_REVOCATION:
            return event.in_force is None or time < event.in_force
        case OsnmaEventKind.ALERT:
            return True
        case OsnmaEventKind.DONT_USE:
            next_hour = event.announced + float(HOUR_S - event.announced.second % HOUR_S)
            return event.ended is None or time < max(event.ended, next_hour)
        case OsnmaEventKind.SILENCE:
            return event.ended is None and (event.svids is None or svids <= event.svids)
        case _:
            return False


def silent_svids(events: Iterable[OsnmaEvent], svids: Iterable[int], time: GalileoTime) -> frozenset[int]:
    """Return the satellites that send no OSNMA in the subframe of `time` because of a silence."""
    silent: set[int] = set()
    for event in events:
        on_air = event.announced <= time and (event.ended is None or time < event.ended)
        if event.kind is OsnmaEventKind.SILENCE and on_air:
            silent.update(svid for svid in svids if event.svids is None or svid in event.svids)
    return frozenset(silent)
