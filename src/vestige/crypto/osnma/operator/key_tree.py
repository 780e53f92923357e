"""Make the operator's key pairs and Merkle tree, whose 16 leaves are 15 public keys and an alert notice.

Public key PKID p is leaf p - 1, as in the trees that the service has published. The last leaf is the alert notice. A
broadcast notice can be verified only if it is a leaf of the tree [OSNMA-ICD, 6.2].
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from vestige.crypto.file_bytes import read_bytes
from vestige.crypto.keys.merkle_tree import HEIGHT, LEAVES, MerkleTree, leaf_hash, nodes_over, verify_public_key
from vestige.crypto.keys.public_key import ClaimedPublicKey, PublicKey, compressed_point
from vestige.crypto.keys.signature_scheme import P256
from vestige.crypto.osnma.operator.seeded_secrets import draw_private_key
from vestige.crypto.osnma.operator.signed_messages import alert_leaf
from vestige.errors import AuthenticationError, InputFileError, UnsupportedError, VestigeError

MAX_PKID = LEAVES - 1  # PKID 1 to 15; the alert message has PKID 0
ALERT_LEAF_INDEX = LEAVES - 1
_MAX_PEM_BYTES = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyTree:
    """The key pairs of an operator and the Merkle tree over their public keys."""

    private_keys: Mapping[int, ec.EllipticCurvePrivateKey]  # private keys on P-256 by PKID 1 to 15
    nodes: Mapping[tuple[int, int], bytes]  # all 31 nodes, as in `MerkleTree.nodes`

    def private_key(self, pkid: int) -> ec.EllipticCurvePrivateKey:
        """Return the private key with a PKID from 1 to 15.

        The function raises `VestigeError` if the tree has no private key with this PKID.
        """
        if pkid not in self.private_keys:
            known = ", ".join(map(str, sorted(self.private_keys)))
            raise VestigeError(f"OSNMA operator: there is no private key of PKID {pkid}, expected one of {known}")
        return self.private_keys[pkid]

    def claim(self, pkid: int) -> ClaimedPublicKey:
        """Return the public key with a PKID in its published form, which is not verified."""
        point = compressed_point(self.private_key(pkid).public_key())
        return ClaimedPublicKey(pkid=pkid, leaf=pkid - 1, point=point)

    def public_key(self, pkid: int) -> PublicKey:
        """Verify the public key with a PKID against the tree, and return the verified key."""
        return verify_public_key(self.claim(pkid), self.published(()))

    def published(self, pkids: Iterable[int]) -> MerkleTree:
        """Return the tree in its published form, with all its nodes and the public keys whose PKIDs are given."""
        return MerkleTree(nodes=dict(self.nodes), public_keys=tuple(self.claim(pkid) for pkid in pkids))

    def siblings(self, leaf: int) -> tuple[bytes, ...]:
        """Return the four siblings on the way from a leaf (0 to 15) to the root, the lowest first."""
        return tuple(self.nodes[height, leaf >> height ^ 1] for height in range(HEIGHT))


def draw_key_tree(seed: bytes, notice: bytes, own_key: tuple[int, ec.EllipticCurvePrivateKey] | None = None) -> KeyTree:
    """Draw 15 key pairs from a seed, and return the tree over the public keys and an alert notice.

    Parameters
    ----------
    seed
        Secret from which the key pairs follow.
    notice
        Alert notice, at most 39 bytes.
    own_key
        PKID 1 to 15 and private key of a key pair that does not follow from the seed.

    Raises
    ------
    VestigeError
        If the own key is not on P-256, its PKID is not 1 to 15, or the notice is too long.

    Examples
    --------
    >>> tree = draw_key_tree(b"seed", b"alert")
    >>> tree.public_key(3).pkid
    3
    """
    keys = {pkid: draw_private_key(seed, f"private key {pkid}") for pkid in range(1, MAX_PKID + 1)}
    if own_key is not None:
        pkid, private_key = own_key
        if private_key.curve.name != P256.curve.name:
            raise UnsupportedError(f"OSNMA operator: the own key is on {private_key.curve.name}, expected P-256")
        if pkid not in keys:
            raise VestigeError(f"OSNMA operator: the own key has PKID {pkid}, expected 1 to {MAX_PKID}")
        keys[pkid] = private_key
    leaves = [leaf_hash(pkid, compressed_point(key.public_key())) for pkid, key in keys.items()]
    return KeyTree(private_keys=keys, nodes=nodes_over([*leaves, alert_leaf(notice)]))


def pkid_in_tree(public_key: ec.EllipticCurvePublicKey, tree: MerkleTree) -> int:
    """Return the PKID, 1 to 15, of a public key that is leaf PKID - 1 of a tree.

    Raises
    ------
    AuthenticationError
        If the key is not a leaf of the tree, or does not lead to its root.
    """
    point = compressed_point(public_key)
    for pkid in range(1, MAX_PKID + 1):
        if tree.nodes.get((0, pkid - 1)) == leaf_hash(pkid, point):
            verify_public_key(ClaimedPublicKey(pkid=pkid, leaf=pkid - 1, point=point), tree)
            return pkid
    raise AuthenticationError(f"the public key {point.hex()} is no leaf of the Merkle tree")


def read_private_key(path: Path) -> ec.EllipticCurvePrivateKey:
    """Return the private key of a PEM file without a password.

    Raises
    ------
    InputFileError
        If the file cannot be read, is longer than 100 kB, or is not a PEM private key without a password.
    UnsupportedError
        If the key is not on P-256.
    """
    try:
        key = load_pem_private_key(read_bytes(path, at_most=_MAX_PEM_BYTES), password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise InputFileError(path, "PEM block", "no private key", "a P-256 private key without a password") from None
    if not isinstance(key, ec.EllipticCurvePrivateKey) or key.curve.name != P256.curve.name:
        raise UnsupportedError(f"{path}: the private key is not on P-256")
    return key
