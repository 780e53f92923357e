"""Pages of a simulated chain that is withdrawn, and what an attacker with its keys may send afterwards.

The pages hold what decides it: NMA header, DSM block and key. Consecutive subframes have consecutive header values, so
one run forges all 256 of them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache

from simulated_chain import SimulatedChain, make_chain
from vestige.crypto.keys.merkle_tree import MerkleTree, path_root
from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader
from vestige.crypto.osnma.operator.signed_messages import sign_kroot
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.navigation.inav.page import InavPage, page_checksum
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_800 - 30 * 30)  # a quarter of an hour before the end of the week
WITHDRAWN_AT = 12  # first subframe whose header says so
N = WITHDRAWN_AT + 50 + 256

OLD = make_chain(b"withdrawn", START, N, chain_id=1, pkid=4)
NEXT = replace(make_chain(b"next", START, N, chain_id=2, pkid=4), private_key=OLD.private_key)
NEW_KEY = make_chain(b"new public key", START, N, chain_id=2, pkid=5)
PUBLIC = (OLD.public_key, NEW_KEY.public_key)

OPERATIONAL, DONT_USE = 2, 3
NOMINAL, END_OF_CHAIN, CHAIN_REVOKED, KEY_REVOKED, ALERT = 1, 2, 3, 5, 7


def header_of(status: int, chain_id: int, keys: int) -> int:
    return status << 6 | chain_id << 4 | keys << 1


@cache
def signed(chain_name: str, header: int, hour_start: GalileoTime | None = None) -> bytes:
    """The DSM-KROOT of a chain under a header, for the hour of the chain or a later one."""
    chain = {"old": OLD, "next": NEXT, "new key": NEW_KEY}[chain_name]
    kroot: DsmKroot = chain.kroot
    if hour_start is not None:
        key = next(key for key in chain.keys if key.time == hour_start + -30)
        kroot = replace(kroot, root_week=hour_start.week, root_hour=hour_start.second // 3600, root_key=key.data)
    return sign_kroot(kroot, NmaHeader(header), chain.private_key).serialise()


def alert_message() -> tuple[bytes, MerkleTree]:
    """A DSM-PKR of 13 blocks with a notice, and the tree that it belongs to."""
    siblings = [hashlib.sha256(bytes([k])).digest() for k in range(4)]
    leaf = bytes([4 << 4]) + b"OSNMA alert message".ljust(39, b".")
    tree = MerkleTree(nodes={(4, 0): path_root(15, hashlib.sha256(leaf).digest(), siblings)})
    message = bytes([7 << 4 | 15]) + b"".join(siblings) + leaf
    assert len(message) == 13 * 13
    return message, tree


def page_of(svid: int, time: GalileoTime, osnma: bytes) -> InavPage:
    bits = 1 << 119 | int.from_bytes(osnma, "big") << 62  # an odd half after an even one; word type 0 without time
    checksum = page_checksum(bits.to_bytes(30, "big"))
    return InavPage(svid=svid, time=time, data=(bits | checksum << 14).to_bytes(30, "big"))


def subframe(
    index: int,
    header: int,
    dsm: bytes,
    chain: SimulatedChain = OLD,
    svid: int = 2,
    dsm_id: int = 3,
    block: int | None = None,
) -> list[InavPage]:
    """One subframe of one satellite: the tags are noise, the key is true. Consecutive ones send consecutive blocks."""
    time = START + 30 * index
    number = index % (len(dsm) // 13) if block is None else block
    hkroot = bytes([header, dsm_id << 4 | number]) + dsm[13 * number : 13 * number + 13]
    mack = hashlib.sha512(bytes([svid, index % 256])).digest()[:42] + chain.keys[index].data + bytes(2)
    return [page_of(svid, time + (1 + 2 * k), hkroot[k : k + 1] + mack[4 * k : 4 * k + 4]) for k in range(15)]


def nominal(first: int = 0, last: int = WITHDRAWN_AT) -> list[list[InavPage]]:
    header = header_of(OPERATIONAL, 1, NOMINAL)
    return [subframe(index, header, signed("old", header)) for index in range(first, last)]


def withdrawal(kind: str, first: int = WITHDRAWN_AT) -> list[list[InavPage]]:
    """Subframes that tell the withdrawal until its DSM is there: 8 blocks, or 13 of an alert message."""
    if kind == "alert message":
        header = header_of(DONT_USE, 1, ALERT)
        return [subframe(index, header, alert_message()[0], dsm_id=12) for index in range(first, first + 13)]
    chain_name, header = {
        "chain revoked": ("next", header_of(DONT_USE, 1, CHAIN_REVOKED)),
        "public key revoked": ("new key", header_of(DONT_USE, 1, KEY_REVOKED)),
        "signed alert": ("old", header_of(DONT_USE, 1, ALERT)),
        "do not use": ("old", header_of(DONT_USE, 1, NOMINAL)),
        "revoked, next in force": ("next", header_of(OPERATIONAL, 2, CHAIN_REVOKED)),
        "reserved status": ("old", header_of(0, 1, NOMINAL)),
    }[kind]
    return [subframe(index, header, signed(chain_name, header)) for index in range(first, first + 8)]


KINDS = (
    "chain revoked", "public key revoked", "signed alert", "do not use", "revoked, next in force", "reserved status",
    "alert message",
)  # fmt: skip


def received(subframes: Iterable[Sequence[InavPage]]) -> tuple[OsnmaReceiver, set[GalileoTime]]:
    """The receiver at the end, and the times of all keys that it gave out while pages came or afterwards."""
    receiver = OsnmaReceiver(PUBLIC, alert_message()[1])
    keys = [key for pages in subframes for page in pages for key in receiver.process(page)]
    keys += receiver.finish()
    keys += (*receiver.report().keys, *receiver.filled_keys())
    return receiver, {key.time for key in keys if key.chain_id == 1}


@cache
def forged_subframes(first: int, step: int = 1) -> list[list[InavPage]]:
    """What an attacker with the keys of the withdrawn chain may send: root keys of before, then headers of all values.

    Under a header of its own in each subframe no DSM completes, so there the pages with header and key are enough.
    """
    operational, announcing = header_of(OPERATIONAL, 1, NOMINAL), header_of(OPERATIONAL, 1, END_OF_CHAIN)
    sent = [subframe(first + k, operational, signed("old", operational), dsm_id=4) for k in range(8)]
    sent += [subframe(first + k, announcing, signed("old", announcing), dsm_id=5) for k in range(8, 16)]
    for k, value in enumerate(range(0, 256, step)):
        pages = subframe(first + 16 + k, value, signed("old", operational))
        sent.append([pages[0], *pages[10:]])
    return sent
