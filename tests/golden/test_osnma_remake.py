"""The operator's encoders make the received bits again from the contents of real OSNMA messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from vestige.crypto.keys.public_key_file import load_public_keys
from vestige.crypto.osnma.messages.dsm import DSM_BLOCK_BYTES, NmaHeader, parse_kroot
from vestige.crypto.osnma.messages.mac_lookup import slots
from vestige.crypto.osnma.messages.navigation_data import NavigationWords
from vestige.crypto.osnma.messages.subframe import Content, Epoch, SatelliteSubframe, SubframeAssembler
from vestige.crypto.osnma.messages.tags import Mack, make_macseq, parse_mack
from vestige.crypto.osnma.messages.tesla import Chain
from vestige.crypto.osnma.operator.hkroot import SignedMessage, block_index, hkroot_message
from vestige.crypto.osnma.operator.mack import TagContent, authenticate, encode_mack
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.errors import AuthenticationError
from vestige.recording.navigation.navigation_pages import read_pages
from vestige.time import GalileoTime

VECTOR = ("test_vector_configuration_1_2023-08-16T0500.csv", "test_vector_configuration_1_{}.xml")
RECORDED = ("recorded_2025-12-12.sbf", "recorded_2025-12-12_{}.xml")


class Received:
    """All subframes of a file, its chain with all keys, and its DSMs by id and block."""

    def __init__(self, folder: Path, name: str, files: str) -> None:
        keys = load_public_keys(folder / files.format("public_key"), folder / files.format("merkle_tree"))
        receiver, assembler = OsnmaReceiver(keys), SubframeAssembler()
        self.epochs: list[Epoch] = []
        for page in read_pages(folder / name):
            receiver.process(page)
            if page.crc_ok:
                self.epochs += assembler.add(page)[1]
        receiver.finish()
        self.epochs += assembler.flush()
        self.chain: Chain = receiver.chains[0]
        report = receiver.report()
        self.roots = report.roots
        self.n_messages = report.tags.macseq.ok

    def complete(self) -> Iterator[tuple[SatelliteSubframe, Mapping[int, NavigationWords]]]:
        """The complete OSNMA messages with the navigation words of before."""
        navigation: dict[int, NavigationWords] = {}
        for epoch in self.epochs:
            before = dict(navigation)
            for svid, subframe in epoch.satellites.items():
                navigation[svid] = navigation.get(svid, NavigationWords()).updated(subframe)
                if subframe.content is Content.OSNMA and subframe.hkroot is not None:
                    yield subframe, before

    def key(self, time: GalileoTime) -> bytes | None:
        try:
            return self.chain.derive(time).data
        except AuthenticationError:
            return None


@pytest.fixture(scope="module", params=[VECTOR, RECORDED], ids=["vector", "recorded"])
def received(request: pytest.FixtureRequest, osnma_data: Path) -> Received:
    return Received(osnma_data, *request.param)


def test_every_hkroot_and_every_mack_is_remade(received: Received) -> None:
    messages = {root.dsm_id: root.kroot.serialise() for root in received.roots if root.kroot is not None}
    n_remade = 0
    for subframe, _ in received.complete():
        hkroot = subframe.hkroot
        assert hkroot is not None
        message = SignedMessage(dsm_id=hkroot[1] >> 4, data=messages[hkroot[1] >> 4])
        assert hkroot_message(NmaHeader(hkroot[0]), message, hkroot[1] & 15) == hkroot
        mack = parse_mack(subframe, received.chain.parameters)
        key = received.key(subframe.time)
        bits = subframe.mack_bits(0, 480)
        assert mack is not None
        assert key is not None
        assert bits is not None
        assert encode_mack(mack, key, received.chain.parameters) == bits.to_bytes(60, "big")
        n_remade += 1
    assert n_remade >= received.n_messages


def test_every_root_key_message_is_remade(received: Received) -> None:
    for root in received.roots:
        assert root.kroot is not None
        data = root.kroot.serialise()
        assert parse_kroot(data) == root.kroot
        assert len(data) == root.kroot.n_blocks * DSM_BLOCK_BYTES
        assert root.kroot.expected_padding(root.header) == root.kroot.padding


@pytest.mark.judged(
    by="official test vectors",
    what="OSNMA encoder of the simulated operator",
    figure="every MACSEQ and tag, bit for bit",
)
def test_every_macseq_and_every_tag_is_remade(received: Received) -> None:
    """Tags whose data or key was not received are left out; so are messages with a dummy."""
    counts: Counter[str] = Counter()
    parameters = received.chain.parameters
    for subframe, navigation in received.complete():
        mack = parse_mack(subframe, parameters)
        assert mack is not None
        key = received.key(subframe.time + 30)
        if key is None:
            continue
        assert make_macseq(mack, slots(parameters, mack.time), key, parameters) == mack.macseq
        counts["MACSEQ"] += 1
        contents = contents_of(mack, navigation)
        if contents is None or received.key(subframe.time + 330) is None:
            continue
        remade = authenticate(
            mack.svid, mack.time, mack.nma_status, contents, lambda t: received.key(t) or b"", parameters
        )
        counts["message"] += 1
        counts["the same"] += remade == mack
    assert counts["MACSEQ"] == received.n_messages
    assert counts["the same"] == counts["message"] > 170


def contents_of(mack: Mack, navigation: Mapping[int, NavigationWords]) -> list[TagContent] | None:
    """What the tags of a message are for, as they say themselves; None if one is a dummy or its data is not known."""
    contents = []
    for tag in mack.tags:
        data = navigation.get(tag.svid, NavigationWords()).data(tag.svid, tag.adkd, mack.time)
        if data is None or not tag.cut_off or data.oldest_s < mack.time.gst_seconds - 30 * tag.cut_off:
            return None
        contents.append(TagContent(svid=tag.svid, adkd=tag.adkd, cut_off=tag.cut_off, data=data))
    return contents


def test_the_official_vector_staggers_blocks_as_the_operator_does(osnma_data: Path) -> None:
    received = Received(osnma_data, *VECTOR)
    n_same = 0
    for subframe, _ in received.complete():
        assert subframe.hkroot is not None
        assert subframe.hkroot[1] & 15 == block_index(subframe.svid, subframe.time, 8)
        n_same += 1
    assert n_same == 2171
