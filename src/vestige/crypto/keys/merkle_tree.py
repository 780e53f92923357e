"""Verify the public keys of OSNMA with the Merkle tree, which has 16 leaves and a root that every receiver trusts.

A leaf belongs to a public key, and is SHA-256 of `type 4 | PKID 4 | point`, with lengths in bits. A parent is SHA-256
of its two children. Anybody can compute the root from a leaf and the siblings on the way up. Only the true key at its
true leaf gives the true root [OSNMA-ICD, 6.2]. The user provides the root, and the trust in every key of the tree is
based on this root.

A new public key is also broadcast in a DSM-PKR. The DSM-PKR contains the four siblings on the way from the leaf of the
key to the root. The DSM-PKR is `NB 4 | leaf 4 | siblings 4 x 256 | type 4 | PKID 4 | point | padding`. The point has
264 bits (P-256) or 536 bits (P-521).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vestige.crypto.keys.public_key import ClaimedPublicKey, PublicKey, Trust, load_point
from vestige.crypto.keys.signature_scheme import scheme_of_point, scheme_of_type
from vestige.crypto.osnma.messages.dsm import DSM_BLOCK_BYTES, pkr_blocks
from vestige.errors import AuthenticationError

HEIGHT = 4  # [OSNMA-ICD, 6.2]
LEAVES = 1 << HEIGHT
NODE_BYTES = 32
LEAF_AT = 1 + NODE_BYTES * HEIGHT  # index of the byte of a DSM-PKR at which the content of the leaf begins


@dataclass(frozen=True, slots=True, kw_only=True)
class MerkleTree:
    """The published part of a Merkle tree."""

    # hash (32 bytes) by (j, i): j is the height above the leaves, i counts from the left; (4, 0) is the root
    nodes: Mapping[tuple[int, int], bytes]
    public_keys: tuple[ClaimedPublicKey, ...] = ()  # published keys, not yet verified

    @property
    def root(self) -> bytes:
        """Hash at the root of the tree, x_4,0, 32 bytes."""
        return self.nodes[HEIGHT, 0]


def leaf_hash(pkid: int, point: bytes) -> bytes:
    """Return the leaf of a public key in the Merkle tree, which is a hash of 32 bytes.

    The function raises `AuthenticationError` if `point` does not have the length of a compressed point.
    """
    return hashlib.sha256(bytes([scheme_of_point(point).key_type << 4 | pkid]) + point).digest()


def path_root(leaf: int, value: bytes, siblings: Sequence[bytes]) -> bytes:
    """Return the root that follows from a leaf and the siblings on its way up, 32 bytes."""
    for height, sibling in enumerate(siblings):
        pair = sibling + value if leaf >> height & 1 else value + sibling
        value = hashlib.sha256(pair).digest()
    return value


def siblings_in(message: bytes) -> list[bytes]:
    """Return the siblings that a DSM-PKR contains, from the lowest to the highest."""
    return [message[1 + NODE_BYTES * k : 1 + NODE_BYTES * (k + 1)] for k in range(HEIGHT)]


def nodes_over(leaves: Sequence[bytes]) -> dict[tuple[int, int], bytes]:
    """Return all nodes of the tree over the hashes of its 16 leaves, as `MerkleTree.nodes` [OSNMA-ICD, 6.2].

    Parameters
    ----------
    leaves
        16 hashes of 32 bytes, the leftmost leaf first.

    Raises
    ------
    ValueError
        If the number of leaves is not 16.

    Examples
    --------
    >>> len(nodes_over([bytes(32)] * 16))
    31
    """
    if len(leaves) != LEAVES:
        raise ValueError(f"the tree has {LEAVES} leaves, not {len(leaves)}")
    nodes: dict[tuple[int, int], bytes] = {}
    level = list(leaves)
    for height in range(HEIGHT + 1):
        nodes |= {(height, i): value for i, value in enumerate(level)}
        level = [hashlib.sha256(level[i] + level[i + 1]).digest() for i in range(0, len(level) - 1, 2)]
    return nodes


def verify_public_key(claim: ClaimedPublicKey, tree: MerkleTree) -> PublicKey:
    """Verify a claimed public key against the root of the Merkle tree, and return the verified key.

    If the claim has no leaf, the leaf comes from the tree's entry with the number of the claim. If the claim has no
    number, number and leaf come from the tree's entry with the point of the claim.

    The function raises `AuthenticationError` if number or leaf of the claim remain unknown, or if the key leads to
    another root. The error is also raised if the tree lacks a sibling on the way from the leaf to the root.
    """
    pkid, leaf = _placed(claim, tree)
    siblings = []
    for height in range(HEIGHT):
        place = (height, leaf >> height ^ 1)
        if place not in tree.nodes:
            raise AuthenticationError(
                f"Merkle tree: node x_{height},{place[1]} is missing, so public key PKID {pkid} cannot be verified"
            )
        siblings.append(tree.nodes[place])
    return _verified(pkid, leaf, claim.point, siblings, tree.root)


def verify_tree(tree: MerkleTree) -> tuple[PublicKey, ...]:
    """Verify all public keys of a published tree against the root of the tree, and return the keys.

    The function raises `AuthenticationError` if a public key does not lead to the root, or if the tree lacks a sibling
    on the way from the leaf of a key to the root.
    """
    return tuple(verify_public_key(claim, tree) for claim in tree.public_keys)


def _placed(claim: ClaimedPublicKey, tree: MerkleTree) -> tuple[int, int]:
    """Return the number and the leaf of a claimed key, completed from the tree's own entries."""
    pkid, leaf = claim.pkid, claim.leaf
    for entry in tree.public_keys:
        same = entry.point == claim.point if pkid is None else entry.pkid == pkid
        if same:
            pkid = entry.pkid if pkid is None else pkid
            leaf = entry.leaf if leaf is None else leaf
    if pkid is None or leaf is None:
        which = "" if claim.pkid is None else f", PKID {claim.pkid}"
        held = ", ".join(f"{one.point.hex()[:16]}…, PKID {one.pkid}" for one in tree.public_keys) or "nothing"
        raise AuthenticationError(f"Merkle tree: holds no public key {claim.point.hex()[:16]}…{which}; it holds {held}")
    return pkid, leaf


def _verified(
    pkid: int, leaf: int, point: bytes, siblings: Sequence[bytes], root: bytes, message: bytes = b""
) -> PublicKey:
    found = path_root(leaf, leaf_hash(pkid, point), siblings)
    if found != root:
        raise AuthenticationError(
            f"Merkle tree: public key PKID {pkid} at leaf {leaf} gives the root {found.hex()[:16]}…, "
            f"not the trusted {root.hex()[:16]}…"
        )
    load_point(point)
    return PublicKey(pkid=pkid, point=point, trust=Trust.MERKLE_TREE, message=message)


def verify_broadcast_key(message: bytes, tree: MerkleTree, known: Sequence[PublicKey] = ()) -> PublicKey:
    """Verify the public key of a DSM-PKR against the tree's root, and return the key.

    Public keys come into force in the order of their numbers. So an unknown key is refused if its number is not above
    the numbers of all known keys. An older public key may have been revoked, and an attacker who has its private key
    can send the old DSM-PKR again [OSNMA-RG, 4.2].

    The function raises `AuthenticationError` if the message is malformed or leads to another root, or if an unknown key
    is refused. The function raises `UnsupportedError` if the message contains no key (an alert message or a reserved
    type).

    Parameters
    ----------
    message
        All blocks of the DSM-PKR.
    tree
        Merkle tree, of which only the root is used.
    known
        Keys in use. A key in use may be broadcast again.
    """
    blocks = pkr_blocks(message[0]) if message else 0
    if not blocks or len(message) != blocks * DSM_BLOCK_BYTES:
        raise AuthenticationError(f"DSM-PKR: {len(message)} bytes, but NB says {blocks} blocks of {DSM_BLOCK_BYTES}")
    siblings, at = siblings_in(message), LEAF_AT
    scheme = scheme_of_type(message[at] >> 4)
    end = at + 1 + scheme.point_bytes
    if len(message) < end:
        raise AuthenticationError(f"DSM-PKR: {blocks} blocks are too short for a key of {scheme.name}")
    key = _verified(message[at] & 15, message[0] & 15, message[at + 1 : end], siblings, tree.root, message)
    newest = max((one.pkid for one in known if one.pkid is not None), default=0)
    if key.point not in {one.point for one in known} and (key.pkid or 0) <= newest:
        raise AuthenticationError(f"DSM-PKR: {key} comes before PKID {newest}, which is in use")
    return key
