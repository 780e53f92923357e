"""Compare demodulated OSNMA with the OSNMA of a second channel, subframe by subframe [WFO, Sec. IV-C].

Validation drops forged keys, so validated keys alone would show a forged key as a lost key. Therefore this module
compares all data that were demodulated with a valid checksum, validated or not. The key of each subframe is compared,
whichever satellite sent the key. If both channels have navigation pages of a satellite, the 40 bits of OSNMA in each
page are compared too (tags, MACSEQ, root keys).

Keys that are computed from later keys do not count as received. If the demodulated keys are unknown (`Assistance` that
was not read from a folder), the validated keys are compared instead.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict

import numpy as np

from vestige.acas_processor.checks.osnma_subframes import KEY_BIT
from vestige.records import Assistance, ReceivedOsnma
from vestige.records.snapshot_block import OsnmaBlock
from vestige.time import GalileoTime


def compare_osnma(
    own: Assistance, second: Assistance, since: GalileoTime, until: GalileoTime, svids: tuple[int, ...]
) -> OsnmaBlock:
    """Return the comparison of the received subframes with the subframes of the second channel.

    The compared subframes begin after `since` and not after `until`, and have a validated key in the second channel.
    `svids` has at least one satellite.

    All satellites send the same key in a subframe, so the key counts once, in the first column. If a different key was
    received beside the right key, the different key counts in the last column. A right key that was not validated
    counts as lost.
    """
    keys: dict[GalileoTime, set[bytes]] = defaultdict(set)
    demodulated = _between(own, since, until)
    for one in demodulated:
        if one.key is not None:
            keys[one.time].add(one.key)
    valid = {key.time: key.data for key in own.keys}
    if not own.received:
        for time, data in valid.items():
            keys[time].add(data)
    pages = {(one.svid, one.time): one.fields for one in _between(second, since, until)}
    mine = {(one.svid, one.time): one.fields for one in demodulated}
    due_keys = sorted((key for key in second.keys if since < key.time <= until), key=lambda key: key.time)
    due, received, differs = np.zeros((3, len(due_keys), len(svids)), np.int64)
    for row, key in enumerate(due_keys):
        sent = keys[key.time]
        wrong, right = bool(sent - {key.data}), valid.get(key.time) in sent
        due[row, 0] = KEY_BIT
        received[row, 0] = KEY_BIT * (right or wrong)
        # If the right key was received too, another satellite sent the forged key.
        forged = len(svids) - 1 if right else 0
        received[row, forged] |= KEY_BIT * wrong
        differs[row, forged] |= KEY_BIT * wrong
        for column, svid in enumerate(svids):
            both = zip(mine.get((svid, key.time), ()), pages.get((svid, key.time), ()), strict=False)
            for page, (field, assisted) in enumerate(both):
                if field is not None and assisted is not None:
                    received[row, column] |= 1 << page
                    differs[row, column] |= (field != assisted) << page
    return OsnmaBlock(
        epoch=np.zeros(len(due_keys), np.int64),
        subframe=np.array([key.time.gst_seconds for key in due_keys], np.int64),
        due=due,
        received=received,
        differs=differs,
        last=np.ones(len(due_keys), np.bool_),
    )


def _between(assistance: Assistance, since: GalileoTime, until: GalileoTime) -> tuple[ReceivedOsnma, ...]:
    low = bisect_right(assistance.received, since, key=_time)
    return assistance.received[low : bisect_right(assistance.received, until, key=_time)]


def _time(one: ReceivedOsnma) -> GalileoTime:
    return one.time
