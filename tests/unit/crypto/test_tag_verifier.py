from __future__ import annotations

from osnma_builder import Broadcast, make_page
from simulated_chain import make_chain
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import OsnmaReport
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_800 - 5 * 30)  # the sixth subframe is in the next week
N = 14
CHAIN = make_chain(
    b"tag verifier", START, N, chain_id=1, pkid=4, parameters=ChainParameters(mac_lookup=34, alpha=b"sixbyt")
)
PAGES = Broadcast(CHAIN, n_subframes=N).pages()


def run(pages: list[InavPage]) -> OsnmaReport:
    return OsnmaReceiver((CHAIN.public_key,), CHAIN.tree).process_all(pages)


REPORT = run(PAGES)


def test_tags_on_the_word_5_before_a_change_without_new_iodnav_verify() -> None:
    """The words 5 of all satellites change in subframe 6; the tags of subframe 7 are still of the word before."""

    def changed(page: InavPage) -> InavPage:
        kind, index = page.word >> 122, (page.time - START) // 30
        return make_page(page.svid, page.time, page.word ^ 1 << 100, page.osnma) if kind == 5 and index == 6 else page

    pages = [changed(page) for page in PAGES]
    report = run(pages)
    # In subframe 8 the tags are of the old word again, and so is the word of subframe 7.
    n_tags = sum(count.checked for count in REPORT.tags.by_adkd.values())
    assert report.problems == ()
    assert report.tags.by_adkd == REPORT.tags.by_adkd
    assert sum(count.ok for count in report.tags.by_adkd.values()) == n_tags
    assert report.tags.data_before == 3 * 4  # of 6 tags of each satellite: ADKD 4 is not concerned, nor is a slow one
    assert report.navigation == REPORT.navigation
    # A word that stays changed is wrong from the second subframe on.
    stays = run([
        make_page(page.svid, page.time, page.word ^ 1 << 100, page.osnma)
        if page.word >> 122 == 5 and page.time >= START + 180
        else page
        for page in PAGES
    ])  # fmt: skip
    assert stays.tags.by_adkd[0].failed > 0
    assert all(problem.time >= START + 240 for problem in stays.problems)
