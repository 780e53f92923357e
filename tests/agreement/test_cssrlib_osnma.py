"""An independent OSNMA program, cssrlib, verifies what the operator broadcasts: root signature, keys and every tag."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from operator_sky import SVIDS, OperatorSky
from osnma_builder import make_page
from vestige.crypto.keys.public_key import compressed_point
from vestige.crypto.keys.public_key_writer import write_merkle_tree
from vestige.crypto.osnma.messages.mac_lookup import MAC_LOOKUP
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.events import OsnmaEvent, OsnmaEventKind
from vestige.crypto.osnma.operator.key_tree import draw_key_tree
from vestige.crypto.osnma.operator.signed_messages import alert_dsm, public_key_dsm
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

cssrlib_osnma = pytest.importorskip("cssrlib.osnma", reason="cssrlib is not installed: make judges")

START = GalileoTime(1400, 7200)  # not the first hour of the week: cssrlib does not take a root key of TOWH 0
N = 14
WEEKS_GPS_GST = 1024
Tag = tuple[int, int, int, int]  # start of the subframe mod 2^20, PRN_A, CTR, ADKD


class Judge:
    """cssrlib with our Merkle tree; what it says of each tag."""

    def __init__(self, tree: Path | None, log: Path) -> None:
        self.program: Any = cssrlib_osnma.osnma(logfile=str(log))
        self.program.monlevel = 0
        self.program.flg_slowmac = True
        # cssrlib keeps these in the class, so one instance would see what another one received.
        self.program.dsm, self.program.nb = {}, {}
        self.program.hk = [bytearray(15) for _ in range(36)]
        self.program.mack = [bytearray(60) for _ in range(36)]
        self.program.mack_p, self.program.mack_c = bytearray(60 * 36), bytearray(60 * 36)
        if tree is not None:
            self.program.load_mt(str(tree))
        self.tags: dict[Tag, bool] = {}
        self.macseqs: list[bool] = []
        self._wrap()

    def _wrap(self) -> None:
        verify_tag, verify_macseq = self.program.verify_navmsg, self.program.verify_macseq

        def tag(one: Any) -> bool:
            result = bool(verify_tag(one))
            start = int.from_bytes(one.gst_sf, "big") & 0xFFFFF
            if one.navmsg and one.cop:
                self.tags[start, one.prn_a, one.cnt, one.adkd] = result
            return result

        def macseq() -> bool:
            self.macseqs.append(bool(verify_macseq()))
            return self.macseqs[-1]

        self.program.verify_navmsg, self.program.verify_macseq = tag, macseq

    def take(self, pages: list[InavPage]) -> Judge:
        for page in pages:
            nav, nma = self.program.load_gal_inav(bytearray(page.data))
            self.program.prn_a = page.svid
            self.program.save_gal_inav(nav, page.svid, page.time.second)
            self.program.decode(nma, page.time.week + WEEKS_GPS_GST, page.time.second, page.svid)
        self.program.fh.close()
        return self

    @property
    def root_verified(self) -> bool:
        return bool(self.program.status & cssrlib_osnma.uOSNMA.ROOTKEY_VERIFIED)

    @property
    def chain_verified(self) -> bool:
        return bool(self.program.status & cssrlib_osnma.uOSNMA.KEYCHAIN_VERIFIED)


@cache
def sky(mac_lookup: int = 34) -> tuple[OperatorSky, list[InavPage]]:
    configuration = OperatorConfiguration(seed=b"judge", start=START, n_subframes=N, mac_lookup=mac_lookup)
    one = OperatorSky(configuration)
    return one, one.pages()


def judged(folder: Path, pages: list[InavPage], mac_lookup: int = 34) -> Judge:
    tree = folder / "tree.xml"
    write_merkle_tree(tree, sky(mac_lookup)[0].operator.merkle_tree)
    return Judge(tree, folder / "log.txt").take(pages)


@pytest.mark.judged(
    by="cssrlib",
    what="OSNMA that vestige broadcasts: root key, keys and tags",
    figure="all verify, for MACLT 33, 34 and 35",
)
@pytest.mark.parametrize("mac_lookup", [33, 34, 35])
def test_root_key_and_every_tag_verify(tmp_path: Path, mac_lookup: int) -> None:
    judge = judged(tmp_path, sky(mac_lookup)[1], mac_lookup)
    assert judge.root_verified
    assert judge.chain_verified
    assert all(judge.macseqs)
    assert all(judge.tags.values())
    # The tags of the first subframe are dummies; the last subframe has no key, the last eleven none for ADKD 12.
    rows = MAC_LOOKUP[mac_lookup]
    expected = {
        (START.second + 30 * k, svid, number, 0 if slot.flexible else slot.adkd)
        for k in range(1, N)
        for svid in SVIDS
        for number, slot in enumerate(rows[k % 2], start=1)
        if k <= (N - 12 if slot.adkd == 12 else N - 2)
    }
    assert set(judge.tags) == expected


def flip(
    pages: list[InavPage], where: Callable[[InavPage], bool], bit: int, word_bit: int | None = None
) -> list[InavPage]:
    """The pages with a bit of the OSNMA field, or of the word, flipped in some of them."""
    changed = []
    for page in pages:
        if not where(page):
            changed.append(page)
        elif word_bit is not None:
            changed.append(make_page(page.svid, page.time, page.word ^ 1 << 127 - word_bit, page.osnma))
        else:
            osnma = (int.from_bytes(page.osnma, "big") ^ 1 << 39 - bit).to_bytes(5, "big")
            changed.append(make_page(page.svid, page.time, page.word, osnma))
    return changed


@pytest.mark.judged(by="cssrlib", what="a forged tag", figure="refused, and no other tag")
@pytest.mark.parametrize("number", range(6))
def test_a_flipped_tag_is_refused(tmp_path: Path, number: int) -> None:
    random = np.random.default_rng(number)
    bit = 56 * number + int(random.integers(40))
    place = START + (30 + 1 + 2 * (bit // 32))
    pages = flip(sky()[1], lambda page: (page.svid, page.time) == (7, place), 8 + bit % 32)
    judge = judged(tmp_path, pages)
    assert [tag[:3] for tag, ok in judge.tags.items() if not ok] == [(START.second + 30, 7, number + 1)]


@pytest.mark.parametrize("byte", [0, 3, 9, 14, 40, 80, 100])
def test_a_flipped_root_key_message_is_refused(tmp_path: Path, byte: int) -> None:
    """Head, alpha, root key, signature and padding, one bit each, wherever it is sent."""
    block, place = divmod(byte, 13)

    def where(page: InavPage) -> bool:
        number = (page.time.gst_seconds // 30 + page.svid) % 8
        return number == block and page.time.second % 30 == 1 + 2 * (place + 2)

    judge = judged(tmp_path, flip(sky()[1], where, byte % 8))
    assert not judge.root_verified
    assert judge.tags == {}


def test_a_flipped_key_is_refused(tmp_path: Path) -> None:
    """From the first subframe on the last bit of each key is wrong."""
    judge = judged(tmp_path, flip(sky()[1], lambda page: page.time.second % 30 == 29, 23))
    assert judge.root_verified
    assert not judge.chain_verified
    assert judge.tags == {}


@pytest.mark.parametrize(("kind", "bit"), [(1, 20), (2, 125), (3, 127), (4, 90), (5, 72), (6, 104), (10, 86)])
def test_flipped_navigation_data_is_refused(tmp_path: Path, kind: int, bit: int) -> None:
    pages = flip(sky()[1], lambda page: page.svid == 7 and page.word >> 122 == kind, 0, word_bit=bit)
    judge = judged(tmp_path, pages)
    assert judge.root_verified
    refused = {tag for tag, ok in judge.tags.items() if not ok}
    adkds = {tag[3] for tag in refused}
    assert adkds == ({4} if kind in (6, 10) else {0, 12})
    own = {tag for tag in judge.tags if tag[1] == 7 and (tag[2] == 1 if kind < 6 else tag[3] == 4)}
    assert own
    assert own <= refused


def takes_public_key(data: bytes, root: bytes, folder: Path) -> bool:
    """Whether cssrlib takes a DSM-PKR."""
    program = Judge(None, folder / "log.txt").program
    program.fh.close()
    program.hf, program.root_mt, program.dsm = 0, root, {12: bytearray(data)}
    return bool(program.decode_dsm_pkr(12))


def flipped(data: bytes, bit: int) -> bytes:
    return (int.from_bytes(data, "big") ^ 1 << 8 * len(data) - 1 - bit).to_bytes(len(data), "big")


def test_public_keys_and_alert_messages_lead_to_the_root(tmp_path: Path) -> None:
    notice = b"ask the operator"
    keys = draw_key_tree(b"tree", notice)
    root = keys.published(()).root
    messages = [
        public_key_dsm(keys.claim(pkid).point, pkid, pkid - 1, keys.siblings(pkid - 1), root) for pkid in range(1, 16)
    ]
    messages.append(alert_dsm(notice, 15, keys.siblings(15)))
    for data in messages:
        assert len(data) == 13 * 13
        assert takes_public_key(data, root, tmp_path)
        for bit in range(4, 8 * len(data), 97):
            assert not takes_public_key(flipped(data, bit), root, tmp_path)


@pytest.mark.judged(
    by="cssrlib",
    what="DSM-PKR that vestige broadcasts",
    figure="public key 2 is taken from the signal",
)
def test_a_new_public_key_is_taken_from_the_signal(tmp_path: Path) -> None:
    """cssrlib knows PKID 1 alone. It takes PKID 2 from the DSM-PKR and goes on verifying every tag."""
    event = OsnmaEvent(
        kind=OsnmaEventKind.KEY_RENEWAL, announced=START + 60, in_force=START + 30 * 30, ended=START + 32 * 30
    )
    one = OperatorSky(OperatorConfiguration(seed=b"judge", start=START, n_subframes=34, events=(event,)))
    tree = tmp_path / "tree.xml"
    write_merkle_tree(tree, one.operator.keys.published((1,)))
    judge = Judge(tree, tmp_path / "log.txt").take(one.pages())
    points = {pkid: compressed_point(key) for pkid, key in judge.program.pk_list.items()}
    assert points == {pkid: one.operator.keys.claim(pkid).point for pkid in (1, 2)}
    assert judge.program.pkid == 2
    assert judge.program.verify_root_key()
    assert all(judge.tags.values())
    assert all(judge.macseqs)
    assert {tag[0] for tag in judge.tags} == {START.second + 30 * k for k in range(1, 33)}
