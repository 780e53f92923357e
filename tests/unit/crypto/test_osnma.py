from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from osnma_builder import Broadcast, make_page
from simulated_chain import SimulatedChain, make_chain
from vestige.crypto.keys.merkle_tree import MerkleTree
from vestige.crypto.keys.public_key import PublicKey, Trust
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.subframe import PageStatus
from vestige.crypto.osnma.operator.signed_messages import sign_kroot
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import Count, OsnmaReport, ProblemKind
from vestige.errors import AuthenticationError
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_800 - 5 * 30)  # the sixth subframe is in the next week
N = 14


def chain_of(mac_lookup: int = 34, seed: bytes = b"osnma", **more: int) -> SimulatedChain:
    parameters = ChainParameters(mac_lookup=mac_lookup, alpha=b"sixbyt", **more)
    return make_chain(seed, START, N, chain_id=1, pkid=4, parameters=parameters)


CHAIN = chain_of()
PAGES = Broadcast(CHAIN, n_subframes=N).pages()


def run(pages: list[InavPage], chain: SimulatedChain = CHAIN) -> OsnmaReport:
    return OsnmaReceiver((chain.public_key,), chain.tree).process_all(pages)


REPORT = run(PAGES)


def kinds(report: OsnmaReport) -> set[ProblemKind]:
    return {problem.kind for problem in report.problems}


def expected_keys(chain: SimulatedChain = CHAIN) -> list[bytes]:
    return [key.data for key in chain.keys]


def tail_pages(pages: list[InavPage], svid: int | None, first: int, last: int) -> list[InavPage]:
    """The pages without those of a satellite (None: all of them) with numbers first … last of every subframe."""
    return [
        page for page in pages
        if (svid is not None and page.svid != svid) or not first <= (page.time.second % 30 - 1) // 2 <= last
    ]  # fmt: skip


@pytest.mark.parametrize("mac_lookup", [33, 34])
def test_everything_verifies_across_the_end_of_the_week(mac_lookup: int) -> None:
    chain = chain_of(mac_lookup)
    report = run(Broadcast(chain, n_subframes=N).pages(), chain)
    assert report.problems == ()
    assert report.failures == ()
    report.raise_if_failed()
    assert [key.data for key in report.keys] == expected_keys(chain)
    assert report.keys[5].time == GalileoTime(1401, 0)
    assert report.chain_steps == Count(ok=N - 1)
    # 3 satellites; MACSEQ and tags of the last subframe lack their key, slow tags those of the last eleven.
    assert report.tags.macseq == Count(ok=3 * (N - 1))
    assert all(count.failed == 0 for count in report.tags.by_adkd.values())
    slow = sum(2 if (START.second // 30 + k) % 2 else 1 for k in range(1, N - 11)) * 3
    assert report.tags.by_adkd[12] == Count(ok=slow)
    assert report.tags.no_data == 3 * 6  # nothing was received before the first subframe
    (check,) = report.roots
    assert check.root is not None
    assert check.root.data == chain.kroot.root_key
    assert {(data.svid, data.adkd, data.iod_nav) for data in report.navigation if data.authenticated} == {
        (svid, adkd, 5 if adkd == 0 else None) for svid in (2, 7, 11) for adkd in (0, 4)
    }  # fmt: skip
    assert report.time_stamps == Count(ok=N * 3 * 8)


@settings(max_examples=4)
@given(st.integers(0, 2**32))
def test_the_order_of_pages_does_not_matter_within_reason(seed: int) -> None:
    delay_s = np.random.default_rng(seed).uniform(0, 8, len(PAGES))
    order = sorted(range(len(PAGES)), key=lambda k: PAGES[k].time.gst_seconds + delay_s[k])
    report = run([PAGES[k] for k in order])
    assert report.tags == REPORT.tags
    assert report == REPORT


def test_keys_come_out_one_by_one_as_the_pages_come_in() -> None:
    receiver = OsnmaReceiver((CHAIN.public_key,))
    seen = [(key.time, page.time) for page in PAGES for key in receiver.process(page)]
    # With three satellites it takes four subframes until there are all eight blocks; their keys wait for the root key.
    assert [key for key, _ in seen] == [START + 30 * k for k in range(N - 1)]
    assert all(page - key <= 45 for key, page in seen[4:])
    assert [key.time for key in receiver.finish()] == [START + 30 * (N - 1)]


def test_a_page_with_a_wrong_checksum_is_a_lost_page() -> None:
    damaged = [
        replace(page, data=page.data[:17] + bytes([page.data[17] ^ 4]) + page.data[18:])
        if page.svid == 7 and page.time == START + 91
        else page
        for page in PAGES
    ]
    report = run(damaged)
    assert report.n_crc_failures == 1
    assert report.n_missing_pages == 1
    assert [key.data for key in report.keys] == expected_keys()
    assert report.failures == ()


def test_a_key_is_read_when_only_its_own_pages_are_there() -> None:
    """Pages 5 to 9 of all subframes are lost: no DSM block, no tag, but header and key."""
    receiver = OsnmaReceiver((CHAIN.public_key,), CHAIN.tree)
    whole = [page for page in PAGES if page.time < START + 120]
    rest = tail_pages([page for page in PAGES if page.time >= START + 120], None, 5, 9)
    for page in (*whole, *rest):
        receiver.process(page)
    receiver.finish()
    report = receiver.report()
    assert [key.data for key in report.keys] == expected_keys()
    assert report.tags.macseq == Count(ok=12)
    # Without the first pages nobody says which chain and status it is.
    blind = run([*whole, *tail_pages(rest, None, 0, 0)])
    assert [key.data for key in blind.keys] == expected_keys()[:4]


def test_a_gap_is_reported_and_can_be_filled() -> None:
    receiver = OsnmaReceiver((CHAIN.public_key,))
    for page in PAGES:
        if not START + 150 <= page.time < START + 300:
            receiver.process(page)
    receiver.finish()
    report = receiver.report()
    (gap,) = report.gaps
    assert (gap.after, gap.before, gap.n_missing) == (START + 120, START + 300, 5)
    assert report.chain_steps == Count(ok=N - 6)
    assert report.failures == ()
    # MACSEQ of the last subframe before the gap: its key was lost, but follows from a later one.
    assert report.tags.macseq == Count(ok=3 * (N - 6))
    assert [key.data for key in receiver.filled_keys()] == expected_keys()


def test_a_gap_of_hours() -> None:
    chain = make_chain(b"hours", START, 1500, chain_id=1)
    early = Broadcast(chain, n_subframes=4).pages()
    late = [
        page for svid in (2, 7, 11) for index in range(1400, 1403)
        for page in Broadcast(chain, n_subframes=0).subframe(svid, index)
    ]  # fmt: skip
    report = run([*early, *sorted(late, key=lambda page: page.time)], chain)
    assert [key.time for key in report.keys] == [START + 30 * k for k in (0, 1, 2, 3, 1400, 1401, 1402)]
    assert report.gaps[0].n_missing == 1396
    assert report.failures == ()


@pytest.mark.parametrize("bit", [0, 77, 127])
def test_a_key_that_does_not_chain_is_never_accepted(bit: int) -> None:
    def changed(_svid: int, index: int, key: bytes) -> bytes:
        return key if index != 6 else (int.from_bytes(key, "big") ^ 1 << bit).to_bytes(16, "big")

    report = run(Broadcast(CHAIN, n_subframes=N, key_of=changed).pages())
    assert [key.data for key in report.keys] == [key for k, key in enumerate(expected_keys()) if k != 6]
    assert report.chain_steps == Count(ok=N - 2, failed=1)
    with pytest.raises(AuthenticationError, match=r"E02, E07, E11: key of .* does not chain"):
        report.raise_if_failed()


def test_a_satellite_with_another_key_is_reported_and_the_others_are_believed() -> None:
    report = run(
        Broadcast(CHAIN, n_subframes=N, key_of=lambda svid, k, key: bytes(16) if (svid, k) == (7, 6) else key).pages()
    )
    assert [key.data for key in report.keys] == expected_keys()
    assert kinds(report) == {ProblemKind.KEY, ProblemKind.DISAGREEMENT}
    assert report.chain_steps == Count(ok=N - 1)
    with pytest.raises(AuthenticationError, match=r"E07: key of .* does not chain"):
        report.raise_if_failed()


def test_an_unknown_mac_look_up_table_costs_the_tags_and_not_the_keys() -> None:
    chain = chain_of(mac_lookup=99)
    report = run(Broadcast(chain, n_subframes=N).pages(), chain)
    assert [key.data for key in report.keys] == expected_keys(chain)
    assert report.tags.macseq.checked == 0
    assert report.failures == ()
    (problem,) = report.problems
    assert problem.kind is ProblemKind.IGNORED
    assert "MAC look-up table 99" in problem.text


def test_status_dont_use_withholds_keys() -> None:
    def header(svid: int, index: int, normal: int) -> int:
        return normal | 0xC0 if index >= 8 and svid == 7 else normal

    report = run(Broadcast(CHAIN, n_subframes=N, header_of=header).pages())
    assert [key.data for key in report.keys] == expected_keys()[:8]
    assert [key.data for key in report.withheld] == expected_keys()[8:]
    assert kinds(report) == {ProblemKind.STATUS}
    assert "don't use" in report.withheld[0].reason
    in_the_middle = Broadcast(
        CHAIN, n_subframes=N, header_of=lambda _s, k, normal: normal | 0xC0 if k in (6, 7) else normal
    )
    receiver = OsnmaReceiver((CHAIN.public_key,))
    for pages in (PAGES, in_the_middle.pages(), PAGES):  # said once it holds, whatever another recording says
        for page in pages:
            receiver.process(page)
        receiver.finish()
    usable = [key for k, key in enumerate(expected_keys()) if k not in (6, 7)]
    assert [key.data for key in receiver.report().keys] == usable
    assert [key.data for key in receiver.filled_keys()] == usable
    everywhere = run(Broadcast(CHAIN, n_subframes=N, header_of=lambda _s, _k, normal: normal | 0xC0).pages())
    assert everywhere.keys == ()
    with pytest.raises(AuthenticationError):
        everywhere.raise_if_failed()


def test_a_wrong_tag_and_a_wrong_macseq_are_found() -> None:
    pages = list(PAGES)
    place = next(k for k, page in enumerate(pages) if page.svid == 7 and page.time == START + 121)
    page = pages[place]
    pages[place] = make_page(7, page.time, page.word, page.osnma[:1] + bytes([page.osnma[1] ^ 1]) + page.osnma[2:])
    report = run(pages)
    assert report.tags.by_adkd[0].failed == 1
    assert [problem.kind for problem in report.problems] == [ProblemKind.TAG]
    assert "E07: tag 1 (ADKD 0 of E07, IODnav 5)" in report.problems[0].text
    # Page 1 carries bits 32-63 of the MACK: end of tag0, then MACSEQ. Without it nothing protects the flexible slot.
    pages = list(PAGES)
    place = next(k for k, page in enumerate(pages) if page.svid == 7 and page.time == START + 123)
    page = pages[place]
    pages[place] = make_page(7, page.time, page.word, page.osnma[:2] + bytes([page.osnma[2] ^ 0x80]) + page.osnma[3:])
    report = run(pages)
    assert report.tags.macseq.failed == 1
    assert [problem.kind for problem in report.problems] == [ProblemKind.MACSEQ, ProblemKind.TAG]
    assert "tag 2 is in a flexible slot" in report.problems[1].text
    assert report.failures == ()


def test_changed_navigation_data_fails_its_tags() -> None:
    pages = [
        make_page(page.svid, page.time, page.word ^ 1 << 60, page.osnma)
        if page.svid == 2 and page.word >> 122 == 1
        else page
        for page in PAGES
    ]
    report = run(pages)
    assert not any(data.svid == 2 and data.adkd == 0 for data in report.navigation)
    assert report.tags.by_adkd[0].failed > 0
    assert all("ADKD 4" not in problem.text for problem in report.problems)


def test_after_lost_pages_a_tag_on_newer_data_is_not_a_failure() -> None:
    """The data changes while word 5, which has no issue number, is lost: the cut-off point tells whether that is so."""
    failed, no_data = [], []
    for cut_off in (1, 2):
        broadcast = Broadcast(CHAIN, n_subframes=N, issue_of=lambda index: 5 if index < 6 else 6, cut_off=cut_off)
        lost = [
            page for page in broadcast.pages()
            if not (page.word >> 122 == 5 and START + 180 <= page.time < START + 210)
        ]  # fmt: skip
        tags = run(lost).tags
        failed.append(sum(count.failed for count in tags.by_adkd.values()))
        no_data.append(tags.no_data)
    # Subframe 7 has tags on the changed data; a cut-off of 2 would say that subframe 5 had the same.
    assert failed[0] == 0
    assert failed[1] > 0
    assert no_data[0] == no_data[1] + failed[1]


def test_a_broken_signature_or_root_key_leaves_nothing() -> None:
    for changed in (
        replace(CHAIN.kroot, signature=bytes([CHAIN.kroot.signature[0] ^ 1]) + CHAIN.kroot.signature[1:]),
        replace(CHAIN.kroot, root_key=bytes([CHAIN.kroot.root_key[0] ^ 1]) + CHAIN.kroot.root_key[1:]),
        replace(CHAIN.kroot, padding=bytes([CHAIN.kroot.padding[0] ^ 1]) + CHAIN.kroot.padding[1:]),
    ):
        report = run(Broadcast(CHAIN, n_subframes=9, dsm_of=lambda _svid, kroot=changed: kroot.serialise()).pages())
        assert report.keys == ()
        assert report.n_without_root == 3 * 9
        with pytest.raises(AuthenticationError, match=r"root key: DSM 3: the (signature|padding)"):
            report.raise_if_failed()


def test_one_satellite_with_a_false_root_key_does_not_stop_the_others() -> None:
    false = make_chain(b"forger", START, 1, chain_id=1, pkid=4).kroot.serialise()
    own = CHAIN.kroot.serialise()
    broadcast = Broadcast(CHAIN, n_subframes=N, dsm_of=lambda svid: false if svid == 7 else own)
    report = run(broadcast.pages())
    assert [key.data for key in report.keys] == expected_keys()
    assert {check.root is not None for check in report.roots} == {True, False}
    with pytest.raises(AuthenticationError, match="the signature does not verify"):
        report.raise_if_failed()


def test_a_root_key_of_another_public_key_is_not_used() -> None:
    other = PublicKey(pkid=9, point=CHAIN.public_key.point, trust=Trust.USER)
    report = OsnmaReceiver((other,)).process_all(PAGES)
    assert report.keys == ()
    with pytest.raises(AuthenticationError, match=r"no root key is verified: .*PKID 4, which was not given"):
        report.raise_if_failed()


def test_too_short_a_recording_says_what_is_missing() -> None:
    report = run([page for page in PAGES if page.time < START + 60])
    with pytest.raises(AuthenticationError, match=r"no complete DSM-KROOT was received \(DSM 3: 5 of 8 blocks\)"):
        report.raise_if_failed()
    empty = run([])
    assert (empty.first, empty.keys) == (None, ())
    with pytest.raises(AuthenticationError, match="no block"):
        empty.raise_if_failed()


def test_unsupported_root_key_is_named() -> None:
    data = bytearray(CHAIN.kroot.serialise())
    data[2] |= 0xF0  # key size 15
    report = run(Broadcast(CHAIN, n_subframes=9, dsm_of=lambda _svid: bytes(data)).pages())
    with pytest.raises(AuthenticationError, match=r"KS \(key size\) is 15"):
        report.raise_if_failed()


def test_a_new_root_key_of_the_same_chain_and_a_new_chain() -> None:
    hour = next(key for key in CHAIN.keys if key.time == GalileoTime(1400, 604_770))
    renewed = sign_kroot(
        replace(CHAIN.kroot, root_week=1401, root_hour=0, root_key=hour.data), CHAIN.header, CHAIN.private_key
    )
    first = Broadcast(CHAIN, n_subframes=7).pages()
    second = [
        page for page in Broadcast(CHAIN, n_subframes=N, dsm_id=4, dsm_of=lambda _svid: renewed.serialise()).pages()
        if page.time >= START + 7 * 30
    ]  # fmt: skip
    report = run([*first, *second])
    assert [check.on_known_chain for check in report.roots] == [False, True]
    assert [key.data for key in report.keys] == expected_keys()

    next_chain = make_chain(b"next", START + N * 30, 8, chain_id=2, pkid=5)
    third = Broadcast(next_chain, n_subframes=8).pages()
    report = OsnmaReceiver((CHAIN.public_key, next_chain.public_key)).process_all([*first, *second, *third])
    assert [key.chain_id for key in report.keys] == [1] * N + [2] * 8
    assert report.failures == ()


def test_broadcast_public_keys_that_are_not_used() -> None:
    """One is older than a key that was given, one leads to another root, one cannot be verified."""
    older = make_chain(b"older", START, 1, pkid=5)
    claim = older.tree.public_keys[0]
    siblings = b"".join(older.tree.nodes[height, (5 >> height) ^ 1] for height in range(4))
    data = (bytes([7 << 4 | 5]) + siblings + bytes([1 << 4 | 5]) + claim.point).ljust(13 * 13, b"\0")
    pages = Broadcast(CHAIN, n_subframes=N, dsm_id=13, dsm_of=lambda _svid: data).pages()
    newer = make_chain(b"newer", START, 1, pkid=9).public_key
    for known, tree, words in (
        ((CHAIN.public_key, newer), older.tree, "comes before PKID 9, which is in use"),
        ((CHAIN.public_key,), MerkleTree(nodes={(4, 0): bytes(32)}), "not the trusted 0000"),
        ((CHAIN.public_key,), None, "no Merkle tree was given to verify it"),
    ):
        report = OsnmaReceiver(known, tree).process_all(pages)
        assert any(words in problem.text for problem in report.problems)
        assert {problem.kind for problem in report.problems} == {ProblemKind.IGNORED}
    for known in ((CHAIN.public_key,), (CHAIN.public_key, older.public_key, newer)):  # newer than those, and in use
        assert OsnmaReceiver(known, older.tree).process_all(pages).problems == ()


def test_a_recording_with_shifted_clock_is_noticed_and_not_believed() -> None:
    shifted = [replace(page, time=page.time + 60) for page in PAGES]
    report = run(shifted)
    assert report.keys == ()
    assert report.time_stamps.ok == 0
    assert {ProblemKind.KEY, ProblemKind.TIME} == kinds(report)


def test_strange_pages_are_counted() -> None:
    alert = make_page(7, START + 1, 0, bytes(5), alert=True)
    twice = PAGES[0]
    contradiction = make_page(PAGES[0].svid, PAGES[0].time, 5, bytes(5))
    report = run([alert, PAGES[0], twice, contradiction, *PAGES[1:], PAGES[0]])
    assert report.n_alert_pages == 1
    assert report.pages[PageStatus.DUPLICATE] == 1
    assert report.pages[PageStatus.CONTRADICTION] == 1
    assert report.pages[PageStatus.LATE] == 1
    assert kinds(report) == {ProblemKind.PAGE}
    assert [key.data for key in report.keys] == expected_keys()


@settings(max_examples=25)
@given(st.data())
def test_changed_pages_never_give_another_key(data: st.DataObject) -> None:
    """Any bits of any pages changed, with the checksum made good again."""
    pages = list(PAGES[: 45 * 6])
    for _ in range(data.draw(st.integers(1, 40))):
        place = data.draw(st.integers(0, len(pages) - 1))
        page = pages[place]
        osnma = bytes(a ^ b for a, b in zip(page.osnma, data.draw(st.binary(min_size=5, max_size=5)), strict=True))
        pages[place] = make_page(page.svid, page.time, page.word ^ data.draw(st.integers(0, 2**128 - 1)), osnma)
    report = run(pages)
    true = {START + 30 * k: key for k, key in enumerate(expected_keys())}
    assert all(true[key.time] == key.data for key in report.keys)
    assert all(check.root is None or check.root.data == CHAIN.kroot.root_key for check in report.roots)
