from __future__ import annotations

from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from simulated_chain import make_chain
from vestige.crypto.keys.merkle_tree import MerkleTree
from vestige.crypto.keys.public_key import Trust
from vestige.crypto.keys.public_key_file import load_public_keys, read_merkle_tree, read_public_key
from vestige.crypto.keys.signature_scheme import P521
from vestige.errors import AuthenticationError, InputFileError, UnsupportedError, VestigeError
from vestige.time import GalileoTime

CHAIN = make_chain(b"files", GalileoTime(1300, 0), 1, pkid=5)
POINT = CHAIN.tree.public_keys[0].point


SECOND_ROOT = f"<TreeNode><j>4</j><i>0</i><lengthInBits>256</lengthInBits><x_ji>{'0' * 64}</x_ji></TreeNode>"


def key_elements(point: bytes = POINT, pkid: int = 5, kind: str = "ECDSA P-256/SHA-256", length: int = 33) -> str:
    return (
        f"<i>5</i><PKID>{pkid}</PKID><lengthInBits>{8 * length}</lengthInBits><point>{point.hex().upper()}</point>"
        f"<PKType>{kind}</PKType>"
    )


def tree_xml(tree: MerkleTree = CHAIN.tree, function: str = "SHA-256", keys: str = "") -> str:
    nodes = "".join(
        f"<TreeNode><j>{j}</j><i>{i}</i><lengthInBits>256</lengthInBits><x_ji>{value.hex().upper()}</x_ji></TreeNode>"
        for (j, i), value in tree.nodes.items()
        if j == 4 or i == (5 >> j) ^ 1
    )
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="no" ?><signalData><body><MerkleTree><N>16</N>'
        f"<HashFunction>{function}</HashFunction><PublicKey>{keys or key_elements()}</PublicKey>{nodes}"
        "</MerkleTree></body></signalData>"
    )


@pytest.fixture
def tree_path(tmp_path: Path) -> Path:
    path = tmp_path / "tree.xml"
    path.write_text(tree_xml())
    return path


def test_key_from_a_document_from_loose_elements_and_from_pem(tmp_path: Path) -> None:
    document, loose, pem = tmp_path / "a.xml", tmp_path / "b.xml", tmp_path / "c.pem"
    document.write_text(f"<signalData><body><PublicKey>{key_elements()}</PublicKey></body></signalData>")
    loose.write_text(f'<?xml version="1.0" ?><PKID>5</PKID><i>5</i>\n<point>\n{POINT.hex()}\n</point>')
    pem.write_bytes(CHAIN.private_key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    keys = [read_public_key(path) for path in (document, loose, pem)]
    assert [key.point for key in keys] == [POINT] * 3
    assert [(key.pkid, key.leaf) for key in keys] == [(5, 5), (5, 5), (None, None)]


def test_tree_round_trip(tree_path: Path) -> None:
    tree = read_merkle_tree(tree_path)
    assert tree.public_keys == CHAIN.tree.public_keys
    assert tree.nodes == {(j, i): x for (j, i), x in CHAIN.tree.nodes.items() if j == 4 or i == (5 >> j) ^ 1}


def test_which_keys_are_trusted_and_why(tmp_path: Path, tree_path: Path) -> None:
    key_path = tmp_path / "key.xml"
    key_path.write_text(key_elements())
    expected = (5, POINT)
    for paths, trust in (
        ((key_path, None), Trust.USER),
        ((None, tree_path), Trust.MERKLE_TREE),
        ((key_path, tree_path), Trust.MERKLE_TREE),
    ):
        (key,) = load_public_keys(*paths)
        assert (key.pkid, key.point) == expected
        assert key.trust is trust
    with pytest.raises(ValueError, match="needs a public key"):
        load_public_keys(None, None)


def test_another_key_is_not_in_the_tree(tmp_path: Path, tree_path: Path) -> None:
    other = make_chain(b"other", GalileoTime(1300, 0), 1, pkid=5).tree.public_keys[0]
    key_path = tmp_path / "key.xml"
    key_path.write_text(key_elements(other.point))
    with pytest.raises(AuthenticationError, match="Merkle tree: public key PKID 5"):
        load_public_keys(key_path, tree_path)


def test_every_digit_of_the_tree_counts(tmp_path: Path) -> None:
    """One changed hexadecimal digit anywhere in the nodes or the key, and the tree is refused."""
    text = tree_xml()
    path = tmp_path / "tree.xml"
    for tag in ("x_ji", "point", "PKID", "i", "j", "lengthInBits", "N"):
        at = -1
        while (at := text.find(f"<{tag}>", at + 1)) >= 0:
            end = text.index("</", at)
            for place in range(at + len(tag) + 2, end, 7):
                digit = f"{int(text[place], 16) ^ 1:X}"
                path.write_text(text[:place] + digit + text[place + 1 :])
                with pytest.raises(VestigeError):
                    load_public_keys(None, path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "element PKID"),
        (key_elements() + "<PKID>6</PKID>", "one public key; the file also has 5"),
        (key_elements(pkid=16), "a number below 16"),
        (key_elements(POINT[:-1]), "66 hexadecimal digits"),
        ("-----BEGIN PUBLIC KEY-----\nAAAA\n-----END PUBLIC KEY-----\n", "a PEM public key on P-256"),
    ],
)
def test_key_files_that_are_none(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "key.xml"
    path.write_text(text)
    with pytest.raises(InputFileError, match=words):
        read_public_key(path)


def test_a_tree_and_keys_of_p521(tmp_path: Path) -> None:
    chain = make_chain(b"long", GalileoTime(1300, 0), 1, pkid=5, scheme=P521)
    (claim,) = chain.tree.public_keys
    elements = key_elements(claim.point, kind="ECDSA P-521/SHA-512", length=67)
    key, tree, pem = (tmp_path / name for name in ("key.xml", "tree.xml", "key.pem"))
    key.write_text(elements)
    tree.write_text(tree_xml(chain.tree, keys=elements))
    encoded = chain.private_key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    pem.write_bytes(encoded)
    assert read_public_key(key) == claim
    assert read_public_key(pem).point == claim.point
    assert load_public_keys(None, tree) == load_public_keys(pem, tree) == (chain.public_key,)
    key.write_text(key_elements(claim.point, kind="ECDSA P-256/SHA-256"))
    with pytest.raises(InputFileError, match="66 hexadecimal digits"):
        read_public_key(key)


def test_other_kinds_of_keys(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text(key_elements(kind="ECDSA P-384/SHA-384"))
    with pytest.raises(UnsupportedError, match="P-384"):
        read_public_key(path)
    for key in (rsa.generate_private_key(65537, 2048), ec.generate_private_key(ec.SECP384R1())):
        path.write_bytes(key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
        with pytest.raises(UnsupportedError, match="P-256"):
            read_public_key(path)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (("<N>16", "<N>8"), UnsupportedError, "8 leaves"),
        ((">SHA-256<", ">MD5<"), UnsupportedError, "MD5"),
        (("MerkleTree", "Tree"), InputFileError, "element MerkleTree"),
        (("<j>4</j>", "<j>3</j>"), InputFileError, "the root of the tree"),
        (("<signalData>", "<!DOCTYPE a [<!ENTITY b 'c'>]><signalData>"), InputFileError, "without entities"),
        (("</signalData>", ""), InputFileError, "well-formed XML"),
        (("</body>", "<MerkleTree/></body>"), None, ""),
        (("</MerkleTree>", SECOND_ROOT + "</MerkleTree>"), InputFileError, "two of j = 4, i = 0"),
    ],
)
def test_trees_that_are_none(
    tmp_path: Path, change: tuple[str, str], error: type[VestigeError] | None, words: str
) -> None:
    path = tmp_path / "tree.xml"
    path.write_text(tree_xml().replace(*change))
    if error is None:
        read_merkle_tree(path)
    else:
        with pytest.raises(error, match=words):
            read_merkle_tree(path)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    huge = tmp_path / "huge.xml"
    huge.write_bytes(b"<" * 1_000_001)
    binary = tmp_path / "binary.xml"
    binary.write_bytes(b"\xff\xfe")
    for path in (tmp_path, tmp_path / "absent.xml", huge, binary):
        with pytest.raises(InputFileError):
            read_merkle_tree(path)
        with pytest.raises(InputFileError):
            read_public_key(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_files_give_one_line_or_the_same_key(tmp_path: Path, data: st.DataObject) -> None:
    text = tree_xml().encode()
    at = data.draw(st.integers(0, len(text)))
    damaged = data.draw(st.sampled_from([text[:at], text[:at] + data.draw(st.binary(max_size=5)) + text[at + 1 :]]))
    path = tmp_path / "damaged.xml"
    path.write_bytes(damaged)
    try:
        keys = load_public_keys(None, path)
    except VestigeError:
        return
    assert [key.point for key in keys] == [POINT]
