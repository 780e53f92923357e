"""No bit of what an operator broadcasts can change: tag, MACSEQ, key, root key and navigation data.

The fast test takes a random sample of the bits, the slow one all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest

from operator_sky import OperatorSky
from osnma_builder import make_page
from vestige.crypto.osnma.messages.navigation_data import NAVIGATION_FIELDS
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import OsnmaReport, ProblemKind
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

START = GalileoTime(1400, 7200)
N = 13  # the tags of subframe 1 with ADKD 12 have their key in subframe 12
ALL_SEEN = 4  # subframes in which all satellites are received
SVIDS = (2, 4, 7, 8, 11, 13, 30, 33)
ATTACKED = 7


@cache
def sky(n_subframes: int) -> tuple[OperatorSky, list[InavPage]]:
    """Return the operator and the pages: of all satellites while tags come that are looked at, then of two of them.

    In later subframes only the keys count, which every satellite sends.
    """
    configuration = OperatorConfiguration(seed=b"flips", start=START, n_subframes=n_subframes)
    one = OperatorSky(configuration, svids=SVIDS)
    return one, [page for page in one.pages() if page.time < START + 30 * ALL_SEEN or page.svid in SVIDS[:2]]


def report_with(n_subframes: int, change: Callable[[InavPage], tuple[int, bytes] | None]) -> OsnmaReport:
    """The report of the pages with other words and OSNMA fields."""
    one, pages = sky(n_subframes)
    changed = []
    for page in pages:
        new = change(page)
        changed.append(page if new is None else make_page(page.svid, page.time, *new))
    return OsnmaReceiver(one.operator.public_keys, one.operator.merkle_tree).process_all(changed)


def flipped(field: bytes, bit: int) -> bytes:
    return (int.from_bytes(field, "big") ^ 1 << 8 * len(field) - 1 - bit).to_bytes(len(field), "big")


def refused_mack_bit(bit: int) -> bool:
    """Whether a bit of the MACK of one satellite in subframe 1 makes a check fail."""
    place = START + (30 + 1 + 2 * (bit // 32))

    def change(page: InavPage) -> tuple[int, bytes] | None:
        if (page.svid, page.time) != (ATTACKED, place):
            return None
        return page.word, flipped(page.osnma, 8 + bit % 32)

    report = report_with(N, change)
    tags = report.tags
    failed = tags.macseq.failed + sum(count.failed for count in tags.by_adkd.values())
    kinds = {problem.kind for problem in report.problems}
    if 336 <= bit < 464:
        return ProblemKind.KEY in kinds and ProblemKind.DISAGREEMENT in kinds and len(report.keys) == N
    # A satellite that nobody receives, or a kind of data that does not exist: the tag proves nothing.
    names_nothing = bit > 56 and 40 <= bit % 56 < 52
    if n_verified(report) >= n_verified(untouched()):
        return False
    return names_nothing or (failed > 0 and bool(kinds & {ProblemKind.TAG, ProblemKind.MACSEQ}))


@cache
def untouched() -> OsnmaReport:
    return report_with(N, lambda _page: None)


def n_verified(report: OsnmaReport) -> int:
    return report.tags.macseq.ok + sum(count.ok for count in report.tags.by_adkd.values())


def refused_root_bit(byte: int, bit: int) -> bool:
    """Whether a bit of the DSM-KROOT, flipped wherever it is sent, leaves no root key and no key."""
    block, place = divmod(byte, 13)

    def change(page: InavPage) -> tuple[int, bytes] | None:
        number = (page.time.gst_seconds // 30 + page.svid) % 8
        if number != block or page.time.second % 30 != 1 + 2 * (place + 2):
            return None
        return page.word, flipped(page.osnma, bit)

    report = report_with(1, change)
    return not report.verified_roots and not report.keys and bool(report.failures)


def refused_header_bit(bit: int) -> bool:
    report = report_with(1, lambda page: (page.word, flipped(page.osnma, bit)) if page.time.second % 30 == 1 else None)
    return not report.verified_roots and not report.keys


def refused_data_bit(adkd: int, kind: int, bit: int) -> bool:
    """Whether tags refuse a word that one satellite sends with a flipped bit all the time."""

    def change(page: InavPage) -> tuple[int, bytes] | None:
        if page.svid != ATTACKED or page.word >> 122 != kind:
            return None
        return page.word ^ 1 << 127 - bit, page.osnma

    report = report_with(4, change)
    proven = {(data.svid, data.adkd) for data in report.navigation}
    others = {(svid, number) for svid in SVIDS for number in (0, 4) if (svid, number) != (ATTACKED, adkd)}
    if 6 <= bit < 16 and kind in (1, 2, 3, 4):  # words of two issues are no data set
        return proven == others
    return proven == others and report.tags.by_adkd[adkd].failed > 0


def mack_bits() -> list[int]:
    flexible = {1}  # 00S FLX 00E 12S 00E 12E: its COP is authenticated by MACSEQ
    cop = {56 * k + bit for k in range(6) if k not in flexible for bit in range(52, 56)}
    return [bit for bit in range(464) if bit not in cop]


CASES: dict[str, tuple[Callable[..., bool], Sequence[tuple[int, ...]], int]] = {
    "tags and keys": (refused_mack_bit, [(bit,) for bit in mack_bits()], 12),
    "root key": (refused_root_bit, [(byte, bit) for byte in range(104) for bit in range(8)], 60),
    "NMA header": (refused_header_bit, [(bit,) for bit in range(8)], 8),
    "navigation data": (
        refused_data_bit,
        [
            (adkd, kind, bit)
            for adkd, fields in NAVIGATION_FIELDS.items()
            for kind, *piece in fields
            for bit in range(*piece)
        ],
        30,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_flipped_bit_is_refused(name: str) -> None:
    refused, bits, n_sample = CASES[name]
    sample = np.random.default_rng(1).choice(len(bits), n_sample, replace=False)
    assert [bits[k] for k in sample if not refused(*bits[k])] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_every_flipped_bit_is_refused(name: str) -> None:
    refused, bits, _ = CASES[name]
    assert [place for place in bits if not refused(*place)] == []


def test_without_a_flip_everything_verifies() -> None:
    for n_subframes in (1, 4, N):
        assert report_with(n_subframes, lambda _page: None).problems == ()
