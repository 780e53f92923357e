"""Define the OSNMA settings of a scenario: the events, and the private key and Merkle tree of the user.

Secrets that the user does not give follow from the seed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)

from vestige.crypto.keys.merkle_tree import MerkleTree
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.events import OsnmaEvent, key_withheld
from vestige.crypto.osnma.operator.key_tree import KeyTree, pkid_in_tree
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorKey:
    """The user's private key for the operator, as plain values that worker processes can share.

    Attributes
    ----------
    pkid
        PKID 1 to 15 of the public key.
    pem
        Private key as PEM without a password.
    nodes
        All nodes of the key's Merkle tree, as the items of `MerkleTree.nodes`. If empty, the operator makes a tree with
        this key.
    """

    pkid: int = 1
    pem: bytes
    nodes: tuple[tuple[tuple[int, int], bytes], ...] = ()

    @classmethod
    def of(cls, private_key: ec.EllipticCurvePrivateKey, tree: MerkleTree | None = None) -> OperatorKey:
        """Return an `OperatorKey` from a private key and an optional tree.

        Parameters
        ----------
        private_key
            Private key on P-256.
        tree
            Tree that contains the public key of `private_key`.

        Raises
        ------
        AuthenticationError
            If the public key is not a leaf of the tree, or does not lead to its root.
        """
        pem = private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
        if tree is None:
            return cls(pem=pem)
        pkid = pkid_in_tree(private_key.public_key(), tree)
        return cls(pkid=pkid, pem=pem, nodes=tuple(sorted(tree.nodes.items())))

    @property
    def private_key(self) -> ec.EllipticCurvePrivateKey:
        """Private key on P-256."""
        key = load_pem_private_key(self.pem, password=None)
        assert isinstance(key, ec.EllipticCurvePrivateKey)  # noqa: S101  (made by `of`)
        return key

    @property
    def tree(self) -> KeyTree | None:
        """Merkle tree of the user, with this private key only; None if the operator makes a tree."""
        return KeyTree(private_keys={self.pkid: self.private_key}, nodes=dict(self.nodes)) if self.nodes else None


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaService:
    """Events and keys of the operator of a scenario.

    Attributes
    ----------
    events
        Events of the broadcast.
    key
        The user's private key. If None, all keys follow from the seed.

    Examples
    --------
    >>> OsnmaService().operator(b"sky", GalileoTime(1400, 3600), 20).header_at(GalileoTime(1400, 3600)).status
    2
    """

    events: tuple[OsnmaEvent, ...] = ()
    key: OperatorKey | None = None

    def operator(self, seed: bytes, start: GalileoTime, n_subframes: int) -> OsnmaOperator:
        """Return the operator before its first subframe; `OperatorConfiguration` describes the arguments.

        The function raises `VestigeError` if an argument is invalid, or if events overlap, begin before `start`, or
        need a key that does not exist.
        """
        own = self.key
        return OsnmaOperator(
            OperatorConfiguration(
                seed=seed,
                start=start,
                n_subframes=n_subframes,
                pkid=1 if own is None else own.pkid,
                own_key=None if own is None else own.private_key,
                tree=None if own is None else own.tree,
                events=self.events,
            )
        )

    def withholds(self, svids: Iterable[int], time: GalileoTime) -> bool:
        """Return whether a receiver must not, or cannot ever, use the key of a subframe; see `key_withheld`."""
        return key_withheld(self.events, svids, time)


SERVICE_WITHOUT_EVENTS = OsnmaService()
