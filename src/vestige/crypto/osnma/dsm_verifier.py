"""Verify received digital signature messages: root keys, new public keys, alert messages."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from vestige.crypto.keys.merkle_tree import MerkleTree, verify_broadcast_key
from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.osnma.chain_register import ChainRegister, RevokedKeyError
from vestige.crypto.osnma.dsm_collector import DsmCollector, DsmMessage
from vestige.crypto.osnma.messages.alert_message import is_alert, verify_alert
from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader, parse_kroot
from vestige.crypto.osnma.messages.root_key import RootKey, verify_root_key
from vestige.crypto.osnma.messages.subframe import Epoch
from vestige.crypto.osnma.osnma_report import ProblemKind, ProblemLog, RootCheck
from vestige.errors import AuthenticationError, UnsupportedError, VestigeError
from vestige.time import GalileoTime


class DsmVerifier:
    """Verifier that collects DSM blocks, verifies complete messages, and enters the results in the register of chains.

    Broadcast public keys and alert messages are verified against `tree`. Without `tree`, the verifier ignores broadcast
    public keys and alert messages. A verified broadcast key is used like the keys in `public_keys`, also for root keys
    that were received earlier.
    """

    def __init__(
        self, public_keys: Sequence[PublicKey], tree: MerkleTree | None, register: ChainRegister, problems: ProblemLog
    ) -> None:
        self._public_keys = tuple(public_keys)
        self._tree = tree
        self._register = register
        self._problems = problems
        self._collector = DsmCollector()
        self._place: dict[DsmMessage, int] = {}  # index of each DSM-KROOT in `roots`
        self._verified: dict[tuple[NmaHeader, bytes], RootKey] = {}  # verified root keys by NMA header and message
        self.roots: list[RootCheck] = []
        self.alerts: list[GalileoTime] = []

    def take(self, epoch: Epoch) -> None:
        """Add the DSM blocks that all satellites sent in one subframe, and verify the messages that are complete."""
        for subframe in epoch.satellites.values():
            try:
                for message in self._collector.add(subframe):
                    self._verify(message, epoch.time)
            except UnsupportedError as error:
                self._problems.report_once(ProblemKind.IGNORED, epoch.time, str(error))

    def progress(self) -> str:
        """Return a text with the number of received blocks of each DSM-KROOT."""
        return self._collector.progress()

    def _verify(self, message: DsmMessage, time: GalileoTime) -> None:
        dsm = f"DSM {message.dsm_id}"
        if message.is_root_key:
            self._take_root(message, time)
        elif self._tree is None:
            what = "an alert message" if is_alert(message.data) else "a public key"
            self._problems.report_once(
                ProblemKind.IGNORED, time, f"{dsm}: {what}; no Merkle tree was given to verify it"
            )
        else:
            try:
                if is_alert(message.data):
                    verify_alert(message.data, self._tree)
                    self._take_alert(time)
                else:
                    self._take_key(verify_broadcast_key(message.data, self._tree, self._public_keys))
            except VestigeError as error:
                self._problems.report_once(ProblemKind.IGNORED, time, f"{dsm}: {error}")

    def _take_key(self, key: PublicKey) -> None:
        """Use a verified broadcast key from now on, and for the root keys that were refused without this key."""
        if key.point in {one.point for one in self._public_keys}:
            return
        self._public_keys = (*self._public_keys, key)
        for message, place in self._place.items():
            check = self.roots[place]
            if check.root is None and check.kroot is not None and check.kroot.public_key_id == key.pkid:
                self.roots[place] = self._check_root(message, check.received_at)

    def _take_alert(self, time: GalileoTime) -> None:
        self._register.add_alert(time)
        self.alerts = [min([time, *self.alerts])]
        self._problems.report_once(ProblemKind.STATUS, time, "alert message: OSNMA is not used from here on")

    def _take_root(self, message: DsmMessage, time: GalileoTime) -> None:
        if message in self._place:
            self._take_earlier(self._place[message], time)
            return
        self._place[message] = len(self.roots)
        self.roots.append(self._check_root(message, time))

    def _check_root(self, message: DsmMessage, time: GalileoTime) -> RootCheck:
        """Verify a root key, enter a verified root key in the register, and return the result of the verification."""
        kroot, root, reason, kind, on_known_chain = None, None, "", ProblemKind.ROOT_KEY, False
        try:
            kroot = parse_kroot(message.data)
            verified = self._root_key(message, kroot, time)
            on_known_chain = self._register.add(verified)
            root = verified
        except RevokedKeyError as error:
            reason, kind = str(error), ProblemKind.STATUS
        except AuthenticationError as error:
            reason = str(error)
        except VestigeError as error:
            reason, kind = str(error), ProblemKind.IGNORED
        if root is None:
            self._problems.report(kind, time, f"DSM {message.dsm_id}: {reason}")
        return RootCheck(
            dsm_id=message.dsm_id,
            header=message.header,
            kroot=kroot,
            received_at=time,
            root=root,
            on_known_chain=on_known_chain,
            reason=reason,
        )

    def _take_earlier(self, place: int, time: GalileoTime) -> None:
        """Note an earlier reception of a DSM-KROOT, unless it was refused or its public key is revoked."""
        check = self.roots[place]
        if check.root is None:
            return
        root = check.root.received(time)
        with suppress(RevokedKeyError):
            self._register.add(root)
            self.roots[place] = replace(check, root=root, received_at=time)

    def _root_key(self, message: DsmMessage, kroot: DsmKroot, time: GalileoTime) -> RootKey:
        content = message.header, message.data
        if content in self._verified:
            return self._verified[content].received(time)
        self._verified[content] = verify_root_key(kroot, message.header, self._public_keys, near=time)
        return self._verified[content]
