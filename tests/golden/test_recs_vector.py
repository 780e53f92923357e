"""The worked RECS vector of the project's protocol reference: made with OpenSSL, agreed by a second implementation."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from builders import validated_key
from vestige.crypto.recs import recs_file
from vestige.crypto.recs import recs_segment as recs
from vestige.crypto.recs.recs_file import RecsFile, RecsFileKind
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.records import ChipSequence, EncryptedSegment
from vestige.records.packed_chips import bits_of_packed
from vestige.time import GalileoTime

KEY = bytes.fromhex("be7801d2d4eb75a7e686054a18c58141")
GST_SF = GalileoTime(1251, 277200)
EPOCH = GalileoTime(1251, 277216)
SVID = 11
CBC_SHA = "9ec059da41764af546daf9a3ac86be466b8649ec9660805d2fda4ea8ab33d2fa"
CTR_SHA = "31fee00cb970ef00dd03831f445dfb2b1ff4e009340a14c8a3361025f48b5fa4"


def sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def bits(line: str) -> np.ndarray:
    """Return the bits of one line of the code table, `component PRN length hex`."""
    length, digits = line.split()[2:]
    values = np.array([int(digit, 16) for digit in digits], np.uint8)
    return np.unpackbits(values[:, None], axis=1)[:, 4:].ravel()[: int(length)]


@pytest.fixture(scope="module")
def chips(code_tables: Path) -> ChipSequence:
    """Return 16 periods of E6-C of PRN 11 with its secondary code."""
    lines = (code_tables / "galileo_memory_codes.txt").read_text().splitlines()
    table = {tuple(line.split()[:2]): line for line in lines if not line.startswith("#")}
    primary, secondary = bits(table["E6C", str(SVID)]), bits(table["CS100", str(SVID)])
    code = np.concatenate([primary ^ secondary[period] for period in range(16)])
    return ChipSequence.of(
        svid=SVID, transmit_time=EPOCH, chip_rate_hz=5.115e6, chips=np.where(code == 0, 1, -1).astype(np.int8)
    )


@pytest.fixture(scope="module")
def segment(chips: ChipSequence) -> EncryptedSegment:
    return recs.encrypt(chips, KEY)


def test_key_iv_and_their_input() -> None:
    assert recs.iv_preimage(GST_SF, 0).hex() == "4e343ad0000000000000000000000000"
    assert recs.wrapping_key(KEY).hex() == "706930574feea16c63795b07cd5bc16af7c6c5bdcb6ad997d249c40e79c8f1e0"
    assert recs.initialization_vector(GST_SF, 0).hex() == "2fc4daf3026ac911847d92e4f5212708"
    assert recs.key_time(EPOCH, 0) == GST_SF


def test_zero_bytes_independent_of_the_code_tables() -> None:
    body = recs.encrypt_body(bytes(10_240), KEY, GST_SF)
    assert body[:16].hex() == "17626b2fc56947d056cd143137d1258a"
    assert sha(body) == "0a81d5ad3543feec36cf2252531f5324e8fdce0f77f76f9b3bb5326acb743d3c"


def test_code_sequence(chips: ChipSequence) -> None:
    ecs = bits_of_packed(chips.packed, 10_240)
    assert len(ecs) == 10_240
    assert ecs[:32].hex() == "f4c4b94772ce84695325cb3aeef60bd564147adee80541c6fe5f5653dff51aa0"
    assert sha(ecs) == "a2793859607cddf29b458823efd79a1e712154271ea4933db6411791ab925489"


@pytest.mark.judged(by="OpenSSL", what="encryption of a RECS", figure="equal bytes")
def test_encrypted_body(chips: ChipSequence, segment: EncryptedSegment) -> None:
    assert segment.cipher[:32].hex() == "36658dea4b51252864a964ae29fbbbb9397dc5f3acbbee506e7196ae10dad820"
    assert segment.cipher[-16:].hex() == "b285eac7c7024aae4cb2b3ad2d0c7250"
    assert sha(segment.cipher) == CBC_SHA
    assert sha(recs.encrypt(chips, KEY, mode=CipherMode.CTR).cipher) == CTR_SHA


@pytest.mark.parametrize("mode", CipherMode)
def test_decrypted_chips(chips: ChipSequence, mode: CipherMode) -> None:
    key = validated_key(GST_SF, KEY, chain_id=3)
    decrypted = recs.decrypt(recs.encrypt(chips, KEY, mode=mode), key, mode=mode)
    assert (decrypted.svid, decrypted.transmit_time, decrypted.chip_rate_hz) == (SVID, EPOCH, 5.115e6)
    np.testing.assert_array_equal(decrypted.chips, chips.chips)


def test_unitary_file(segment: EncryptedSegment, tmp_path: Path) -> None:
    file = recs_file.from_segments([segment])
    data = recs_file.serialize_recs_file(file)
    assert data[:16].hex() == "475343580104e32a4cc00b0000010010"
    assert sha(data[16:]) == CBC_SHA
    assert str(file.name) == "GSCX01_232280500160_11_0_0_01.RCS"
    path = recs_file.write_recs_file(file, tmp_path)
    assert path.name == str(file.name)
    assert recs_file.read_recs_file(path).segments == (segment,)


def test_aggregated_file(segment: EncryptedSegment, tmp_path: Path) -> None:
    file = RecsFile(
        kind=RecsFileKind.AGGREGATED, provider="GSCX", start=EPOCH, svid=SVID, key_delay=0, random_offset=0,
        n_chip_code=4,
        body=10 * segment.cipher, duration_ds=3000, period_ds=300,
    )  # fmt: skip
    data = recs_file.serialize_recs_file(file)
    assert data[:25].hex() == "4753435800000000010004e32a4cc0000bb80b000004012c01"
    assert str(file.name) == "01_232280500160_000300_00300_11_0_0_4_01.bin"
    read = recs_file.read_recs_file(recs_file.write_recs_file(file, tmp_path))
    assert read == file
    assert read.segments[0] == segment
    assert [s.transmit_time for s in read.segments] == [EPOCH + 30 * i for i in range(10)]
