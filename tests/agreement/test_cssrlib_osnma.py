"""An independent OSNMA program, cssrlib, verifies what the operator broadcasts: root signature, keys and every tag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cssrlib_judge import Judge, Tag, cssrlib_osnma
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

START = GalileoTime(1400, 7200)  # not the first hour of the week: cssrlib does not take a root key of TOWH 0
N = 14


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


def spoiled(
    pages: list[InavPage],
    *,
    osnma: Callable[[InavPage], int] = lambda _: 0,
    word: Callable[[InavPage], int] = lambda _: 0,
) -> list[InavPage]:
    """Return the pages with the bits flipped that a mask of their OSNMA field, or of their word, has."""
    changed = []
    for page in pages:
        masks = osnma(page), word(page)
        field = (int.from_bytes(page.osnma, "big") ^ masks[0]).to_bytes(5, "big")
        changed.append(make_page(page.svid, page.time, page.word ^ masks[1], field) if any(masks) else page)
    return changed


def verified(judge: Judge) -> set[Tag]:
    return {tag for tag, ok in judge.tags.items() if ok}


@pytest.mark.judged(
    by="cssrlib", what="a forged tag", figure="refused with each of its 40 bits wrong; no other tag is refused"
)
def test_any_flipped_bit_of_a_tag_is_refused(tmp_path: Path) -> None:
    """Half of all tags have one bit flipped, each bit of a tag several times."""
    clean = judged(tmp_path, sky()[1])
    forged = [tag for tag in sorted(clean.tags) if np.random.default_rng(tag).random() < 0.5]
    masks: Counter[tuple[int, int]] = Counter()
    for number, (start, svid, counter, _) in enumerate(forged):
        place, bit = divmod(56 * (counter - 1) + number % 40, 32)
        masks[svid, start + 1 + 2 * place] += 1 << 31 - bit
    judge = judged(tmp_path, spoiled(sky()[1], osnma=lambda page: masks[page.svid, page.time.second]))
    assert len(forged) > 5 * 40
    assert {adkd for *_, adkd in forged} == {0, 4, 12}
    assert judge.tags.keys() == clean.tags.keys()
    assert verified(judge) == verified(clean) - set(forged)


@pytest.mark.parametrize("byte", [0, 3, 9, 14, 40, 80, 100])
def test_a_flipped_root_key_message_is_refused(tmp_path: Path, byte: int) -> None:
    """Head, alpha, root key, signature and padding, one bit each, wherever it is sent."""
    block, place = divmod(byte, 13)

    def mask(page: InavPage) -> int:
        number = (page.time.gst_seconds // 30 + page.svid) % 8
        here = number == block and page.time.second % 30 == 1 + 2 * (place + 2)
        return 1 << 39 - byte % 8 if here else 0

    judge = judged(tmp_path, spoiled(sky()[1], osnma=mask))
    assert not judge.root_verified
    assert judge.tags == {}


@pytest.mark.judged(
    by="cssrlib", what="a forged root key", figure="refused with each of the 832 bits of its message wrong"
)
def test_any_flipped_bit_of_the_root_key_message_is_refused(tmp_path: Path) -> None:
    """The padding refuses every bit. Without it the signature refuses every bit of itself and of what it signs."""
    program = judged(tmp_path, sky()[1]).program
    number = program.did0
    message = bytes(program.dsm[number][: 13 * 8])

    def takes(data: bytes) -> bool:
        program.dsm[number], program.status = bytearray(data.ljust(250, b"\0")), 0  # as long as its buffer
        try:
            return bool(program.decode_dsm_kroot(number)) and bool(program.verify_root_key())
        except LookupError:  # cssrlib ends so at a hash function or a length that the ICD does not have
            return False

    def signature_is_good(data: bytes, header: int) -> bool:
        program.dsm[number], program.nma_header = bytearray(data), header
        program.ds = data[29:93]
        return bool(program.verify_root_key())

    assert takes(message)
    assert 8 * len(message) == 832
    assert [bit for bit in range(832) if takes(flipped(message, bit))] == []
    header = program.nma_header
    assert takes(message)  # which sets the state that the last bit changed
    assert signature_is_good(message, header)
    # The first octet, number of blocks and of the key, is not signed; the NMA header is.
    assert [bit for bit in range(8, 8 * 93) if signature_is_good(flipped(message, bit), header)] == []
    assert [bit for bit in range(8) if signature_is_good(message, header ^ 1 << bit)] == []


def test_a_flipped_key_is_refused(tmp_path: Path) -> None:
    """From the first subframe on the last bit of each key is wrong."""
    judge = judged(tmp_path, spoiled(sky()[1], osnma=lambda page: (page.time.second % 30 == 29) << 16))
    assert judge.root_verified
    assert not judge.chain_verified
    assert judge.tags == {}


@pytest.mark.judged(by="cssrlib", what="a forged key", figure="refused with each of its 128 bits wrong")
@pytest.mark.parametrize("known", ["the root key", "the key before"])
def test_any_flipped_bit_of_a_key_is_refused(tmp_path: Path, known: str) -> None:
    program = judged(tmp_path, sky()[1]).program
    key = bytes(program.key_c)
    verified_chain = cssrlib_osnma.uOSNMA.KEYCHAIN_VERIFIED

    def takes(data: bytes) -> bool:
        program.status &= ~verified_chain
        if known == "the key before":
            program.status |= verified_chain
        return bool(program.verify_key_chain(data, START.week, program.gst_tow))

    assert 8 * len(key) == 128
    assert takes(key)
    assert [bit for bit in range(128) if takes(flipped(key, bit))] == []


# First and last bit of each word that tags of an ADKD cover [OSNMA-ICD]
COVERED = {
    0: ((1, 6, 126), (2, 6, 126), (3, 6, 128), (4, 6, 126), (5, 6, 73)),
    4: ((6, 6, 105), (10, 86, 128)),
}


@pytest.mark.judged(
    by="cssrlib", what="forged navigation data", figure="refused with each of its 549 and 141 bits wrong"
)
@pytest.mark.parametrize(("adkd", "n_bits"), [(0, 549), (4, 141)])
def test_any_flipped_bit_of_navigation_data_is_refused(tmp_path: Path, adkd: int, n_bits: int) -> None:
    """Half of the satellites have one bit of their words flipped in a subframe, the other half in the next one.

    Tags of ADKD 12 cover the same data as those of ADKD 0. Those of ADKD 4 are sent once a minute, and cover the words
    of the subframe before.
    """
    clean = judged(tmp_path, sky()[1])
    bits = [(kind, bit) for kind, first, end in COVERED[adkd] for bit in range(first, end)]
    assert len(bits) == n_bits
    places = [
        (svid, subframe)
        for subframe in range(N - 2)
        for column, svid in enumerate(SVIDS)
        if (subframe % 2 == 1 and column // 2 % 2 == subframe // 2 % 2 if adkd else column % 2 == subframe % 2)
    ]
    for first in range(0, n_bits, len(places)):
        flips = dict(zip(places, bits[first : first + len(places)], strict=False))

        def mask(page: InavPage, flips: dict[tuple[int, int], tuple[int, int]] = flips) -> int:
            kind, bit = flips.get((page.svid, (page.time.second - START.second) // 30), (-1, 0))
            return 1 << 127 - bit if page.word >> 122 == kind else 0

        judge = judged(tmp_path, spoiled(sky()[1], word=mask))
        refused = {
            tag
            for tag, svid in clean.covered.items()
            if (svid, (tag[0] - START.second) // 30 - 1) in flips and (tag[3] == 4) == (adkd == 4)
        }
        assert judge.root_verified
        assert {(clean.covered[tag], (tag[0] - START.second) // 30 - 1) for tag in refused} == flips.keys()
        assert verified(judge) == verified(clean) - refused


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
    for bit in range(8 * len(root)):
        assert not takes_public_key(messages[0], flipped(root, bit), tmp_path)


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
