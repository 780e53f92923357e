from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from osnma_builder import Broadcast
from simulated_chain import make_chain
from vestige.cli.services.osnma import command
from vestige.crypto.keys.key_file import read_key_file
from vestige.errors import AuthenticationError, InputFileError
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_650)
CHAIN = make_chain(b"cli", START, 12, chain_id=1, pkid=3)


def write_csv(path: Path, pages: list[InavPage]) -> None:
    lines = ["SVID,NumNavBits,NavBitsHEX"]
    for svid in sorted({page.svid for page in pages}):
        digits = "".join(page.data.hex() for page in pages if page.svid == svid)
        lines.append(f"{svid:02d},{4 * len(digits)},{digits}")
    path.write_text("\n".join(lines))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_csv(tmp_path / "pages.csv", Broadcast(CHAIN).pages())

    def changed(_svid: int, index: int, key: bytes) -> bytes:
        return key if index != 7 else b"\1" * 16

    write_csv(tmp_path / "false.csv", Broadcast(CHAIN, key_of=changed).pages())
    pem = CHAIN.private_key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    (tmp_path / "key.pem").write_bytes(pem)
    claim = CHAIN.tree.public_keys[0]
    nodes = "".join(
        f"<TreeNode><j>{j}</j><i>{i}</i><lengthInBits>256</lengthInBits><x_ji>{x.hex()}</x_ji></TreeNode>"
        for (j, i), x in CHAIN.tree.nodes.items()
    )
    (tmp_path / "tree.xml").write_text(
        f"<a><MerkleTree><N>16</N><HashFunction>SHA-256</HashFunction><PublicKey><i>{claim.leaf}</i><PKID>3</PKID>"
        f"<lengthInBits>264</lengthInBits><point>{claim.point.hex()}</point><PKType>ECDSA P-256/SHA-256</PKType>"
        f"</PublicKey>{nodes}</MerkleTree></a>"
    )
    return tmp_path


def run(folder: Path, file: str, *arguments: str) -> Result:
    paths = [str(folder / argument) if "." in argument else argument for argument in arguments]
    return CliRunner().invoke(command, ["verify", str(folder / file), *paths])


def test_a_good_recording(folder: Path) -> None:
    result = run(folder, "pages.csv", "--public-key", "key.pem", "--merkle-tree", "tree.xml", "-o", "keys.csv")
    assert result.exit_code == 0
    for words in (
        "public key PKID 3", "verified against the Merkle tree root", "signature and padding verify",
        "11 of 11 steps verify", "12 validated", "33 of 33 verify", "E02 E07 E11", "12 keys written",
    ):  # fmt: skip
        assert words in result.stdout
    assert "problem" not in result.stdout
    keys = read_key_file(folder / "keys.csv", (CHAIN.public_key,))
    assert keys == CHAIN.validated_keys()


def test_json_is_one_object(folder: Path) -> None:
    result = run(folder, "pages.csv", "--merkle-tree", "tree.xml", "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == 0
    assert report["chain_steps"] == {"ok": 11, "failed": 0}
    assert [key["key_hex"] for key in report["keys"]] == [key.data.hex() for key in CHAIN.keys]
    assert report["keys"][5] == {
        "chain_id": 1,
        "time": {"week": 1401, "second": 0},
        "key_hex": CHAIN.keys[5].data.hex(),
        "disclosed_at": {"week": 1401, "second": 22},
        "complete_at": {"week": 1401, "second": 31},
    }
    assert report["failures"] == []


def test_a_public_key_alone_is_said_to_be_unchecked(folder: Path) -> None:
    result = run(folder, "pages.csv", "--public-key", "key.pem")
    assert result.exit_code == 0
    assert "not checked against a Merkle tree" in result.stdout


def test_a_key_that_does_not_chain_fails_after_the_others_are_written(folder: Path) -> None:
    result = run(folder, "false.csv", "--merkle-tree", "tree.xml", "-o", "keys.csv")
    assert isinstance(result.exception, AuthenticationError)
    assert "1401:60 key: E02, E07, E11: key of" in str(result.exception)
    assert "10 of 11 steps verify" in result.stdout
    keys = read_key_file(folder / "keys.csv", (CHAIN.public_key,))
    assert keys == tuple(key for k, key in enumerate(CHAIN.validated_keys()) if k != 7)


def test_the_lost_key_can_be_filled_in(folder: Path) -> None:
    run(folder, "false.csv", "--merkle-tree", "tree.xml", "-o", "keys.csv", "--fill-gaps")
    assert read_key_file(folder / "keys.csv", (CHAIN.public_key,)) == CHAIN.validated_keys()


def test_without_a_verified_root_key_nothing_is_written(folder: Path) -> None:
    text = (folder / "tree.xml").read_text()
    (folder / "tree.xml").write_text(text.replace("<PKID>3", "<PKID>2"))
    result = run(folder, "pages.csv", "--merkle-tree", "tree.xml", "-o", "keys.csv")
    assert isinstance(result.exception, AuthenticationError)
    assert "Merkle tree: public key PKID 2" in str(result.exception)
    other = make_chain(b"other operator", START, 12, chain_id=1, pkid=3)
    write_csv(folder / "other.csv", Broadcast(other).pages())
    result = run(folder, "other.csv", "--public-key", "key.pem", "-o", "keys.csv")
    assert isinstance(result.exception, AuthenticationError)
    assert "NOT VERIFIED" in result.stdout
    assert not (folder / "keys.csv").exists()


def test_a_start_time_can_be_given(folder: Path) -> None:
    right = run(folder, "pages.csv", "--public-key", "key.pem", "--start", "1400:604651")
    wrong = run(folder, "pages.csv", "--public-key", "key.pem", "--start", "1400:604681")
    assert right.exit_code == 0
    assert isinstance(wrong.exception, AuthenticationError)
    assert "sends a time that differs from the time of the recording" in wrong.stdout


def test_keys_are_not_written_over_what_they_come_from(folder: Path) -> None:
    (folder / "again.csv").hardlink_to(folder / "pages.csv")
    (folder / "link.csv").symlink_to(folder / "notes.txt")
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    for output in ("pages.csv", "key.pem", "tree.xml", "again.csv", "link.csv"):
        result = run(folder, "pages.csv", "--public-key", "key.pem", "--merkle-tree", "tree.xml", "-o", output)
        assert isinstance(result.exception, InputFileError), output
        assert f"{output}: output: found" in str(result.exception)
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def test_usage_and_bad_files(folder: Path) -> None:
    assert run(folder, "pages.csv").exit_code == 2
    assert run(folder, "pages.csv", "--public-key", "key.pem", "--start", "yesterday").exit_code == 2
    assert run(folder, "pages.csv", "--public-key", "key.pem", "-o", str(folder)).exit_code == 2
    os.mkfifo(folder / "pipe.sbf")  # nobody will ever write to it
    for file in ("absent", "key.pem", "pipe.sbf"):
        assert isinstance(run(folder, file, "--public-key", "key.pem").exception, InputFileError)
