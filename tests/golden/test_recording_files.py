"""The real simultaneous recording of E1 and E6, described by hand and read; facts of protocol section 9.1."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.recording.adc_statistics import adc_statistics
from vestige.recording.recording import Recording, open_recording
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import write_collection, write_sigmf
from vestige.records import Band
from vestige.time import GalileoTime


@pytest.fixture
def recording(tmp_path: Path, recording_data: Path) -> Recording:
    (tmp_path / "recording.toml").write_text(f"""
        start = "2021-11-25T00:40:00 UTC"
        time_uncertainty_s = 1.0
        sample_rate_hz = 12e6
        [e1]
        file = "{recording_data}/L1_20211125_004000_12MHz_I.bin"
        format = "int8"
        layout = "real"
        center_frequency_hz = 1572.42e6
        bandwidth_hz = 4.2e6
        [e6]
        file = "{recording_data}/L6_20211125_004000_12MHz_IQ.bin"
        format = "int8"
        layout = "iq"
        center_frequency_hz = 1278.75e6
        spectral_inversion = true
        bandwidth_hz = 8.7e6
    """)
    return open_recording(tmp_path)


@pytest.mark.judged(
    by="independent program",
    what="reading of raw samples",
    figure="1,200,000 samples in 0.1 s, rms within 0.002",
)
def test_what_is_in_it(recording: Recording) -> None:
    assert recording.e1 is not None
    assert recording.e6 is not None
    assert recording.notes == ()
    for reader, rms in ((recording.e1, 1.904), (recording.e6, 1.843)):
        assert (reader.n_samples, reader.duration_s) == (1_200_000, 0.1)
        assert reader.start == GalileoTime(1161, 348018)  # 18 leap seconds
        found = adc_statistics(reader)
        assert (found.n_distinct, found.outermost) == (4, 3.0)
        assert found.rms == pytest.approx(rms, abs=2e-3)
    center = adc_statistics(recording.e1).spectral_center_hz
    assert center == pytest.approx(1575.42e6, abs=0.3e6)  # the intermediate frequency of 3 MHz


def test_samples_are_those_of_the_files(recording: Recording, recording_data: Path) -> None:
    assert recording.e1 is not None
    assert recording.e6 is not None
    l1 = np.fromfile(recording_data / "L1_20211125_004000_12MHz_I.bin", np.int8)
    l6 = np.fromfile(recording_data / "L6_20211125_004000_12MHz_IQ.bin", np.int8)
    e1 = np.concatenate([batch.samples for batch in recording.e1.blocks(100_001)])
    assert np.array_equal(e1.real, l1)
    assert not e1.imag.any()
    e6 = recording.batch(Band.E6, GalileoTime(1161, 348018, 0.05), 0.016)
    assert e6 is not None
    assert (e6.first_sample, len(e6.samples)) == (600_000, 192_000)
    assert np.array_equal(e6.samples.real, l6[1_200_000:1_584_000:2])
    assert np.array_equal(e6.samples.imag, -l6[1_200_001:1_584_000:2])  # I - jQ: the spectrum is turned round


def test_as_sigmf_it_is_the_same(recording: Recording, tmp_path: Path, recording_data: Path) -> None:
    folder = tmp_path / "sigmf"
    folder.mkdir()
    metas = []
    for reader in (recording.e1, recording.e6):
        assert reader is not None
        metas.append(
            write_sigmf(
                folder / reader.band.name, reader.blocks(1 << 18), form=reader.file.form,
                spectral_inversion=reader.file.spectral_inversion, bandwidth_hz=reader.file.bandwidth_hz,
            )
        )  # fmt: skip
    write_collection(folder / "recording", metas)
    assert (folder / "E1.sigmf-data").read_bytes() == (recording_data / "L1_20211125_004000_12MHz_I.bin").read_bytes()
    assert (folder / "E6.sigmf-data").read_bytes() == (recording_data / "L6_20211125_004000_12MHz_IQ.bin").read_bytes()
    again = open_recording(folder)
    for reader, other in ((recording.e1, again.e1), (recording.e6, again.e6)):
        assert reader is not None
        assert other is not None
        assert other.file.form == SampleFormat(component="int8", layout=reader.file.form.layout)
        ours, theirs = reader.read(0, 1_200_000), other.read(0, 1_200_000)
        assert ours.samples.tobytes() == theirs.samples.tobytes()
        assert (ours.start, ours.center_frequency_hz) == (theirs.start, theirs.center_frequency_hz)
