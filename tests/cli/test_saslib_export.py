"""What `--export saslib` writes, read as GalileoSASlib reads: time out of the name, int16 I,Q, keys that open the RECS.

The reader here is written from the description of these three; none of its code is that of GalileoSASlib.
"""

from __future__ import annotations

import csv
import hashlib
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from cryptography.hazmat.primitives.ciphers import Cipher, algorithms, modes

from vestige.cli.recordings.simulate import command as simulate
from vestige.crypto.recs.recs_segment import decrypt
from vestige.errors import UnsupportedError
from vestige.recording.assistance.folder import read_assistance
from vestige.recording.recording import open_recording
from vestige.simulated import simulated_recording

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
SETTINGS = (
    "--epochs", "28:31", "--set", "receiver.sample_rate_hz=6.2e6", "--set", "constellation.svids=[7, 8]",
    "--export", "saslib",
)  # fmt: skip
GST_START = datetime(1999, 8, 22, tzinfo=UTC) - timedelta(seconds=13)  # 13 leap seconds then, 18 today


def invoked(*arguments: object) -> BaseException | None:
    result = CliRunner().invoke(simulate, [str(one) for one in (NIGHT, *SETTINGS, *arguments)], standalone_mode=False)
    return result.exception


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("saslib") / "case"
    assert invoked("-o", output, "--format", "int16") is None
    return output


def begin(path: Path) -> datetime:
    (stamp,) = re.findall(r"\d{8}_\d{6}Z", path.name)
    return datetime.strptime(stamp, "%Y%m%d_%H%M%SZ").replace(tzinfo=UTC)


def keys_of(path: Path) -> dict[int, bytes]:
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert all(re.fullmatch("[0-9A-F]{32}", row["osnma_key"]) for row in rows)
    return {int(row["epoch"]): bytes.fromhex(row["osnma_key"]) for row in rows}


def chips_of(path: Path, key: bytes, subframe: int) -> np.ndarray:
    """Return the chips of a unitary RECS file: AES-256-CBC with SHA-256 of the key, IV from subframe and RAND."""
    rand = int(path.stem.split("_")[4])
    week, tow = divmod(subframe, 604_800)
    preimage = ((week % 4096) << 20 | tow).to_bytes(4, "big") + bytes([rand]) + bytes(11)
    mode = modes.CBC(hashlib.sha256(preimage).digest()[:16])
    plain = Cipher(algorithms.AES(hashlib.sha256(key).digest()), mode).decryptor().update(path.read_bytes()[16:])
    return 1 - 2 * np.unpackbits(np.frombuffer(plain, np.uint8)).astype(np.int8)


@pytest.mark.parametrize("band", ["E1", "E6"])
def test_the_samples_are_those_of_the_recording_and_the_name_says_when(folder: Path, band: str) -> None:
    (path,) = (folder / "saslib").glob(f"{band}_*.sc16")
    raw = np.fromfile(path, "<i2")
    samples = raw[0::2] + 1j * raw[1::2]
    recording = open_recording(folder)
    reader = recording.e1 if band == "E1" else recording.e6
    assert reader is not None
    assert samples.size == reader.n_samples == round(2.3 * 6.2e6)
    assert np.array_equal(samples[-1000:], reader.samples(reader.end_sample - 1000, 1000))
    # epoch 28 of a scenario that begins at 22:00:00 GST, which is 18 s ahead of UTC
    assert begin(path) == datetime(2026, 11, 22, 22, 0, 28, tzinfo=UTC) - timedelta(seconds=18)
    assert path.stat().st_ino == (folder / f"{band.lower()}.sigmf-data").stat().st_ino  # no second copy


def test_the_key_of_a_recs_is_found_by_its_subframe(folder: Path) -> None:
    """KDI 1: the key of the subframe after that in which the RECS begins, at week · 604800 + TOW."""
    keys = keys_of(folder / "saslib" / "osnma_keys.csv")
    assistance = read_assistance(folder / "assistance").assistance
    assert {segment.svid for segment in assistance.segments} == {7, 8}
    (sent,) = {segment.transmit_time for segment in assistance.segments}
    seconds = (
        int((datetime(2026, 11, 22, 22, 0, 30, tzinfo=UTC) - timedelta(seconds=18) - GST_START).total_seconds()) + 5
    )
    assert sent.week * 604_800 + sent.second == seconds
    epoch = seconds // 30 * 30 + 30
    by_time = {key.time.gst_seconds: key for key in assistance.keys}
    assert keys[epoch] == by_time[epoch].data
    for segment in assistance.segments:
        (path,) = (folder / "assistance").glob(f"GSCX01_*_{segment.svid:02d}_1_*.RCS")
        ours = decrypt(segment, by_time[epoch]).chips
        assert np.array_equal(chips_of(path, keys[epoch], epoch)[: ours.size], ours)
    assert {delay.svid for delay in assistance.group_delays} == {7, 8}


def test_the_readme_says_rate_and_satellites(folder: Path) -> None:
    text = (folder / "saslib" / "README.txt").read_text()
    assert "sc16 samples at 6200000 Hz" in text
    assert "the first sample is 0.000000 s after the second in the name" in text
    assert "7,8" in text


def test_other_numbers_than_int16_are_refused_before_a_sample_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(simulated_recording, "record_band")
    error = invoked("-o", tmp_path / "a")
    assert isinstance(error, UnsupportedError)
    assert str(error) == ("--export saslib: GalileoSASlib reads int16 I,Q, not int8 I,Q; write it with --format int16")
    assert list(tmp_path.iterdir()) == []
