from __future__ import annotations

import hashlib
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulated_chain import make_chain
from vestige.crypto.keys.merkle_tree import MerkleTree, verify_broadcast_key, verify_public_key, verify_tree
from vestige.crypto.keys.public_key import ClaimedPublicKey, Trust
from vestige.crypto.keys.signature_scheme import P521
from vestige.errors import AuthenticationError, UnsupportedError, VestigeError
from vestige.time import GalileoTime

FULL = make_chain(b"tree", GalileoTime(1300, 0), 1, pkid=5).tree
CLAIM = FULL.public_keys[0]
# What is published: the root and the siblings on the way of leaf 5 = 0b0101.
PATH = [(0, 4), (1, 3), (2, 0), (3, 1)]
TREE = MerkleTree(nodes={place: FULL.nodes[place] for place in [*PATH, (4, 0)]}, public_keys=FULL.public_keys)


def broadcast(claim: ClaimedPublicKey = CLAIM, kind: int = 1, code: int = 7, n_blocks: int = 13) -> bytes:
    """A DSM-PKR as it is broadcast."""
    siblings = b"".join(TREE.nodes[place] for place in PATH)
    assert claim.leaf is not None
    assert claim.pkid is not None
    data = bytes([code << 4 | claim.leaf]) + siblings + bytes([kind << 4 | claim.pkid]) + claim.point
    return data.ljust(13 * n_blocks, b"\0")[: 13 * n_blocks]


def test_root_follows_from_leaf_and_siblings() -> None:
    leaf = hashlib.sha256(bytes([0x15]) + CLAIM.point).digest()
    n4, n3, n0, n1 = (TREE.nodes[place] for place in PATH)
    by_hand = hashlib.sha256(n4 + leaf).digest()
    by_hand = hashlib.sha256(by_hand + n3).digest()
    by_hand = hashlib.sha256(n0 + by_hand).digest()
    assert hashlib.sha256(by_hand + n1).digest() == TREE.root
    key = verify_public_key(CLAIM, TREE)
    assert (key.pkid, key.point, key.trust) == (5, CLAIM.point, Trust.MERKLE_TREE)
    assert verify_tree(TREE) == (key,)


@pytest.mark.parametrize("place", [*PATH, (4, 0)])
def test_no_bit_of_a_node_can_change(place: tuple[int, int]) -> None:
    for bit in range(256):
        changed = bytearray(TREE.nodes[place])
        changed[bit // 8] ^= 1 << bit % 8
        with pytest.raises(AuthenticationError, match="Merkle tree: public key PKID 5 at leaf 5"):
            verify_public_key(CLAIM, replace(TREE, nodes={**TREE.nodes, place: bytes(changed)}))


def test_no_bit_of_the_key_its_number_or_its_leaf_can_change() -> None:
    for bit in range(264):
        point = bytearray(CLAIM.point)
        point[bit // 8] ^= 1 << bit % 8
        with pytest.raises(AuthenticationError):
            verify_public_key(replace(CLAIM, point=bytes(point)), TREE)
    for other in set(range(16)) - {5}:
        with pytest.raises(AuthenticationError):
            verify_public_key(replace(CLAIM, pkid=other), TREE)
        with pytest.raises(AuthenticationError):
            verify_public_key(replace(CLAIM, leaf=other), TREE)


def test_a_key_without_number_takes_it_from_the_tree() -> None:
    pem = ClaimedPublicKey(pkid=None, leaf=None, point=CLAIM.point)
    assert verify_public_key(pem, TREE).pkid == 5
    with pytest.raises(AuthenticationError, match=r"holds no public key \w+…; it holds nothing$"):
        verify_public_key(pem, replace(TREE, public_keys=()))


def test_a_lost_node_is_named() -> None:
    nodes = {place: value for place, value in TREE.nodes.items() if place != (1, 3)}
    with pytest.raises(AuthenticationError, match="node x_1,3 is missing"):
        verify_public_key(CLAIM, replace(TREE, nodes=nodes))


def test_broadcast_key() -> None:
    only_root = MerkleTree(nodes={(4, 0): TREE.root})
    assert verify_broadcast_key(broadcast(), only_root) == verify_public_key(CLAIM, TREE)
    with pytest.raises(AuthenticationError, match="leaf 6"):
        verify_broadcast_key(broadcast(replace(CLAIM, leaf=6)), only_root)
    with pytest.raises(UnsupportedError, match="alert"):
        verify_broadcast_key(broadcast(kind=4), only_root)
    with pytest.raises(AuthenticationError, match=r"too short for a key of ECDSA P-521"):
        verify_broadcast_key(broadcast(kind=3), only_root)
    with pytest.raises(UnsupportedError, match="NB"):
        verify_broadcast_key(broadcast(code=6), only_root)
    with pytest.raises(AuthenticationError, match="too short"):
        verify_broadcast_key(broadcast(code=5, n_blocks=11), only_root)


# The tree of EUSPA's OSNMA test vector "public key revocation, step 2" (2023-10-07), whose key PKID 9 is of P-521.
OFFICIAL_POINT = bytes.fromhex(
    "03004BE2D894FCA1C3585DB7FC4D29EB695E41E366B1039CC4637E6814216D34EAE8"
    "74FF6652C49BE054EF2E9D229BDD03048039B40D230FFC7671E766B7420AF22EEE"
)
OFFICIAL_NODES = {
    (4, 0): "A10C440F3AA62453526DB4AF76DF8D9410D35D8277397D7053C700D192702B0D",
    (3, 0): "601BCFC32E2CC7DAA0FCE303988152A3D111ACCD8D7BBC8221B7ECAF1F19E5F9",
    (2, 3): "3CE12B1D83948031C682177CCC9FF5D929A7BED5BCEF61C2E31E06D41F18C776",
    (1, 5): "48910E560DF48615DFBA7AD8F20E953BEE15844994182E215DDC9B628BB7C6DA",
    (0, 9): "90938F4BC2C7967AF526090094F30DF44E10987422DD26D351DF3C17DC63066A",
}


def test_the_published_tree_with_a_key_of_p521() -> None:
    claim = ClaimedPublicKey(pkid=9, leaf=8, point=OFFICIAL_POINT)
    tree = MerkleTree(nodes={place: bytes.fromhex(x) for place, x in OFFICIAL_NODES.items()}, public_keys=(claim,))
    (key,) = verify_tree(tree)
    assert (key.pkid, key.point, key.trust) == (9, OFFICIAL_POINT, Trust.MERKLE_TREE)
    changed = replace(claim, point=OFFICIAL_POINT[:-1] + b"\xef")
    with pytest.raises(AuthenticationError, match="PKID 9"):
        verify_public_key(changed, tree)


def test_broadcast_key_of_p521() -> None:
    """1040 + 536 bits fill 16 blocks of 104 [OSNMA-ICD, DSM-PKR]."""
    tree = make_chain(b"tree", GalileoTime(1300, 0), 1, pkid=5, scheme=P521).tree
    (claim,) = tree.public_keys
    head = bytes([10 << 4 | 5]) + b"".join(tree.nodes[place] for place in PATH) + bytes([3 << 4 | 5])
    message = (head + claim.point).ljust(13 * 16, b"\0")
    assert verify_broadcast_key(message, MerkleTree(nodes={(4, 0): tree.root})).point == claim.point
    as_p256 = head[:-1] + bytes([1 << 4 | 5]) + claim.point
    with pytest.raises(AuthenticationError, match="Merkle tree"):
        verify_broadcast_key(as_p256.ljust(13 * 16, b"\0"), tree)


@given(st.binary(max_size=250))
def test_garbage_is_no_broadcast_key(garbage: bytes) -> None:
    with pytest.raises(VestigeError):
        verify_broadcast_key(garbage, TREE)
