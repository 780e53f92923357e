"""Compute the timeline of an OSNMA operator: status, chain and DSMs on air in each subframe.

An `OperatorPhase` lasts from a step of an event to the next step. A phase contains the content of the NMA header, the
chain of the transmitted keys, and the broadcast root keys, public keys or notices. The function `phases` makes the
phases from the events.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from vestige.crypto.osnma.messages.dsm import ALERT, CHAIN_REVOKED, DONT_USE, KEY_REVOKED
from vestige.crypto.osnma.operator.events import OsnmaEvent, OsnmaEventKind, status_events
from vestige.time import GalileoTime

NOMINAL, END_OF_CHAIN, NEW_PUBLIC_KEY = 1, 2, 4  # CPKS [OSNMA-ICD, 3.1.3]


@dataclass(frozen=True, slots=True, kw_only=True)
class RootSource:
    """Source of a broadcast root key: its chain, and the public key that verifies its signature."""

    chain: int  # number of the chain: 0 for the first chain, 1 for the next chain, …
    pkid: int


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorPhase:
    """Phase of an OSNMA operator: the OSNMA on air from a given time on."""

    since: GalileoTime
    nma_status: int  # NMAS of the NMA header
    key_status: int  # CPKS of the NMA header
    chain: int  # chain of the transmitted keys and tags: 0 for the first chain, 1 for the next chain, …
    roots: tuple[RootSource, ...]  # sources of the broadcast DSM-KROOTs
    new_pkid: int | None = None  # PKID of the public key that is broadcast, or None
    alert: bool = False  # whether the alert notice is broadcast
    silent: bool = False  # whether no satellite sends OSNMA


def phases(start: GalileoTime, nma_status: int, pkid: int, events: Sequence[OsnmaEvent]) -> tuple[OperatorPhase, ...]:
    """Return all phases of an operator in the order of time.

    Parameters
    ----------
    start
        Start of the first subframe.
    nma_status
        NMAS in nominal operation: test or operational.
    pkid
        PKID of the key that signs at the start.
    events
        Events of the broadcast, in any order.

    Raises
    ------
    VestigeError
        If events overlap.

    Examples
    --------
    >>> [phase.key_status for phase in phases(GalileoTime(1400, 0), 2, 1, ())]
    [1]
    """
    first = OperatorPhase(
        since=start, nma_status=nma_status, key_status=NOMINAL, chain=0, roots=(RootSource(chain=0, pkid=pkid),)
    )
    found = [first]
    for event in status_events(events):
        found += _steps(event, found[-1])
    return tuple(found)


def phase_at(all_phases: Sequence[OperatorPhase], time: GalileoTime) -> OperatorPhase:
    """Return the phase of the subframe at a time; for a time before the first phase, return the first phase."""
    return all_phases[max(bisect_right([phase.since for phase in all_phases], time) - 1, 0)]


def _steps(event: OsnmaEvent, before: OperatorPhase) -> Iterator[OperatorPhase]:
    """Yield the phases of an event that begins in a nominal phase."""
    (source,) = before.roots
    step_1 = replace(before, since=event.announced)
    chain, pkid, key_status = source.chain, source.pkid, NOMINAL
    match event.kind:
        case OsnmaEventKind.CHAIN_RENEWAL:
            chain += 1
            step_1 = replace(step_1, key_status=END_OF_CHAIN, roots=(source, RootSource(chain=chain, pkid=pkid)))
        case OsnmaEventKind.CHAIN_REVOCATION:
            chain, key_status = chain + 1, CHAIN_REVOKED
            step_1 = replace(step_1, nma_status=DONT_USE, roots=(RootSource(chain=chain, pkid=pkid),))
        case OsnmaEventKind.KEY_RENEWAL:
            pkid, key_status = pkid + 1, NEW_PUBLIC_KEY
            step_1 = replace(step_1, new_pkid=pkid)
        case OsnmaEventKind.KEY_REVOCATION:
            chain, pkid, key_status = chain + 1, pkid + 1, KEY_REVOKED
            step_1 = replace(step_1, nma_status=DONT_USE, roots=(RootSource(chain=chain, pkid=pkid),), new_pkid=pkid)
        case OsnmaEventKind.ALERT:
            step_1 = replace(step_1, nma_status=DONT_USE, key_status=ALERT, alert=True)
        case _:
            step_1 = replace(step_1, nma_status=DONT_USE)
    if key_status != NOMINAL:
        step_1 = replace(step_1, key_status=key_status)
    yield step_1
    nominal = replace(before, chain=chain, roots=(RootSource(chain=chain, pkid=pkid),))
    if event.in_force is not None:
        yield replace(nominal, since=event.in_force, key_status=key_status, new_pkid=step_1.new_pkid)
    if event.ended is not None:
        yield replace(nominal, since=event.ended, silent=event.kind is OsnmaEventKind.ALERT)
