from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
import sigmf
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from vestige.errors import InputFileError
from vestige.recording.samples.sample_file import open_samples
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_file import read_collection, read_sigmf
from vestige.recording.samples.sigmf_writer import SigmfWriter, write_collection, write_sigmf
from vestige.records import Band, SampleBatch
from vestige.time import GalileoTime

CF32 = SampleFormat(component="float32", layout="iq")
CARRIER = {Band.E1: 1575.42e6, Band.E6: 1278.75e6}

times = st.builds(
    GalileoTime, st.integers(950, 4000), st.integers(0, 604_799), st.floats(0, 1, exclude_max=True)
)  # after the last leap second: within one, UTC has no name for the time


def batch(
    samples: np.ndarray, *, band: Band = Band.E6, first: int = 77, start: GalileoTime | None = None
) -> SampleBatch:
    return SampleBatch(
        band=band, samples=samples.astype(np.complex64), sample_rate_hz=12.5e6, center_frequency_hz=CARRIER[band],
        first_sample=first, start=start or GalileoTime(1161, 348018, 0.1234567890123),
    )  # fmt: skip


def noise(n_samples: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (rng.normal(size=n_samples) + 1j * rng.normal(size=n_samples)).astype(np.complex64)


components = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(
    samples=hnp.arrays(np.float32, st.integers(1, 40).map(lambda n: 2 * n), elements=components),
    start=times, first=st.integers(0, 1 << 50), inverted=st.booleans(),
)  # fmt: skip
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
def test_what_is_written_is_read_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, samples: np.ndarray, start: GalileoTime, first: int, inverted: bool
) -> None:
    folder = tmp_path_factory.mktemp("sigmf")
    original = batch(samples.view(np.complex64), first=first, start=start)
    meta = write_sigmf(folder / "e6", [original], form=CF32, spectral_inversion=inverted)
    file = read_sigmf([meta], described_in=meta).bands[Band.E6]
    again = open_samples(file).read(first, len(original.samples))
    assert again.samples.tobytes() == original.samples.tobytes()
    assert again.start == start
    for name in ("band", "sample_rate_hz", "center_frequency_hz", "first_sample"):
        assert getattr(again, name) == getattr(original, name)


def test_written_in_pieces_equals_written_at_once(tmp_path: Path) -> None:
    samples = noise(1000)
    whole = write_sigmf(tmp_path / "whole", [batch(samples)], form=CF32)
    with SigmfWriter(tmp_path / "pieces", form=CF32) as writer:
        for first in range(0, 1000, 300):
            writer.append(batch(samples[first : first + 300], first=77 + first))
    assert (tmp_path / "pieces.sigmf-data").read_bytes() == (tmp_path / "whole.sigmf-data").read_bytes()
    assert writer.meta.read_text() == whole.read_text()


def test_the_sigmf_library_opens_and_validates_it(tmp_path: Path) -> None:
    samples = noise(64)
    metas = []
    for band in Band:
        form = SampleFormat(component="int16", layout="iq")
        metas.append(
            write_sigmf(
                tmp_path / band.name, [batch(samples, band=band)], form=form, scale=1000, bandwidth_hz=10e6,
                time_uncertainty_s=0.5, description="noise",
            )
        )  # fmt: skip
        opened = sigmf.fromfile(metas[-1])  # also compares the hash of the samples
        opened.validate()
        assert opened.get_captures()[0]["core:datetime"] == "2021-11-25T00:40:00.123456Z"
        assert opened.get_captures()[0]["core:global_index"] == 77
        assert np.allclose(opened.read_samples(), np.round(samples * 1000) / 32768, atol=1e-7)
    collection = write_collection(tmp_path / "both", metas)
    opened = sigmf.fromfile(collection)
    assert opened.get_stream_names() == ["E1", "E6"]
    assert opened.get_SigMFFile(stream_name="E6").get_global_field("core:datatype") == "ci16_le"
    description = read_collection(collection)
    assert description.time_uncertainty_s == 0.5
    assert {file.bandwidth_hz for file in description.bands.values()} == {10e6}
    assert all(open_samples(file).hash_agrees() for file in description.bands.values())


def test_a_cut_or_changed_file_is_noticed(tmp_path: Path) -> None:
    meta = write_sigmf(tmp_path / "x", [batch(noise(100))], form=CF32)
    file = read_sigmf([meta], described_in=meta).bands[Band.E6]
    content = file.path.read_bytes()
    assert file.sha512 == hashlib.sha512(content).hexdigest()
    file.path.write_bytes(content[:-4])
    cut = open_samples(file)
    assert cut.n_samples == 99
    assert len(cut.notes) == 2
    assert cut.hash_agrees() is False
    assert open_samples(dataclasses.replace(file, sha512=None)).hash_agrees() is None


def test_batches_must_follow(tmp_path: Path) -> None:
    with SigmfWriter(tmp_path / "x", form=CF32) as writer:
        writer.append(batch(noise(10)))
        with pytest.raises(ValueError, match="starts at sample 88, not 87"):
            writer.append(batch(noise(10), first=88))
        with pytest.raises(ValueError, match="band changes"):
            writer.append(batch(noise(10), band=Band.E1, first=87))


def test_nothing_half_written_looks_like_a_recording(tmp_path: Path) -> None:
    def interrupted() -> Iterator[SampleBatch]:
        yield batch(noise(10))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_sigmf(tmp_path / "x", interrupted(), form=CF32)
    with pytest.raises(ValueError, match="must have samples"):
        write_sigmf(tmp_path / "x", [], form=CF32)
    assert list(tmp_path.iterdir()) == []


def test_existing_recordings_are_kept(tmp_path: Path) -> None:
    meta = write_sigmf(tmp_path / "x", [batch(noise(10))], form=CF32)
    before = meta.read_bytes()
    with pytest.raises(InputFileError, match="expected a new name"):
        write_sigmf(tmp_path / "x", [batch(noise(20))], form=CF32)
    write_collection(tmp_path / "c", [meta])
    with pytest.raises(InputFileError, match="expected a new name"):
        write_collection(tmp_path / "c", [meta])
    assert meta.read_bytes() == before


def test_a_time_within_a_leap_second_has_no_utc_label(tmp_path: Path) -> None:
    leap = GalileoTime.from_utc(datetime(2016, 12, 31, 23, 59, 59)) + 1.5
    meta = write_sigmf(tmp_path / "x", [batch(noise(10), start=leap)], form=CF32)
    assert "core:datetime" not in sigmf.fromfile(meta).get_captures()[0]
    assert read_sigmf([meta], described_in=meta).bands[Band.E6].start == leap
