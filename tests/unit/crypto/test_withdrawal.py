"""No key of a withdrawn chain is ever accepted, whatever the headers say that nobody signed.

`tests/statistical/test_all_headers.py` tries all values of the header with all kinds of withdrawal.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from simulated_chain import SimulatedChain
from vestige.crypto.keys.key_file import read_key_file, write_key_file
from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.osnma.chain_register import ChainRegister
from vestige.crypto.osnma.messages.dsm import NmaHeader, parse_kroot
from vestige.crypto.osnma.messages.root_key import RootKey, verify_root_key
from vestige.crypto.osnma.osnma_report import ProblemKind
from vestige.errors import AuthenticationError
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime
from withdrawal_builder import (
    CHAIN_REVOKED,
    DONT_USE,
    END_OF_CHAIN,
    KEY_REVOKED,
    KINDS,
    NEW_KEY,
    NEXT,
    NOMINAL,
    OLD,
    OPERATIONAL,
    PUBLIC,
    START,
    WITHDRAWN_AT,
    forged_subframes,
    header_of,
    nominal,
    page_of,
    received,
    signed,
    subframe,
    withdrawal,
)  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "saw_the_root_key_before"),
    [(kind, True) for kind in KINDS] + [("chain revoked", False), ("public key revoked", False)],
)
def test_after_a_signed_withdrawal_no_forged_header_brings_keys_back(kind: str, saw_the_root_key_before: bool) -> None:
    told = withdrawal(kind)
    known_from = START + 30 * (WITHDRAWN_AT + len(told) - 1)
    every_value = saw_the_root_key_before and kind in ("chain revoked", "do not use", "alert message")
    forged = forged_subframes(WITHDRAWN_AT + len(told), 1 if every_value else 7)
    receiver, times = received([*(nominal() if saw_the_root_key_before else []), *told, *forged])
    assert all(time < known_from for time in times)
    report = receiver.report()
    assert any(problem.kind is ProblemKind.STATUS for problem in report.problems)
    if saw_the_root_key_before:
        assert len(report.withheld) >= len(forged)
        assert {START + 30 * k for k in range(WITHDRAWN_AT)} <= times


def with_headers(pages: list[InavPage], index: int, values: Sequence[int]) -> list[InavPage]:
    """The pages, and the first page of one more satellite for each header value: the rest of them is lost."""
    forged = [
        page_of(svid, START + (30 * index + 1), bytes([value, 1, 2, 3, 4]))
        for svid, value in enumerate(values, start=3)
    ]
    return [*forged, *pages]


HARMLESS = [value for value in range(256) if value >> 6 != DONT_USE]


@pytest.mark.parametrize("values", [HARMLESS[k : k + 32] for k in range(0, 192, 32)])
def test_every_header_in_every_state_of_the_withdrawing_dsm(values: list[int]) -> None:
    """E02 tells the withdrawal, block by block; 32 others have forged headers in each subframe. E02 is believed."""
    told = withdrawal("chain revoked")
    receiver, times = received([
        *nominal(), *(with_headers(pages, WITHDRAWN_AT + k, values) for k, pages in enumerate(told)),
        *(with_headers([], index, values) for index in (20, 21)),
        with_headers(subframe(22, 0xA2, signed("old", 0xA2)), 22, values),
    ])  # fmt: skip
    assert times == {START + 30 * k for k in range(WITHDRAWN_AT)}
    assert len(receiver.report().withheld) == len(told) + 1


@pytest.mark.parametrize("n_blocks", range(8))
def test_before_the_withdrawal_is_signed_a_subframe_is_withheld_for_each_header(n_blocks: int) -> None:
    """Without all blocks there is only what the headers say; the keys of these subframes stay away, filled or not."""
    told = withdrawal("chain revoked")[:n_blocks]
    _, times = received([*nominal(), *told, *nominal(WITHDRAWN_AT + n_blocks, WITHDRAWN_AT + 12)])
    assert times == {
        START + 30 * k for k in range(WITHDRAWN_AT + 12) if not WITHDRAWN_AT <= k < WITHDRAWN_AT + n_blocks
    }


def renewal(chain_name: str, chain: SimulatedChain, keys: int, first: int, n: int = 12) -> list[list[InavPage]]:
    header = header_of(OPERATIONAL, chain.kroot.chain_id, keys)
    return [subframe(index, header, signed(chain_name, header), chain) for index in range(first, first + n)]


@pytest.mark.parametrize(
    ("kind", "name", "chain", "keys"),
    [("chain revoked", "next", NEXT, CHAIN_REVOKED), ("public key revoked", "new key", NEW_KEY, KEY_REVOKED)],
)
def test_the_chain_that_a_revocation_announces_comes_into_force(
    kind: str, name: str, chain: SimulatedChain, keys: int
) -> None:
    told = withdrawal(kind)
    first = WITHDRAWN_AT + len(told)
    new = renewal(name, chain, keys, first)
    back = forged_subframes(first + len(new), 8)
    receiver, old_times = received([*nominal(), *told, *new, *back])
    report = receiver.report()
    # Its root key under the new header is complete with the eighth subframe. Before, the status was "don't use".
    assert [key.time for key in report.keys if key.chain_id == 2] == [
        START + 30 * k for k in range(first + 7, first + 12)
    ]
    assert old_times == {START + 30 * k for k in range(WITHDRAWN_AT)}
    if kind == "public key revoked":
        revoked = "signed with public key PKID 4"
        late, _ = received([*told, *new, *back])
        assert any(revoked in root.reason and "PKID 5" in root.reason for root in late.report().roots)


def test_only_a_root_key_of_after_the_withdrawal_ends_do_not_use() -> None:
    """The hour after the withdrawal begins in subframe 30: its root key is a key that nobody knew before."""
    told = withdrawal("do not use")
    first = WITHDRAWN_AT + len(told)
    operational = header_of(OPERATIONAL, 1, NOMINAL)
    hour = GalileoTime(1401, 0)
    again = [subframe(index, operational, signed("old", operational), dsm_id=5) for index in range(first, 32)]
    renewed = [subframe(index, operational, signed("old", operational, hour), dsm_id=6) for index in range(32, 48)]
    _, times = received([*nominal(), *told, *again, *renewed])
    assert times == {START + 30 * k for k in (*range(WITHDRAWN_AT), *range(32 + 7, 48))}
    _, times = received([*nominal(), *withdrawal("signed alert"), *again, *renewed])
    assert times == {START + 30 * k for k in range(WITHDRAWN_AT)}  # an alert is final


def test_the_end_of_a_chain_withdraws_nothing() -> None:
    """Chain 1 until subframe 20, then chain 2, which was announced. Only the header "don't use" would cost a key."""
    announced = header_of(OPERATIONAL, 1, END_OF_CHAIN)
    sent = nominal()
    for index in range(WITHDRAWN_AT, 32):
        chain, header = (OLD, announced) if index < 20 else (NEXT, header_of(OPERATIONAL, 2, NOMINAL))
        values = HARMLESS[(index - 14) * 32 :][:32] if index >= 14 else []  # 14 to 19, and once more from 20 on
        values = values or HARMLESS[(index - 20) * 32 :][:32]
        sent.append(with_headers(subframe(index, header, signed("next", header), chain), index, values))
    receiver, _ = received(sent)
    report = receiver.report()
    assert [(key.time, key.chain_id) for key in report.keys] == [
        (START + 30 * k, 1 if k < 20 else 2) for k in range(32)
    ]
    assert report.failures == ()
    assert report.withheld == ()


def shifted(subframes: Iterable[Sequence[InavPage]], seconds: int) -> list[list[InavPage]]:
    """The same pages with other times, which nobody signs."""
    return [[replace(page, time=page.time + seconds) for page in pages] for pages in subframes]


LATE_S, EARLY_S = 50 * 30, -3 * 3600


@pytest.mark.parametrize("kind", KINDS)
def test_page_times_do_not_switch_a_withdrawal_off(kind: str, tmp_path: Path) -> None:
    """The genuine withdrawal is received with times of the future or of the past before it comes with its own."""
    told = withdrawal(kind)
    first = WITHDRAWN_AT + len(told)
    known_from = START + 30 * (first - 1)
    forged = forged_subframes(first, 37)
    receiver, times = received([*nominal(), *shifted(told, LATE_S), *told, *forged])
    assert all(time < known_from for time in times)
    report = receiver.report()
    withdrawn = [root.received_at for root in report.verified_roots if root.header.withdraws]
    assert [*withdrawn, *report.alerts] == [START + 30 * WITHDRAWN_AT]  # its first block completes the message again
    path = tmp_path / "keys.csv"
    write_key_file(path, OLD.validated_keys()[:first], report.verified_roots, report.alerts)
    with pytest.raises(AuthenticationError, match="leave out the keys from then on"):
        read_key_file(path, PUBLIC)
    _, times = received([*shifted(told, EARLY_S), *nominal(), *told, *forged])
    assert times == set()  # the root key of before has the time of the withdrawal, or an earlier one


@pytest.mark.parametrize("kind", ["chain revoked", "public key revoked", "do not use"])
def test_an_earlier_time_costs_no_signature(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A withdrawal, and a message whose signature is wrong, with twenty times, each an hour before the last one."""
    told = withdrawal(kind)
    header = header_of(DONT_USE, 1, NOMINAL)
    wrong = signed("old", header)[:-20] + bytes(20)
    told += [subframe(index, header, wrong, dsm_id=6) for index in range(20, 28)]
    verified, verify = [], PublicKey.verify

    def counted(self: PublicKey, message: bytes, signature: bytes) -> None:
        verified.append(message)
        verify(self, message, signature)

    monkeypatch.setattr(PublicKey, "verify", counted)
    receiver, _ = received([pages for hours in range(20) for pages in shifted(told, -3600 * hours)])
    assert len(verified) == 2
    (root,) = receiver.report().verified_roots
    assert root.received_at < START + -18 * 3600
    assert len(receiver.report().roots) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_a_key_file_does_not_bring_them_back(kind: str, tmp_path: Path) -> None:
    """What is written reads back; the file with all keys of the chain is refused."""
    receiver, _ = received([*nominal(), *withdrawal(kind)])
    report = receiver.report()
    path = tmp_path / "keys.csv"
    write_key_file(path, receiver.filled_keys(), report.verified_roots, report.alerts)
    assert read_key_file(path, PUBLIC) == report.keys
    write_key_file(path, OLD.validated_keys()[:40], report.verified_roots, report.alerts)
    with pytest.raises(AuthenticationError, match="leave out the keys from then on"):
        read_key_file(path, PUBLIC)


def test_gaps_are_not_filled_with_withdrawn_keys() -> None:
    """Keys of the same chain before and after the withdrawal; those between them follow, and are not used."""
    operational = header_of(OPERATIONAL, 1, NOMINAL)
    renewed = signed("old", operational, GalileoTime(1401, 0))
    after = [subframe(index, operational, renewed, dsm_id=6) for index in range(32, 44)]
    receiver, _ = received([*nominal(), *withdrawal("do not use"), *after])
    # Nothing was received in subframes 20 to 31. The new root key is complete in subframe 39.
    kept = [*range(WITHDRAWN_AT), *range(39, 44)]
    assert [key.time for key in receiver.filled_keys()] == [START + 30 * k for k in kept]


def root_of(name: str, header: int, received_at: GalileoTime, hour: GalileoTime | None = None) -> RootKey:
    return verify_root_key(parse_kroot(signed(name, header, hour)), NmaHeader(header), PUBLIC, near=received_at)


def test_a_root_key_that_was_known_before_a_withdrawal_does_not_end_it() -> None:
    """The revocation is signed with an older root key, and received with a time before the newer one of the chain."""
    hour = GalileoTime(1401, 0)
    operational = header_of(OPERATIONAL, 1, NOMINAL)
    register = ChainRegister()
    register.add(root_of("old", operational, hour + 60, hour))
    register.add(root_of("next", header_of(DONT_USE, 1, CHAIN_REVOKED), START + -3600))
    (chain, _) = register.chains
    register.add(root_of("old", operational, hour + 600, hour))
    assert "chain revoked" in register.refusal(chain, hour + 630)
    register.add(root_of("old", operational, hour + 3660, hour + 3600))
    assert register.refusal(chain, hour + 3630) != ""
    assert register.refusal(chain, hour + 3660) == ""


def test_the_time_of_a_root_key_bounds_when_it_was_received() -> None:
    hour = GalileoTime(1401, 0)
    register = ChainRegister()
    register.add(root_of("old", header_of(DONT_USE, 1, NOMINAL), START + 60))
    (chain,) = register.chains
    changes = register.n_changes
    register.add(root_of("old", header_of(DONT_USE, 1, NOMINAL), START + 30))
    assert register.n_changes == changes + 1
    register.add(root_of("old", header_of(OPERATIONAL, 1, NOMINAL), START, hour))  # the key of 30 s before the hour
    usable = [k for k in range(40) if register.refusal(chain, START + 30 * k) == ""]
    assert usable == [0, *range(29, 40)]
    assert register.n_changes == changes + 1


def test_the_register_orders_root_keys_by_what_they_say() -> None:
    """A replayed revocation of long ago costs the keys until the next root key, and no longer."""
    register = ChainRegister()
    now = START + 600

    register.add(root_of("next", header_of(OPERATIONAL, 2, NOMINAL), START))
    (chain,) = register.chains
    assert register.refusal(chain, now) == ""
    register.add(root_of("old", header_of(DONT_USE, 1, NOMINAL), now))  # once genuine
    assert register.refusal(chain, now + -30) == ""
    assert "don't use" in register.refusal(chain, now)
    hour = GalileoTime(1401, 0)
    register.add(root_of("next", header_of(OPERATIONAL, 2, NOMINAL), hour + 120, hour))
    assert register.refusal(chain, hour + 90) != ""
    assert register.refusal(chain, hour + 120) == ""
