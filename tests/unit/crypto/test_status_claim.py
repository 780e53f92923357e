"""A header "don't use" that nobody signed, and the tags that tell whether it is forged."""

from __future__ import annotations

import pytest

from osnma_builder import Broadcast, make_page
from simulated_chain import make_chain
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import OsnmaReport, ProblemKind
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_800 - 5 * 30)  # the sixth subframe is in the next week
N = 14
CHAIN = make_chain(
    b"status claim", START, N, chain_id=1, pkid=4, parameters=ChainParameters(mac_lookup=34, alpha=b"sixbyt")
)
PAGES = Broadcast(CHAIN, n_subframes=N).pages()
KEYS = [key.data for key in CHAIN.keys]


def run(pages: list[InavPage]) -> OsnmaReport:
    return OsnmaReceiver((CHAIN.public_key,), CHAIN.tree).process_all(pages)


def with_header(pages: list[InavPage], svid: int, index: int, value: int) -> list[InavPage]:
    """The pages; the header of one satellite and subframe is forged, and its checksum made for that."""
    time = START + (30 * index + 1)
    return [
        make_page(svid, time, page.word, bytes([value]) + page.osnma[1:])
        if (page.svid, page.time) == (svid, time)
        else page
        for page in pages
    ]


def test_a_forged_do_not_use_costs_30_s_and_no_key() -> None:
    """Each subframe from the fourth on with another of the 64 values; the tags of the subframe disprove it."""
    pages = PAGES
    for index in range(4, N):
        pages = with_header(pages, 7, index, 0xC0 | 5 * index & 63)
    receiver = OsnmaReceiver((CHAIN.public_key,))
    seen = {key.time: page.time for page in pages for key in receiver.process(page)}
    receiver.finish()
    report = receiver.report()
    # The key of the last subframe would be needed to disprove that of the one before, which is in the last one's tags.
    assert [key.data for key in report.keys] == KEYS[: N - 1]
    assert [key.data for key in report.withheld] == KEYS[N - 1 :]
    assert all(60 < page - key <= 75 for key, page in seen.items() if key > START + 4 * 30)
    assert {problem.kind for problem in report.problems} == {ProblemKind.STATUS}
    assert sum("E07: unsigned header 0xD9" in problem.text for problem in report.problems) == 2
    assert any("the tags prove that this header is forged" in problem.text for problem in report.problems)
    assert report.failures == ()
    assert all(count.failed == 0 for count in report.tags.by_adkd.values())


@pytest.mark.parametrize("number", range(1, 15))
def test_one_forged_byte_and_a_lost_page_cost_the_key(number: int) -> None:
    """The tags are read as a whole: if a page with tags is lost, they disprove nothing. Pages 11 to 14 hold the key."""
    pages = with_header(PAGES, 7, 6, 0xD2)
    report = run([page for page in pages if (page.svid, page.time) != (7, START + (181 + 2 * number))])
    lost = [START + 180] if number <= 10 else []
    assert [withheld.time for withheld in report.withheld] == lost
    assert [key.time for key in report.keys] == [START + 30 * k for k in range(N) if START + 30 * k not in lost]


@pytest.mark.parametrize("what", ["tags", "data", "another satellite"])
def test_without_a_good_tag_of_the_same_satellite_do_not_use_holds(what: str) -> None:
    """The tags of E07 are damaged, or its navigation data of before is lost; those of the others are good."""
    pages = with_header(PAGES, 7, 6, 0xD2)
    if what == "tags":
        pages = [
            make_page(7, page.time, page.word, page.osnma[:1] + bytes(a ^ 0x5A for a in page.osnma[1:]))
            if page.svid == 7 and START + 182 < page.time <= START + 201
            else page
            for page in pages
        ]
    elif what == "data":
        pages = [page for page in pages if not START + 150 <= page.time < START + 180]
    else:
        pages = with_header(pages, 2, 6, 0xD2)
        pages = [page for page in pages if not (page.svid == 2 and START + 182 < page.time <= START + 201)]
    report = run(pages)
    assert START + 180 not in {key.time for key in report.keys}
    (withheld,) = report.withheld
    assert withheld.time == START + 180
    assert "unsigned header 0xD2 (don't use" in withheld.reason


def test_the_chain_that_a_header_names_does_not_decide() -> None:
    """With one satellite and another chain id in each header all keys are found all the same."""
    pages = Broadcast(CHAIN, svids=(7,), n_subframes=N).pages()
    for index in range(9, N):
        pages = with_header(pages, 7, index, 0x82 | index % 4 << 4)
    report = run(pages)
    assert [key.data for key in report.keys] == KEYS
    assert report.failures == ()
