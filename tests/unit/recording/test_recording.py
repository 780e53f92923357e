from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError, UnsupportedError
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.recording import describe_recording, find_recording, open_recording
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import write_collection, write_sigmf
from vestige.records import Band, E1Observation, SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

START = GalileoTime(1161, 348018, 0.1)
RATE = 12.5e6
CARRIER = {Band.E1: 1575.42e6, Band.E6: 1278.75e6}
INT16 = SampleFormat(component="int16", layout="iq")


def batch(band: Band, n_samples: int = 1000, first: int = 0) -> SampleBatch:
    samples = np.arange(n_samples) - 1j * np.arange(n_samples)
    return SampleBatch(
        band=band, samples=samples.astype(np.complex64), sample_rate_hz=RATE, center_frequency_hz=CARRIER[band],
        first_sample=first, start=START + first / RATE,
    )  # fmt: skip


OBSERVATION = E1Observation(
    svid=5, pseudorange_m=2.4e7, carrier_phase_cycles=1.26e8, doppler_hz=100.0, doppler_rate_hz_per_s=0.0, cn0_dbhz=45.0
)


def write_recording(folder: Path, *, collection: bool = True) -> Path:
    metas = [write_sigmf(folder / band.name, [batch(band, first=200 * (band is Band.E6))], form=INT16) for band in Band]
    if collection:
        write_collection(folder / "both", metas)
    write_csv_observations(folder / "e1_log.csv", [ObservationEpoch(time=START, observations={5: OBSERVATION})])
    (folder / "keys.csv").write_text("week,second,key\n")
    return folder


def write_toml(folder: Path, start: str = 'start = "1161:348018.1"') -> Path:
    (folder / "l1.bin").write_bytes(bytes(range(200)))
    (folder / "recording.toml").write_text(
        f'{start}\nsample_rate_hz = 12.5e6\ntime_uncertainty_s = 2\n[e1]\nfile = "l1.bin"\nformat = "int8"\n'
        'layout = "iq"\ncenter_frequency_hz = 1575.42e6\nfirst_sample = 50\n'
    )
    return folder


@pytest.mark.parametrize("collection", [True, False])
def test_sigmf_folder(tmp_path: Path, collection: bool) -> None:
    recording = open_recording(write_recording(tmp_path, collection=collection))
    assert recording.e1 is not None
    assert recording.e6 is not None
    assert recording.observations is not None
    assert recording.reader(Band.E6) is recording.e6
    assert (recording.e1.first_sample, recording.e6.first_sample) == (0, 200)
    assert recording.e6.start - recording.e1.start == pytest.approx(16e-6, abs=1e-15)
    assert recording.observations.path.name == "e1_log.csv"
    assert [dict(epoch.observations) for epoch in recording.observations] == [{5: OBSERVATION}]
    assert recording.notes == ()
    both = recording.e1.read(300, 10), recording.e6.read(300, 10)
    assert abs(both[0].start - both[1].start) < 1e-15


def test_files_name_themselves(tmp_path: Path) -> None:
    write_recording(tmp_path)
    assert set(open_recording(tmp_path / "both.sigmf-collection").description.bands) == set(Band)
    for name in ("E6.sigmf-meta", "E6.sigmf-data"):
        assert set(open_recording(tmp_path / name).description.bands) == {Band.E6}
    write_toml(tmp_path)
    assert set(open_recording(tmp_path / "recording.toml").description.bands) == {Band.E1}
    assert find_recording(tmp_path) == tmp_path / "recording.toml"  # the hand-written description counts first


def test_a_whole_recording_in_memory_and_out_of_the_file_are_the_same(tmp_path: Path) -> None:
    original = batch(Band.E6, first=77)
    recording = open_recording(write_sigmf(tmp_path / "x", [original], form=INT16))
    again = recording.batch(Band.E6, original.start, 1000 / RATE)
    assert again is not None
    assert again.samples.tobytes() == original.samples.tobytes()
    assert (again.start, again.first_sample) == (original.start, 77)


@given(first=st.integers(-50, 1100), count=st.integers(1, 1300), early=st.floats(0.01, 0.99))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
def test_windows(tmp_path_factory: pytest.TempPathFactory, first: int, count: int, early: float) -> None:
    folder = tmp_path_factory.getbasetemp() / "windows"
    if not folder.exists():
        folder.mkdir()
        write_sigmf(folder / "x", [batch(Band.E1)], form=INT16)
    recording = open_recording(folder)
    for start in (START + first / RATE, START + (first - early) / RATE):
        got = recording.batch(Band.E1, start, count / RATE)
        expected = [n for n in range(first, first + count) if 0 <= n < 1000]
        if not expected:
            assert got is None
            continue
        assert got is not None
        assert got.first_sample == expected[0]
        assert got.samples.real.tolist() == expected
        assert got.start - START == pytest.approx(expected[0] / RATE, abs=1e-15)


def test_windows_must_have_a_length(tmp_path: Path) -> None:
    recording = open_recording(write_toml(tmp_path))
    assert recording.batch(Band.E6, START, 1.0) is None
    for duration in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="window"):
            recording.batch(Band.E1, START, duration)


def test_start_overrides_the_label(tmp_path: Path) -> None:
    other = GalileoTime(1200, 5, 0.25)
    recording = open_recording(write_recording(tmp_path), start=other)
    assert recording.e1 is not None
    assert recording.e6 is not None
    assert recording.e1.start == other
    assert recording.e6.start - other == pytest.approx(200 / RATE, abs=1e-16)


def test_without_a_time_there_must_be_a_start(tmp_path: Path) -> None:
    write_toml(tmp_path, start="")
    with pytest.raises(InputFileError, match="start time: found nothing"):
        open_recording(tmp_path)
    recording = open_recording(tmp_path, start=START)
    assert recording.e1 is not None
    assert recording.e1.start == START  # of the earliest sample, number 50
    assert recording.description.time_uncertainty_s == 2


@pytest.mark.parametrize("name", ["nothing", ".", "l1.bin"])
def test_no_recording(tmp_path: Path, name: str) -> None:
    (tmp_path / "l1.bin").write_bytes(bytes(20))
    with pytest.raises(InputFileError, match=r"expected a recording\.toml"):
        describe_recording(tmp_path / name)


def test_ambiguous_folders_are_refused(tmp_path: Path) -> None:
    write_recording(tmp_path)
    (tmp_path / "more.csv").write_bytes((tmp_path / "e1_log.csv").read_bytes())
    with pytest.raises(InputFileError, match=r"found e1_log\.csv and more\.csv, expected one file"):
        open_recording(tmp_path)
    (tmp_path / "more.csv").unlink()
    (tmp_path / "other.sigmf-collection").write_bytes((tmp_path / "both.sigmf-collection").read_bytes())
    with pytest.raises(InputFileError, match="one collection"):
        open_recording(tmp_path)


def test_archives_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "x.sigmf").write_bytes(b"")
    with pytest.raises(UnsupportedError, match="unpack it"):
        open_recording(tmp_path / "x.sigmf")
