from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from signed_files import sign
from simulated_chain import make_chain
from vestige.cli.services.recs import command
from vestige.crypto.keys.key_file import write_key_file
from vestige.crypto.recs import recs_file
from vestige.crypto.recs import recs_segment as recs
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.errors import AuthenticationError, InputFileError, VestigeError
from vestige.records import ChipSequence
from vestige.time import GalileoTime

START = GalileoTime(1251, 277216)
SERVER_KEY = ec.derive_private_key(0x1234567, ec.SECP256R1())
CHIPS = [np.random.default_rng(i).choice(np.array([-1, 1], np.int8), 10_230) for i in range(3)]
PACKED = [np.packbits(chips < 0).tobytes() for chips in CHIPS]


def pem(path: Path, key: ec.EllipticCurvePrivateKey) -> Path:
    path.write_bytes(key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    return path


def write_recs(folder: Path, mode: CipherMode = CipherMode.CBC) -> Path:
    """Write an aggregate of three RECS; the key file has the keys of the first two."""
    chain = make_chain(b"test of vestige recs", START, 3)
    segments = [
        recs.encrypt(
            ChipSequence.of(svid=11, transmit_time=START + 30 * i, chip_rate_hz=5.115e6, chips=CHIPS[i]),
            chain.keys[i].data,
            mode=mode,
        )
        for i in range(3)
    ]
    write_key_file(folder / "keys.csv", chain.validated_keys()[:2], [chain.root])
    pem(folder / "osnma.pem", chain.private_key)
    return recs_file.write_recs_file(recs_file.from_segments(segments), folder)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_recs(tmp_path)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments], standalone_mode=False)


def keys_of(file: Path) -> tuple[object, ...]:
    return "--keys", file.parent / "keys.csv", "--public-key", file.parent / "osnma.pem"


def test_info(file: Path) -> None:
    result = run("info", file)
    assert result.exception is None
    assert result.stdout.splitlines() == [
        f"{file}: aggregated RECS file of E11, not signed",
        "  provider GSCX, interface version 1, file version 1, reserved bits 0",
        "  3 RECS of 2 ms (10230 chips, NChip 1), KDI 0, RAND 0",
        "  first at 2023-08-16T05:00:16.000 GST, key of 2023-08-16T05:00:00.000 GST",
        "  last  at 2023-08-16T05:01:16.000 GST, key of 2023-08-16T05:01:00.000 GST; every 30 s",
    ]


def test_info_as_json(file: Path) -> None:
    (described,) = json.loads(run("info", "--json", file).stdout)["files"]
    assert described["path"] == str(file)
    assert (described["kind"], described["svid"], described["n_chips"]) == ("aggregated", 11, 10_230)
    assert (described["duration_s"], described["period_s"]) == (90.0, 30.0)
    assert described["segments"][2] == {
        "transmit_time": "2023-08-16T05:01:16.000 GST", "key_time": "2023-08-16T05:01:00.000 GST",
    }  # fmt: skip


def test_info_says_who_signed(file: Path, tmp_path: Path) -> None:
    sign(file, SERVER_KEY)
    assert "E11, signed, not verified: no certificate" in run("info", file).stdout
    assert "E11, verified" in run("info", "--certificate", pem(tmp_path / "server.pem", SERVER_KEY), file).stdout
    other = pem(tmp_path / "other.pem", ec.derive_private_key(7, ec.SECP256R1()))
    assert isinstance(run("info", "--certificate", other, file).exception, AuthenticationError)


@pytest.mark.parametrize("as_json", [False, True])
def test_info_shows_good_files_before_it_fails_for_a_bad_one(file: Path, tmp_path: Path, as_json: bool) -> None:
    (tmp_path / "bad.bin").write_bytes(b"garbage" * 10)
    result = run("info", tmp_path / "bad.bin", file, tmp_path / "missing.bin", *(["--json"] if as_json else []))
    assert str(file) in result.stdout
    assert len(result.stderr.splitlines()) == 1
    assert "bad.bin" in result.stderr
    assert isinstance(result.exception, InputFileError)
    assert "missing.bin" in str(result.exception)


def test_a_recs_of_forty_gigabytes_is_refused_before_it_is_read(file: Path) -> None:
    os.truncate(file, 40_000_000_000)
    result = run("info", file)
    assert isinstance(result.exception, InputFileError)
    assert "found 40000000000 bytes, expected at most" in str(result.exception)


def test_twelve_bit_week_follows_the_reference(file: Path, tmp_path: Path) -> None:
    unitary = recs_file.write_recs_file(recs_file.from_segments(recs_file.read_recs_file(file).segments[:1]), tmp_path)
    renamed = unitary.rename(tmp_path / "renamed")
    described = json.loads(run("info", "--json", "--reference", "2095-01-01T00:00:00", renamed).stdout)["files"][0]
    assert described["start_week"] == 1251 + 4096
    with pytest.raises(click.BadParameter, match="not a time"):
        raise run("info", "--reference", "yesterday", renamed).exception or AssertionError


def test_decrypt(file: Path, tmp_path: Path) -> None:
    output = tmp_path / "ecs.bin"
    result = run("decrypt", file, *keys_of(file), "-o", output)
    assert result.exception is None
    assert output.read_bytes() == PACKED[0] + PACKED[1]
    lines = result.stdout.splitlines()
    assert lines[0] == (
        "E11  2023-08-16T05:00:16.000 GST  key 2023-08-16T05:00:00.000 GST  "
        f"bytes 0+1279  SHA-256 {hashlib.sha256(PACKED[0]).hexdigest()[:16]}…"
    )
    assert "bytes 1279+1279" in lines[1]
    assert lines[2].endswith("no key")


def test_decrypt_as_json_without_output(file: Path, tmp_path: Path) -> None:
    before = set(tmp_path.iterdir())
    report = json.loads(run("decrypt", file, *keys_of(file), "--json").stdout)
    assert set(tmp_path.iterdir()) == before
    assert report["output"] is None
    assert [row["decrypted"] for row in report["segments"]] == [True, True, False]
    assert [row["sha256"] for row in report["segments"][:2]] == [hashlib.sha256(p).hexdigest() for p in PACKED[:2]]


def test_decrypt_in_counter_mode(tmp_path: Path) -> None:
    file = write_recs(tmp_path, CipherMode.CTR)
    run("decrypt", file, *keys_of(file), "--mode", "ctr", "-o", tmp_path / "ecs.bin")
    assert (tmp_path / "ecs.bin").read_bytes() == PACKED[0] + PACKED[1]


def test_chips_are_not_written_over_what_they_come_from(file: Path) -> None:
    before = {path: path.read_bytes() for path in file.parent.iterdir()}
    for output in before:
        assert isinstance(run("decrypt", file, *keys_of(file), "-o", output).exception, InputFileError)
    assert {path: path.read_bytes() for path in file.parent.iterdir()} == before


def test_decrypt_needs_trust(file: Path) -> None:
    result = run("decrypt", file, "--keys", file.parent / "keys.csv")
    assert isinstance(result.exception, click.UsageError)


def test_decrypt_with_keys_that_are_not_validated(file: Path, tmp_path: Path) -> None:
    other = pem(tmp_path / "other.pem", SERVER_KEY)
    result = run("decrypt", file, "--keys", file.parent / "keys.csv", "--public-key", other, "-o", tmp_path / "ecs.bin")
    assert isinstance(result.exception, VestigeError)
    assert not (tmp_path / "ecs.bin").exists()


def test_decrypt_without_any_of_its_keys(file: Path, tmp_path: Path) -> None:
    segments = recs_file.read_recs_file(file).segments[2:]
    path = recs_file.write_recs_file(recs_file.from_segments(segments), tmp_path)
    result = run("decrypt", path, *keys_of(file), "-o", tmp_path / "ecs.bin")
    assert isinstance(result.exception, VestigeError)
    assert "has none of the keys that the RECS need" in str(result.exception)
    assert not (tmp_path / "ecs.bin").exists()


def test_make_stands_beside_the_others() -> None:
    assert "Make RECS for a recording with open E6-C" in run("--help").stdout
    assert "Usage" in run("make", "--help").stdout
