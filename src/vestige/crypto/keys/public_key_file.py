"""Read files with OSNMA's public key and Merkle tree.

The European GNSS Service Centre publishes key and tree as XML. Public keys also come as PEM, and as loose XML elements
without a common root. A public key is therefore read element by element, without an XML parser. `read_public_key` and
`read_merkle_tree` return untrusted keys (see `public_key` and `merkle_tree`).
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_public_key
from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from vestige.crypto.file_bytes import read_bytes
from vestige.crypto.keys.merkle_tree import HEIGHT, LEAVES, NODE_BYTES, MerkleTree, verify_public_key, verify_tree
from vestige.crypto.keys.public_key import ClaimedPublicKey, PublicKey, compressed_point, trusted_by_user
from vestige.crypto.keys.signature_scheme import NAMES, P256, SCHEMES, scheme_of_curve
from vestige.errors import InputFileError, UnsupportedError

_MAX_FILE_BYTES = 1_000_000  # upper limit of the file size; the published files have 2 kB
_ELEMENT = re.compile(r"<(PKID|PKType|i|point|lengthInBits)>([^<]*)</\1>")


def read_public_key(path: Path) -> ClaimedPublicKey:
    """Return the untrusted public key of an XML file (elements PKID, PKType, i, point) or of a PEM file.

    The function raises `InputFileError` if the file cannot be read, has neither form, or has invalid values or several
    keys. The function raises `UnsupportedError` if the key is not ECDSA P-256 or P-521.
    """
    text = _read_text(path)
    if "-----BEGIN" in text:
        return ClaimedPublicKey(pkid=None, leaf=None, point=_pem_point(path, text))
    found: dict[str, str] = {}
    for name, content in _ELEMENT.findall(text):
        value = content.strip()
        if found.setdefault(name, value) != value:
            raise InputFileError(path, f"element {name}", value, f"one public key; the file also has {found[name]}")
    for name in ("PKID", "point"):
        if name not in found:
            raise InputFileError(path, f"element {name}", "none", "an OSNMA public key in XML, or PEM")
    return _claim(path, found)


def read_merkle_tree(path: Path) -> MerkleTree:
    """Return the unverified Merkle tree of an XML file.

    The function raises `InputFileError` if the file cannot be read, is not a Merkle tree publication, has invalid
    values, or lacks the root of the tree. The function raises `UnsupportedError` if the tree has another shape, hash
    function or kind of key than the Merkle tree of OSNMA.
    """
    text = _read_text(path)
    try:
        # The parser gets bytes, because it refuses a string with an encoding declaration.
        document: Element = ElementTree.fromstring(text.encode())
    except (ElementTree.ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise InputFileError(path, "document", str(error), "well-formed XML without entities") from None
    tree = document.find(".//MerkleTree")
    if tree is None:
        raise InputFileError(path, "element MerkleTree", "none", "an OSNMA Merkle tree publication")
    size, function = _text(path, tree, "N"), _text(path, tree, "HashFunction")
    if _number(path, "N", size, 1 << 16) != LEAVES or function != "SHA-256":
        raise UnsupportedError(f"{path}: Merkle tree of {size} leaves with {function}; supported is 16 with SHA-256")
    nodes: dict[tuple[int, int], bytes] = {}
    for element in tree.iter("TreeNode"):
        place, value = _node(path, element)
        if nodes.setdefault(place, value) != value:
            raise InputFileError(path, "element TreeNode", f"two of j = {place[0]}, i = {place[1]}", "one")
    if (HEIGHT, 0) not in nodes:
        raise InputFileError(path, "element TreeNode", "no node j = 4, i = 0", "the root of the tree")
    names = ("PKID", "i", "point", "PKType", "lengthInBits")
    keys = [{name: _text(path, element, name) for name in names} for element in tree.iter("PublicKey")]
    return MerkleTree(nodes=nodes, public_keys=tuple(_claim(path, key) for key in keys))


def load_public_keys(public_key: Path | None, merkle_tree: Path | None) -> tuple[PublicKey, ...]:
    """Verify the public keys in a public key file, a Merkle tree file, or both, and return the verified keys.

    With a Merkle tree every key is verified against the root of the tree, including the keys in the tree's own file.
    If both files are given, only the key of the public key file is returned. Without a Merkle tree the public key is
    used because the user trusts the key.

    The function raises `AuthenticationError` if a key does not lead to the root of the tree, or is not a point on the
    curve. The function raises `InputFileError` or `UnsupportedError` if a file cannot be used. `InputFileError` is also
    raised if only a Merkle tree file is given, and the file has no public key. The function raises `ValueError` if
    neither file is given.
    """
    if public_key is None and merkle_tree is None:
        raise ValueError("needs a public key or a Merkle tree")
    claim = None if public_key is None else read_public_key(public_key)
    if merkle_tree is None:
        assert claim is not None  # noqa: S101  (at least one file is given)
        return (trusted_by_user(claim),)
    tree = read_merkle_tree(merkle_tree)
    own = verify_tree(tree)
    if claim is not None:
        return (verify_public_key(claim, tree),)
    if not own:
        raise InputFileError(merkle_tree, "element PublicKey", "none", "a public key, here or in a file of its own")
    return own


def _read_text(path: Path) -> str:
    try:
        return read_bytes(path, at_most=_MAX_FILE_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"byte {error.start}", "not UTF-8", "XML or PEM text") from None


def _pem_point(path: Path, text: str) -> bytes:
    try:
        key = load_pem_public_key(text.encode())
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise InputFileError(path, "PEM block", "no public key in it", "a PEM public key on P-256 or P-521") from None
    if not isinstance(key, ec.EllipticCurvePublicKey) or scheme_of_curve(key.curve) is None:
        raise UnsupportedError(f"{path}: the key is not an elliptic-curve key on P-256 or P-521")
    return compressed_point(key)


def _text(path: Path, parent: Element, name: str) -> str:
    element = parent.find(name)
    if element is None or element.text is None:
        raise InputFileError(path, f"element {name}", "none", "a value")
    return element.text.strip()


def _number(path: Path, name: str, text: str, below: int) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text) or int(text) >= below:
        raise InputFileError(path, f"element {name}", text, f"a number below {below}")
    return int(text)


def _hex(path: Path, name: str, text: str, n_bytes: int) -> bytes:
    if not re.fullmatch(r"[0-9A-Fa-f]*", text) or len(text) != 2 * n_bytes:
        raise InputFileError(path, f"element {name}", text, f"{2 * n_bytes} hexadecimal digits")
    return bytes.fromhex(text)


def _check_length(path: Path, text: str, n_bytes: int) -> None:
    if _number(path, "lengthInBits", text, 1 << 16) != 8 * n_bytes:
        raise InputFileError(path, "element lengthInBits", text, str(8 * n_bytes))


def _node(path: Path, element: Element) -> tuple[tuple[int, int], bytes]:
    j = _number(path, "j", _text(path, element, "j"), HEIGHT + 1)
    i = _number(path, "i", _text(path, element, "i"), LEAVES >> j)
    _check_length(path, _text(path, element, "lengthInBits"), NODE_BYTES)
    return (j, i), _hex(path, f"x_ji of j = {j}, i = {i}", _text(path, element, "x_ji"), NODE_BYTES)


def _claim(path: Path, fields: dict[str, str]) -> ClaimedPublicKey:
    kind = fields.get("PKType", P256.name)
    # The type in a file is "ECDSA P-256/SHA-256" or "P-256/SHA-256".
    scheme = next((one for one in SCHEMES if one.curve_name in kind), None)
    if scheme is None:
        raise UnsupportedError(f"{path}: public key of type {kind!r}; supported are {NAMES}")
    if "lengthInBits" in fields:
        _check_length(path, fields["lengthInBits"], scheme.point_bytes)
    return ClaimedPublicKey(
        pkid=_number(path, "PKID", fields["PKID"], 16),
        leaf=_number(path, "i", fields["i"], LEAVES) if "i" in fields else None,
        point=_hex(path, "point", fields["point"], scheme.point_bytes),
    )
