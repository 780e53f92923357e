from __future__ import annotations

import dataclasses
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError
from vestige.recording.description import BandFile
from vestige.recording.samples.sample_file import SampleReader, open_samples
from vestige.recording.samples.sample_format import COMPONENTS, SampleFormat
from vestige.records import Band
from vestige.time import GalileoTime

START = GalileoTime(1161, 348018, 0.1)
INT8 = SampleFormat(component="int8", layout="iq")

formats = st.builds(
    SampleFormat,
    component=st.sampled_from(sorted(COMPONENTS)),
    layout=st.sampled_from(["real", "iq", "qi"]),
    big_endian=st.booleans(),
)


def band_file(path: Path, form: SampleFormat = INT8) -> BandFile:
    return BandFile(
        band=Band.E6, path=path, described_in=path.parent / "recording.toml", form=form, sample_rate_hz=12.5e6,
        center_frequency_hz=1278.75e6, first_sample=1000, start=START,
    )  # fmt: skip


def reader(path: Path, content: bytes, form: SampleFormat = INT8) -> SampleReader:
    path.write_bytes(content)
    return open_samples(band_file(path, form))


@given(form=formats, n_samples=st.integers(1, 200), size=st.integers(1, 60), seed=st.integers(0, 9))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_pieces_are_the_whole(tmp_path: Path, form: SampleFormat, n_samples: int, size: int, seed: int) -> None:
    count = n_samples * form.components_per_sample
    values = np.random.default_rng(seed).integers(0, 100, count).astype(form.dtype)
    samples = reader(tmp_path / "x.bin", values.tobytes(), form)
    whole = samples.read(1000, n_samples)
    blocks = list(samples.blocks(size))
    assert np.concatenate([block.samples for block in blocks]).tobytes() == whole.samples.tobytes()
    assert [block.first_sample for block in blocks] == list(range(1000, 1000 + n_samples, size))
    assert blocks[0].start == whole.start == START
    for block in blocks:
        assert block.start == samples.time_of(block.first_sample)


def test_batch_says_what_it_is(tmp_path: Path) -> None:
    samples = reader(tmp_path / "x.bin", bytes(range(20)))
    batch = samples.read(1004, 2)
    assert batch.samples.tolist() == [8 + 9j, 10 + 11j]
    assert (batch.band, batch.first_sample, batch.sample_rate_hz) == (Band.E6, 1004, 12.5e6)
    assert batch.start - START == pytest.approx(4 * 80e-9, abs=1e-16)
    assert (samples.first_sample, samples.end_sample, samples.n_samples) == (1000, 1010, 10)
    assert samples.duration_s == 10 / 12.5e6


def test_inversion_is_undone_and_headers_are_skipped(tmp_path: Path) -> None:
    path = tmp_path / "x.bin"
    path.write_bytes(b"head" + bytes([1, 2, 3, 4]) + b"tail!")
    file = dataclasses.replace(band_file(path), spectral_inversion=True, header_bytes=4, trailing_bytes=5)
    assert open_samples(file).samples(1000, 2).tolist() == [1 - 2j, 3 - 4j]


def test_memory_is_bounded_by_the_block(tmp_path: Path) -> None:
    path = tmp_path / "x.bin"
    with path.open("wb") as stream:
        stream.truncate(1 << 33)  # 8 GiB of zeros, none of them on the disk
    samples = open_samples(band_file(path))
    tracemalloc.start()
    assert len(samples.read(1000 + (1 << 31), 1 << 16).samples) == 1 << 16
    assert tracemalloc.get_traced_memory()[1] < 3 << 20
    tracemalloc.stop()


@pytest.mark.parametrize("piece", [(999, 1), (1000, 11), (1011, 1), (1000, -1)])
def test_outside_is_our_mistake(tmp_path: Path, piece: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="expected 1000 to 1009"):
        reader(tmp_path / "x.bin", bytes(20)).samples(*piece)


def test_odd_files_are_noted(tmp_path: Path) -> None:
    samples = reader(tmp_path / "x.bin", bytes(21))
    assert samples.n_samples == 10
    assert "middle of a sample" in samples.notes[0]
    stated = open_samples(dataclasses.replace(samples.file, stated_samples=11))
    assert "states 11" in stated.notes[1]


@pytest.mark.parametrize("content", [b"", b"\0"])
def test_files_without_a_sample_are_refused(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(InputFileError, match="at least one sample"):
        reader(tmp_path / "x.bin", content)


def test_unusable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="No such file"):
        open_samples(band_file(tmp_path / "none.bin"))
    with pytest.raises(InputFileError, match="a regular file"):
        open_samples(band_file(tmp_path))
    samples = reader(tmp_path / "x.bin", bytes(20))
    (tmp_path / "x.bin").write_bytes(bytes(10))
    with pytest.raises(InputFileError, match="found 10 values, expected 20"):
        samples.read(1000, 10)


def test_numbers_that_are_none_are_refused(tmp_path: Path) -> None:
    form = SampleFormat(component="float32", layout="iq")
    samples = reader(tmp_path / "x.bin", np.array([1, 2, np.inf, 3], np.float32).tobytes(), form)
    assert samples.samples(1000, 1).tolist() == [1 + 2j]
    with pytest.raises(InputFileError, match="sample 1001"):
        samples.samples(1000, 2)


def test_time_must_be_told(tmp_path: Path) -> None:
    samples = reader(tmp_path / "x.bin", bytes(20))
    untimed = SampleReader(file=dataclasses.replace(samples.file, start=None), n_samples=10)
    assert len(untimed.samples(1000, 3)) == 3
    with pytest.raises(InputFileError, match="start time"):
        untimed.read(1000, 3)
