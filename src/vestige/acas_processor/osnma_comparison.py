"""What a receiver demodulated of OSNMA beside what a second channel has of it [WFO, Sec. IV-C].

Validation drops what is forged, so validated keys alone would show a forgery as a loss. What is compared here was
demodulated with a good checksum and no more: the key of each subframe, from whichever satellite, and where both
channels have navigation pages the 40 bits of OSNMA in each page of the same satellite: tags, MACSEQ, root keys.

Keys that follow from later ones were not received. Where nothing is known of what was demodulated (`Assistance` that
nobody read from a folder) the validated keys stand for it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import defaultdict
from dataclasses import dataclass

from vestige.acas_processor.monitors.osnma_check import OsnmaField
from vestige.records import Assistance, ReceivedOsnma
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaComparison:
    """The subframes of a window for which the second channel has a key.

    Attributes
    ----------
    validated
        Of each subframe, whether it brought a key that was validated.
    keys
        Its key; one that differs, if any satellite sent one.
    pages
        The OSNMA of each page that both channels have.
    """

    validated: tuple[bool, ...]
    keys: tuple[OsnmaField, ...]
    pages: tuple[OsnmaField, ...]


def compare_osnma(own: Assistance, second: Assistance, since: GalileoTime, until: GalileoTime) -> OsnmaComparison:
    """Return what was received of subframes that begin in a window, beside what the second channel has.

    Parameters
    ----------
    own, second
        Assistance with what was demodulated, and that of the second channel.
    since, until
        The window, both ends in it.
    """
    received: dict[GalileoTime, set[bytes]] = defaultdict(set)
    demodulated = _between(own, since, until)
    for one in demodulated:
        if one.key is not None:
            received[one.time].add(one.key)
    valid = {key.time: key.data for key in own.keys}
    if not own.received:
        for time, data in valid.items():
            received[time].add(data)
    due = [key for key in second.keys if since <= key.time <= until]
    return OsnmaComparison(
        validated=tuple(valid.get(key.time) in received[key.time] for key in due),
        keys=tuple(OsnmaField(demodulated=_telling(received[key.time], key.data), assisted=key.data) for key in due),
        pages=tuple(_pages(demodulated, _between(second, since, until))),
    )


def _between(assistance: Assistance, since: GalileoTime, until: GalileoTime) -> tuple[ReceivedOsnma, ...]:
    low = bisect_left(assistance.received, since, key=_time)
    return assistance.received[low : bisect_right(assistance.received, until, key=_time)]


def _time(one: ReceivedOsnma) -> GalileoTime:
    return one.time


def _telling(received: set[bytes], assisted: bytes) -> bytes | None:
    """Return of the keys of a subframe one that differs, else the one that does not, None without any."""
    return min(received - {assisted}, default=assisted if received else None)


def _pages(own: tuple[ReceivedOsnma, ...], second: tuple[ReceivedOsnma, ...]) -> list[OsnmaField]:
    known = {(one.svid, one.time): one.fields for one in second}
    return [
        OsnmaField(demodulated=mine, assisted=theirs)
        for one in own
        for mine, theirs in zip(one.fields, known.get((one.svid, one.time), ()), strict=False)
        if mine is not None and theirs is not None
    ]
