"""What is written for receivers reads back as it was, by our readers and by an independent XML parser."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_public_key

from operator_sky import OperatorSky
from page_files import inav_block
from vestige.cli.services.osnma import command as osnma
from vestige.crypto.keys.merkle_tree import MerkleTree
from vestige.crypto.keys.public_key import ClaimedPublicKey, compressed_point
from vestige.crypto.keys.public_key_file import load_public_keys, read_merkle_tree, read_public_key
from vestige.crypto.keys.public_key_writer import write_merkle_tree, write_public_key_pem, write_public_key_xml
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.key_tree import draw_key_tree
from vestige.errors import VestigeError
from vestige.time import GalileoTime

KEYS = draw_key_tree(b"files", b"notice")
P521_CLAIM = ClaimedPublicKey(
    pkid=9, leaf=3, point=compressed_point(ec.derive_private_key(77, ec.SECP521R1()).public_key())
)


@pytest.mark.parametrize("claim", [KEYS.claim(1), KEYS.claim(15), P521_CLAIM], ids=["1", "15", "P-521"])
def test_a_public_key_reads_back(tmp_path: Path, claim: ClaimedPublicKey) -> None:
    path = tmp_path / "key.xml"
    write_public_key_xml(path, claim, GalileoTime(1400, 0))
    assert read_public_key(path) == claim
    document = ElementTree.parse(path).getroot()  # noqa: S314  (our own file)
    assert document.findtext("./body/PublicKey/PKID") == str(claim.pkid)
    assert document.findtext("./body/PublicKey/Applicability/Begin") == "2026-06-20T23:59:42Z"
    write_public_key_pem(tmp_path / "key.pem", claim)
    assert read_public_key(tmp_path / "key.pem") == ClaimedPublicKey(pkid=None, leaf=None, point=claim.point)
    loaded = load_pem_public_key((tmp_path / "key.pem").read_bytes())
    assert isinstance(loaded, ec.EllipticCurvePublicKey)
    assert compressed_point(loaded) == claim.point


@pytest.mark.parametrize("pkids", [(), (1,), (1, 2, 15)])
def test_a_merkle_tree_reads_back(tmp_path: Path, pkids: tuple[int, ...]) -> None:
    path = tmp_path / "tree.xml"
    tree = KEYS.published(pkids)
    write_merkle_tree(path, tree)
    assert read_merkle_tree(path) == tree
    assert [element.findtext("j") for element in ElementTree.parse(path).iter("TreeNode")][:3] == ["4", "3", "3"]  # noqa: S314
    if pkids:
        assert [key.pkid for key in load_public_keys(None, path)] == list(pkids)
    # A part of the nodes, as the service publishes it.
    part = MerkleTree(nodes={place: tree.nodes[place] for place in ((4, 0), (3, 1))}, public_keys=tree.public_keys)
    write_merkle_tree(path, part)
    assert read_merkle_tree(path) == part


@pytest.mark.parametrize("name", ["recorded_2025-12-12_{}.xml", "test_vector_configuration_1_{}.xml"])
def test_published_files_are_written_again(osnma_data: Path, tmp_path: Path, name: str) -> None:
    tree = read_merkle_tree(osnma_data / name.format("merkle_tree"))
    write_merkle_tree(tmp_path / "tree.xml", tree)
    assert read_merkle_tree(tmp_path / "tree.xml") == tree
    claim = read_public_key(osnma_data / name.format("public_key"))
    write_public_key_xml(tmp_path / "key.xml", claim)
    assert read_public_key(tmp_path / "key.xml") == claim
    published = ElementTree.parse(osnma_data / name.format("merkle_tree"))  # noqa: S314
    written = ElementTree.parse(tmp_path / "tree.xml")  # noqa: S314
    for element in ("N", "HashFunction", "PublicKey/point", "PublicKey/PKType", "TreeNode/x_ji"):
        place = f"./body/MerkleTree/{element}"
        assert written.findtext(place) == published.findtext(place)


def test_a_key_without_number_has_no_xml(tmp_path: Path) -> None:
    with pytest.raises(VestigeError, match="its PKID and its leaf have to be known"):
        write_public_key_xml(tmp_path / "key.xml", ClaimedPublicKey(pkid=None, leaf=None, point=KEYS.claim(1).point))
    assert list(tmp_path.iterdir()) == []


def test_osnma_verify_takes_the_files_of_the_operator(tmp_path: Path) -> None:
    configuration = OperatorConfiguration(seed=b"command line", start=GalileoTime(1400, 7200), n_subframes=3)
    sky = OperatorSky(configuration)
    (tmp_path / "pages.sbf").write_bytes(b"".join(inav_block(page) for page in sky.pages()))
    sky.operator.write_files(tmp_path)
    for trust in (["--merkle-tree=merkle_tree.xml"], ["--public-key=public_key.pem"],
                  ["--public-key=public_key.xml", "--merkle-tree=merkle_tree.xml"]):  # fmt: skip
        arguments = [f"{one.split('=')[0]}={tmp_path / one.split('=')[1]}" for one in trust]
        result = CliRunner().invoke(osnma, ["verify", str(tmp_path / "pages.sbf"), *arguments])
        assert result.exit_code == 0, result.output
        assert "3" in result.output
