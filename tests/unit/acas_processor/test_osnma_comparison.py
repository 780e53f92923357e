"""What was demodulated of OSNMA beside a second channel: forgeries with good checksums are no losses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from evidence_builder import evidence, outcome
from osnma_builder import Broadcast, make_page
from simulated_chain import make_chain
from vestige.acas_processor.checks.osnma import (
    OsnmaAgreementMonitor,
    OsnmaAvailabilityMonitor,
    OsnmaReceptionMonitor,
)
from vestige.acas_processor.checks.osnma_subframes import KEY_BIT, Subframes, subframes
from vestige.acas_processor.monitoring.memory import OsnmaMemory
from vestige.acas_processor.osnma_comparison import compare_osnma
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.navigation.inav.page import InavPage
from vestige.records import Assistance, ReceivedOsnma
from vestige.records.snapshot_block import OsnmaBlock
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_800 - 5 * 30)  # the sixth subframe is in the next week
N = 20
CHAIN = make_chain(b"second channel", START, N, chain_id=1, pkid=4)
KEYS = CHAIN.validated_keys()
PAGES = Broadcast(CHAIN, n_subframes=N).pages()


def of_pages(pages: Sequence[InavPage]) -> Assistance:
    """Assistance as a folder with these pages gives it."""
    receiver = OsnmaReceiver((CHAIN.public_key,), CHAIN.tree)
    for page in pages:
        receiver.process(page)
    receiver.finish()
    return Assistance(keys=receiver.filled_keys(), received=receiver.received())


def of_key_file(times: Sequence[int]) -> Assistance:
    keys = tuple(KEYS[k] for k in times)
    return Assistance(keys=keys, received=tuple(ReceivedOsnma(svid=None, time=key.time, key=key.data) for key in keys))


SVIDS = (2, 3, 7, 8, 11)


def compared(
    own: Assistance, second: Assistance, first: GalileoTime = START + -1, last: GalileoTime = START + 30 * N
) -> OsnmaBlock:
    return compare_osnma(own, second, first, last, SVIDS)


def outcomes(own: Assistance, second: Assistance) -> tuple[str, str, str]:
    """Return the gravest outcome of each check over the whole time."""
    block = compared(own, second)
    found, _ = subframes(block, SVIDS, OsnmaMemory())
    of_last = Subframes(  # the window of the whole time, and every field of it
        epoch=np.zeros(1, np.int64),
        missing=found.missing[-1:],
        window=found.window[-1:],
        due=np.sum(found.due, keepdims=True),
        lost=np.sum(found.lost, keepdims=True),
        received=np.sum(found.received, keepdims=True),
        differs=np.sum(found.differs, keepdims=True),
    )
    given = evidence(subframes=of_last, osnma=block)
    checks = (OsnmaAvailabilityMonitor(), OsnmaReceptionMonitor(), OsnmaAgreementMonitor())
    return tuple(outcome(check, given).outcome.value for check in checks)  # type: ignore[return-value]


def keys_received(block: OsnmaBlock) -> list[bool]:
    return np.any(block.received & ~block.differs & KEY_BIT, axis=1).tolist()


def pages_compared(block: OsnmaBlock) -> int:
    return sum(int(bits & (KEY_BIT - 1)).bit_count() for bits in block.received.ravel())


TRUE = of_pages(PAGES)
NETWORK = of_key_file(range(N))


def test_what_the_satellites_sent_agrees() -> None:
    assert [key.data for key in TRUE.keys] == [key.data for key in KEYS]
    assert outcomes(TRUE, NETWORK) == ("pass", "pass", "pass")
    assert outcomes(TRUE, TRUE) == ("pass", "pass", "pass")
    found = compared(TRUE, TRUE)
    assert found.epoch.size == N
    assert pages_compared(found) == 3 * N * 15
    assert pages_compared(compared(TRUE, NETWORK)) == 0


@pytest.mark.parametrize("svids", [(2, 7, 11), (7,)])
def test_a_forged_key_is_a_difference_and_no_loss(svids: tuple[int, ...]) -> None:
    """Its pages have good checksums; it does not validate, and that of the subframe follows from the next one."""

    def forged(svid: int, index: int, key: bytes) -> bytes:
        return key if index != 6 or svid not in svids else bytes([key[0] ^ 1]) + key[1:]

    own = of_pages(Broadcast(CHAIN, n_subframes=N, key_of=forged).pages())
    assert [key.data for key in own.keys] == [key.data for key in KEYS]
    assert outcomes(own, NETWORK) == ("pass", "pass", "fail")
    found = compared(own, NETWORK)
    assert np.flatnonzero(np.any(found.differs, axis=1)).tolist() == [6]
    assert keys_received(found) == [k != 6 or len(svids) < 3 for k in range(N)]


def test_a_missing_key_is_a_loss_although_it_follows_from_a_later_one() -> None:
    kept_away = [page for page in PAGES if not START + 150 <= page.time < START + 300 + 150]
    own = of_pages(kept_away)
    assert [key.data for key in own.keys] == [key.data for key in KEYS]  # those of the gap follow
    assert outcomes(own, NETWORK) == ("fail", "fail", "pass")
    one_gone = of_pages([page for page in PAGES if not START + 150 <= page.time < START + 180])
    assert keys_received(compared(one_gone, NETWORK)) == [k != 5 for k in range(N)]
    assert outcomes(one_gone, NETWORK) == ("pass", "pass", "pass")


def of_attacker(change: Callable[[bytes], bytes], svid: int = 7, index: int = 6, number: int = 2) -> list[InavPage]:
    """All pages; the OSNMA of one is changed, and its checksum made for that."""
    time = START + (30 * index + 1 + 2 * number)
    return [
        make_page(page.svid, page.time, page.word, change(page.osnma))
        if (page.svid, page.time) == (svid, time)
        else page
        for page in PAGES
    ]


def test_a_forged_tag_is_seen_where_the_second_channel_has_pages() -> None:
    """Pages 0 to 9 hold tags and MACSEQ, of which keys say nothing."""
    own = of_pages(of_attacker(lambda osnma: osnma[:4] + bytes([osnma[4] ^ 1])))
    assert outcomes(own, TRUE) == ("pass", "pass", "fail")
    assert outcomes(own, NETWORK) == ("pass", "pass", "pass")


def test_a_page_with_a_wrong_checksum_is_no_difference() -> None:
    damaged = [
        replace(page, data=page.data[:9] + bytes([page.data[9] ^ 1]) + page.data[10:])
        if page.time == START + 191
        else page
        for page in PAGES
    ]
    assert not all(page.crc_ok for page in damaged)
    assert outcomes(of_pages(damaged), TRUE) == ("pass", "pass", "pass")


def test_pages_of_other_satellites_and_times_are_not_compared() -> None:
    far = of_pages(Broadcast(CHAIN, n_subframes=N, svids=(3, 8)).pages())
    assert pages_compared(compared(TRUE, far)) == 0
    window = compared(TRUE, TRUE, START + 30, START + 90)
    assert (window.epoch.size, pages_compared(window)) == (2, 2 * 3 * 15)


def test_without_what_was_demodulated_validated_keys_stand_for_it() -> None:
    assert outcomes(Assistance(keys=KEYS), NETWORK) == ("pass", "pass", "pass")
    assert outcomes(Assistance(), NETWORK) == ("fail", "fail", "not run")


@pytest.mark.parametrize("number", [0, 7, 12, 14])
@pytest.mark.parametrize("starts", [True, False])
def test_osnma_that_starts_or_stops_within_a_subframe_is_no_difference(number: int, starts: bool) -> None:
    """E07 sends zeros before or after a page of subframe 6, as its own receiver or as the second channel has it."""
    edge = START + (181 + 2 * number)
    pages = [
        make_page(7, page.time, page.word, bytes(5)) if page.svid == 7 and (page.time < edge) is starts else page
        for page in PAGES
    ]
    part = of_pages(pages)
    assert outcomes(part, TRUE) == outcomes(TRUE, part) == outcomes(part, NETWORK) == ("pass", "pass", "pass")
    n_sent = 15 * (N - 6) - number if starts else 15 * 6 + number
    assert pages_compared(compared(part, TRUE)) == pages_compared(compared(TRUE, TRUE)) - 15 * N + n_sent
