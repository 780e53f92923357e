"""Write OSNMA's public key and Merkle tree to files, as PEM or as the XML of the service.

The XML has the elements of the files that the European GNSS Service Centre publishes, in the same order. So the written
files are readable by `public_key_file`, and by other programs that read the published files.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from vestige.crypto.keys.merkle_tree import LEAVES, NODE_BYTES, MerkleTree
from vestige.crypto.keys.public_key import ClaimedPublicKey, load_point
from vestige.crypto.keys.signature_scheme import scheme_of_point
from vestige.errors import VestigeError
from vestige.output import replacement
from vestige.time import GalileoTime

_NO_TIME = GalileoTime(0, 0)


def write_public_key_pem(path: Path, claim: ClaimedPublicKey) -> None:
    """Write a public key as PEM. Number and leaf are lost, because PEM has no field for them.

    The function raises `AuthenticationError` if the point is not on a curve, and `OSError` if the file cannot be
    written.
    """
    data = load_point(claim.point).public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    _write(path, data.decode())


def write_public_key_xml(path: Path, claim: ClaimedPublicKey, applicable_from: GalileoTime = _NO_TIME) -> None:
    """Write a public key in the XML form in which the service publishes the key.

    Parameters
    ----------
    path
        File to write.
    claim
        Public key with its number and its leaf.
    applicable_from
        Time from which the key is applicable, as the file will state.

    Raises
    ------
    VestigeError
        If the number or the leaf of the key is unknown, or the point does not have the length of a compressed point.
    OSError
        If the file cannot be written.
    """
    scheme = scheme_of_point(claim.point)
    body = (
        f"<PublicKey><UID>PK-{claim.point.hex().upper()}</UID>{_applicability(applicable_from)}"
        f"<State>Applicable</State>{_key_elements(claim)}<PKType>{scheme.name}</PKType></PublicKey>"
    )
    _write(path, _document(body, applicable_from))


def write_merkle_tree(path: Path, tree: MerkleTree, applicable_from: GalileoTime = _NO_TIME) -> None:
    """Write a Merkle tree with all its nodes and public keys, in the XML form in which the service publishes the tree.

    Parameters
    ----------
    path
        File to write.
    tree
        Merkle tree whose root the receivers trust.
    applicable_from
        Time from which the tree is applicable, as the file will state.

    Raises
    ------
    VestigeError
        If the number or the leaf of a key is unknown, or a point does not have the length of a compressed point.
    OSError
        If the file cannot be written.
    """
    keys = "".join(
        f"<PublicKey>{_key_elements(claim)}<PKType>{scheme_of_point(claim.point).name}</PKType></PublicKey>"
        for claim in tree.public_keys
    )
    # The service writes the root first.
    nodes = "".join(
        f"<TreeNode><j>{j}</j><i>{i}</i><lengthInBits>{8 * NODE_BYTES}</lengthInBits>"
        f"<x_ji>{tree.nodes[j, i].hex().upper()}</x_ji></TreeNode>"
        for j, i in _from_the_root(tree.nodes)
    )
    body = (
        f"<MerkleTree><UID>MT-{tree.root.hex().upper()}</UID>{_applicability(applicable_from)}"
        f"<State>Applicable</State><N>{LEAVES}</N><HashFunction>SHA-256</HashFunction>{keys}{nodes}</MerkleTree>"
    )
    _write(path, _document(body, applicable_from))


def _from_the_root(places: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    return sorted(places, key=lambda place: (-place[0], place[1]))


def _key_elements(claim: ClaimedPublicKey) -> str:
    if claim.pkid is None or claim.leaf is None:
        raise VestigeError(f"public key {claim.point.hex()[:16]}…: its PKID and its leaf have to be known for XML")
    return (
        f"<i>{claim.leaf}</i><PKID>{claim.pkid}</PKID><lengthInBits>{8 * len(claim.point)}</lengthInBits>"
        f"<point>{claim.point.hex().upper()}</point>"
    )


def _applicability(time: GalileoTime) -> str:
    return f"<Applicability><Begin>{_utc(time)}</Begin></Applicability>"


def _utc(time: GalileoTime) -> str:
    return f"{time.utc:%Y-%m-%dT%H:%M:%S}Z"


def _document(body: str, issued: GalileoTime) -> str:
    place = (
        "<GAL-EXT-GOC-SC-GLAd><mission>GAL</mission><segment>EXT</segment><element>GOC-SC</element>"
        "</GAL-EXT-GOC-SC-GLAd>"
    )
    header = (
        f"<header><GAL-header><source>{place}</source><destination>{place}</destination>"
        f"<issueDate>{_utc(issued)}</issueDate><signalVersion>1.0</signalVersion>"
        "<dataVersion>1.0</dataVersion></GAL-header></header>"
    )
    declaration = '<?xml version="1.0" encoding="UTF-8" standalone="no" ?>'
    return f"{declaration}<signalData>{header}<body>{body}</body></signalData>"


def _write(path: Path, text: str) -> None:
    with replacement(path) as partial:
        partial.write_text(text, encoding="utf-8")
