"""Each event gives our receiver the outcome that the OSNMA SIS ICD and the receiver guidelines prescribe."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest
from click.testing import CliRunner

from operator_sky import OperatorSky
from page_files import inav_block
from vestige.cli.services.osnma import command as osnma
from vestige.crypto.keys.key_file import read_key_file, write_key_file
from vestige.crypto.keys.merkle_tree import HEIGHT, MerkleTree
from vestige.crypto.osnma.messages.dsm import NmaHeader
from vestige.crypto.osnma.messages.subframe import Content
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.events import OsnmaEvent, OsnmaEventKind
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import OsnmaReport, ProblemKind
from vestige.errors import AuthenticationError, InputFileError, VestigeError
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

HOUR = GalileoTime(1400, 10_800)
START = HOUR + -40 * 30
N = 70
STEP_1, STEP_2, STEP_3 = 20, 44, 56  # subframes


def at(index: int) -> GalileoTime:
    return START + 30 * index


def event_of(kind: OsnmaEventKind) -> OsnmaEvent:
    no_step_2 = kind in (OsnmaEventKind.ALERT, OsnmaEventKind.DONT_USE, OsnmaEventKind.SILENCE)
    return OsnmaEvent(
        kind=kind,
        announced=at(STEP_1),
        in_force=None if no_step_2 else at(STEP_2),
        ended=None if kind is OsnmaEventKind.CHAIN_RENEWAL else at(STEP_2 if no_step_2 else STEP_3),
    )


@cache
def scene(kind: OsnmaEventKind) -> tuple[OperatorSky, list[InavPage], OsnmaReport]:
    sky = OperatorSky(OperatorConfiguration(seed=b"events", start=START, n_subframes=N, events=(event_of(kind),)))
    pages = sky.pages()
    return sky, pages, OsnmaReceiver(sky.operator.public_keys, sky.operator.merkle_tree).process_all(pages)


def keys_by_chain(report: OsnmaReport) -> dict[int, list[int]]:
    """Numbers of the subframes whose keys are validated, by CID."""
    found: dict[int, list[int]] = {}
    for key in report.keys:
        found.setdefault(key.chain_id, []).append(round(key.time - START) // 30)
    return found


def withheld(report: OsnmaReport) -> list[int]:
    return [round(key.time - START) // 30 for key in report.withheld]


def headers(sky: OperatorSky) -> list[tuple[int, int, int]]:
    """NMAS, CID and CPKS in the steps of the event, and before it."""
    values = [sky.operator.header_at(at(k)) for k in (0, STEP_1, STEP_2 - 1, STEP_2, STEP_3 - 1, STEP_3, N - 1)]
    return [(header.status, header.chain_id, header.key_status) for header in values]


def no_tag_failed(report: OsnmaReport) -> bool:
    return report.tags.macseq.failed == 0 and all(count.failed == 0 for count in report.tags.by_adkd.values())


def pkids(report: OsnmaReport) -> list[int | None]:
    return [root.public_key.pkid for root in report.verified_roots]


def root_alone(tree: MerkleTree) -> MerkleTree:
    """The trust anchor and nothing else."""
    return MerkleTree(nodes={(HEIGHT, 0): tree.root})


NOMINAL = (2, 1, 1)


def test_chain_renewal() -> None:
    sky, _, report = scene(OsnmaEventKind.CHAIN_RENEWAL)
    assert headers(sky) == [NOMINAL, (2, 1, 2), (2, 1, 2), (2, 2, 1), (2, 2, 1), (2, 2, 1), (2, 2, 1)]
    assert (report.failures, report.withheld, report.gaps, report.problems) == ((), (), (), ())
    assert keys_by_chain(report) == {1: list(range(STEP_2)), 2: list(range(STEP_2, N))}
    assert no_tag_failed(report)
    # The root key of the next chain is verified before it is in force, and so is that of the chain in force.
    announced = {root.chain_id for root in report.verified_roots if root.header.key_status == 2}
    assert announced == {1, 2}
    assert min(r.received_at for r in report.verified_roots if r.chain_id == 2) < at(STEP_2)
    assert [key.data for key in report.keys] == [key.data for key in sky.operator.validated_keys()]


def test_chain_revocation() -> None:
    sky, _, report = scene(OsnmaEventKind.CHAIN_REVOCATION)
    assert headers(sky) == [NOMINAL, (3, 1, 3), (3, 1, 3), (2, 2, 3), (2, 2, 3), (2, 2, 1), (2, 2, 1)]
    assert keys_by_chain(report) == {1: list(range(STEP_1)), 2: list(range(STEP_2, N))}
    assert withheld(report) == list(range(STEP_1, STEP_2))
    assert (report.failures, no_tag_failed(report)) == ((), True)
    assert {problem.kind for problem in report.problems} == {ProblemKind.STATUS}


def test_key_renewal() -> None:
    sky, pages, report = scene(OsnmaEventKind.KEY_RENEWAL)
    assert headers(sky) == [NOMINAL, (2, 1, 4), (2, 1, 4), (2, 1, 4), (2, 1, 4), NOMINAL, NOMINAL]
    assert keys_by_chain(report) == {1: list(range(N))}
    assert (report.failures, report.withheld, no_tag_failed(report)) == ((), (), True)
    assert pkids(report) == sorted(number for number in pkids(report) if number)
    assert set(pkids(report)) == {1, 2}
    signed = [root.received_at for root in report.verified_roots if root.public_key.pkid == 2]
    assert min(signed) == at(STEP_2)
    assert report.problems == ()
    # A receiver that has only the old key takes the new one out of the DSM-PKR, which leads to its tree's root.
    old = OsnmaReceiver(sky.operator.public_keys[:1], root_alone(sky.operator.merkle_tree)).process_all(pages)
    assert (old.keys, old.verified_roots, old.problems) == (report.keys, report.verified_roots, ())
    assert [key.pkid for key in old.broadcast_keys] == [2]
    assert report.broadcast_keys == ()
    # Without a tree it keeps its chain, with the old key.
    old = OsnmaReceiver(sky.operator.public_keys[:1]).process_all(pages)
    assert len(old.keys) == N
    assert set(pkids(old)) == {1}
    assert any("no Merkle tree was given to verify it" in problem.text for problem in old.problems)


def test_a_broadcast_key_opens_root_keys_that_came_before_it() -> None:
    sky, pages, _ = scene(OsnmaEventKind.KEY_RENEWAL)
    refused_first = 0
    for first in range(STEP_2, STEP_2 + 4):
        late = [page for page in pages if page.time >= at(first)]
        report = OsnmaReceiver(sky.operator.public_keys[:1], sky.operator.merkle_tree).process_all(late)
        assert set(pkids(report)) == {2}
        assert len(report.keys) == N - first
        refused_first += any("PKID 2, which was not given" in problem.text for problem in report.problems)
        assert all(check.root is not None for check in report.roots)
    assert refused_first > 0


def test_a_key_file_holds_the_broadcast_key(tmp_path: Path) -> None:
    sky, pages, _ = scene(OsnmaEventKind.KEY_REVOCATION)
    given, tree = sky.operator.public_keys[:1], root_alone(sky.operator.merkle_tree)
    report = OsnmaReceiver(given, tree).process_all(pages)
    path = tmp_path / "keys.csv"
    write_key_file(path, report.keys, report.verified_roots)
    assert read_key_file(path, given, tree) == report.keys
    lines = path.read_text().splitlines()
    assert [number for number, line in enumerate(lines) if line.startswith("# public key,")] == [1]
    with pytest.raises(AuthenticationError, match=r"keys.csv: line 2: .* only the Merkle tree can verify it"):
        read_key_file(path, given)
    place = lines[1].index(",") + 200
    path.write_text("\n".join([lines[0], lines[1][:place] + "xy" + lines[1][place + 2 :], *lines[2:], ""]))
    with pytest.raises(InputFileError, match=r"line 2, public key: found .*, expected a DSM-PKR in hexadecimal"):
        read_key_file(path, given, tree)
    digit = f"{int(lines[1][place], 16) ^ 1:x}"
    path.write_text("\n".join([lines[0], lines[1][:place] + digit + lines[1][place + 1 :], *lines[2:], ""]))
    with pytest.raises(AuthenticationError, match=r"keys.csv: line 2: Merkle tree: .* gives the root"):
        read_key_file(path, given, tree)


def test_key_revocation() -> None:
    sky, pages, report = scene(OsnmaEventKind.KEY_REVOCATION)
    assert headers(sky) == [NOMINAL, (3, 1, 5), (3, 1, 5), (2, 2, 5), (2, 2, 5), (2, 2, 1), (2, 2, 1)]
    assert keys_by_chain(report) == {1: list(range(STEP_1)), 2: list(range(STEP_2, N))}
    assert withheld(report) == list(range(STEP_1, STEP_2))
    assert (report.failures, no_tag_failed(report)) == ((), True)
    assert pkids(report)[0] == 1
    assert set(pkids(report)[1:]) == {2}
    # A receiver that has only the old key and the tree takes the new key out of the DSM-PKR, and withholds the same.
    old = OsnmaReceiver(sky.operator.public_keys[:1], root_alone(sky.operator.merkle_tree)).process_all(pages)
    assert (old.keys, withheld(old), old.verified_roots) == (report.keys, withheld(report), report.verified_roots)
    # Without a tree it gets no key of the new chain.
    old = OsnmaReceiver(sky.operator.public_keys[:1]).process_all(pages)
    assert set(keys_by_chain(old)) == {1}
    assert keys_by_chain(old)[1] == list(range(STEP_1))


def test_alert() -> None:
    sky, pages, report = scene(OsnmaEventKind.ALERT)
    assert headers(sky)[1] == (3, 1, 7)
    assert keys_by_chain(report) == {1: list(range(STEP_1))}
    (alert,) = report.alerts
    first = at(STEP_1).gst_seconds // 30
    sent = [{(first + k + svid) % 13 for k in range(n + 1) for svid in sky.svids} for n in range(13)]
    assert alert == at(STEP_1 + next(n for n, blocks in enumerate(sent) if len(blocks) == 13))
    assert withheld(report) == list(range(STEP_1, STEP_2))
    assert all(not any(page.osnma) for page in pages if page.time >= at(STEP_2))
    # Signed pages of before the alert bring nothing back.
    receiver = OsnmaReceiver(sky.operator.public_keys, sky.operator.merkle_tree)
    for page in pages:
        receiver.process(page)
    assert {key.time for key in receiver.filled_keys()} == {at(k) for k in range(STEP_1)}


def test_dont_use_ends_with_a_root_key_of_after_it() -> None:
    sky, _, report = scene(OsnmaEventKind.DONT_USE)
    assert headers(sky)[1:4] == [(3, 1, 1), (3, 1, 1), NOMINAL]
    # "Don't use" is seen until subframe 43; the hour begins in subframe 40 and brings a root key of after the start.
    found = keys_by_chain(report)[1]
    assert [k for k in found if k < STEP_2] == list(range(STEP_1))
    assert set(withheld(report)) >= set(range(STEP_1, STEP_2))
    assert no_tag_failed(report)


def test_silence_of_some_and_of_all() -> None:
    _, pages, report = scene(OsnmaEventKind.SILENCE)
    assert all(
        any(page.osnma) != (at(STEP_1) <= page.time < at(STEP_2)) for page in pages if page.time.second % 30 == 1
    )
    assert keys_by_chain(report) == {1: [*range(STEP_1), *range(STEP_2, N)]}
    assert report.gaps[0].n_missing == STEP_2 - STEP_1
    assert (report.failures, no_tag_failed(report)) == ((), True)
    event = OsnmaEvent(kind=OsnmaEventKind.SILENCE, announced=at(2), ended=at(4), svids=frozenset({7, 11}))
    sky = OperatorSky(OperatorConfiguration(seed=b"some", start=START, n_subframes=6, events=(event,)))
    some = OsnmaReceiver(sky.operator.public_keys).process_all(sky.pages())
    assert (len(some.keys), some.problems) == (6, ())
    assert some.subframes[Content.NONE] == 4
    # Their neighbours go on authenticating them.
    assert {data.svid for data in some.navigation if data.n_tags} == set(sky.svids)


def test_two_events_one_after_the_other() -> None:
    """After a revocation our receiver takes a further chain only with a root key of a later hour."""
    events = (
        OsnmaEvent(kind=OsnmaEventKind.CHAIN_REVOCATION, announced=at(2), in_force=at(4), ended=at(6)),
        OsnmaEvent(kind=OsnmaEventKind.CHAIN_RENEWAL, announced=at(44), in_force=at(60)),
    )
    sky = OperatorSky(OperatorConfiguration(seed=b"two", start=START, n_subframes=63, chain_id=3, events=events[::-1]))
    report = OsnmaReceiver(sky.operator.public_keys).process_all(sky.pages())
    assert keys_by_chain(report) == {3: [0, 1], 0: list(range(4, 60)), 1: [60, 61, 62]}
    assert no_tag_failed(report)
    assert len(sky.operator.chains) == 3


def test_every_header_that_is_sent_is_that_of_the_table() -> None:
    for kind in OsnmaEventKind:
        sky, pages, _ = scene(kind)
        for page in pages:
            if page.time.second % 30 == 1 and any(page.osnma):
                assert NmaHeader(page.osnma[0]) == sky.operator.header_at(page.time.subframe)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "alert", "in_force": at(3)}, "in_force does not belong to it"),
        ({"kind": "chain-renewal", "in_force": at(3), "ended": at(4)}, "ended does not belong to it"),
        ({"kind": "key-renewal", "in_force": at(1)}, "expected announced before in_force before ended"),
        ({"kind": "key-renewal", "ended": at(4)}, "cannot end without in_force"),
        ({"kind": "alert", "announced": at(2) + 1}, "is not the start of a subframe"),
        ({"kind": "alert", "svids": frozenset({2})}, "svids belong to silence alone"),
        ({"kind": "silence", "svids": frozenset({37})}, "expected numbers from 1 to 36"),
        ({"kind": "silence", "svids": frozenset()}, "expected numbers from 1 to 36"),
    ],
)  # fmt: skip
def test_events_that_are_not_possible(fields: dict[str, object], message: str) -> None:
    values = {"announced": at(2), **fields, "kind": OsnmaEventKind(fields["kind"])}
    with pytest.raises(VestigeError, match=message):
        OsnmaEvent(**values)


def test_events_do_not_overlap() -> None:
    alert = OsnmaEvent(kind=OsnmaEventKind.ALERT, announced=at(2), ended=at(4))
    after = OsnmaEvent(kind=OsnmaEventKind.CHAIN_RENEWAL, announced=at(6), in_force=at(8))
    for events in ((alert, after), (after, OsnmaEvent(kind=OsnmaEventKind.DONT_USE, announced=at(7), ended=at(9)))):
        with pytest.raises(VestigeError, match=r"begins before the .* is over"):
            OperatorSky(OperatorConfiguration(seed=b"", start=START, n_subframes=9, events=events))
    with pytest.raises(VestigeError, match="begins before the start"):
        OperatorConfiguration(seed=b"", start=at(3), n_subframes=9, events=(alert,))
    last = OsnmaEvent(kind=OsnmaEventKind.KEY_RENEWAL, announced=at(2), in_force=at(4))
    with pytest.raises(VestigeError, match="no private key of PKID 16"):
        OperatorSky(OperatorConfiguration(seed=b"", start=START, n_subframes=9, pkid=15, events=(last,)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", OsnmaEventKind)
def test_the_command_line_says_the_same(kind: OsnmaEventKind, tmp_path: Path) -> None:
    sky, pages, report = scene(kind)
    (tmp_path / "pages.sbf").write_bytes(b"".join(inav_block(page) for page in pages))
    sky.operator.write_files(tmp_path)
    trust = f"--merkle-tree={tmp_path / 'merkle_tree.xml'}"
    result = CliRunner().invoke(osnma, ["verify", str(tmp_path / "pages.sbf"), trust, "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert [key["key_hex"] for key in said["keys"]] == [key.data.hex() for key in report.keys]
    assert len(said["withheld"]) == len(report.withheld)
    assert {adkd: count["failed"] for adkd, count in said["tags"].items()} == {"0": 0, "4": 0, "12": 0}
    assert len(said["public_keys"]) == len(sky.operator.public_keys)
