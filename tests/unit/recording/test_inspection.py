from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from hypothesis import event, given, settings
from hypothesis import strategies as st

from simulated_chain import make_chain
from vestige.constants import SUBFRAME_S
from vestige.crypto.keys.key_file import write_key_file
from vestige.crypto.recs import recs_file
from vestige.crypto.recs import recs_segment as recs
from vestige.errors import InputFileError, VestigeError
from vestige.recording.inspection import Inspection, inspect_recording
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import write_sigmf
from vestige.records import Band, ChipSequence, E1Observation, SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

START = GalileoTime(1161, 348018)
CARRIER = {Band.E1: 1575.42e6, Band.E6: 1278.75e6}
INT8 = SampleFormat(component="int8", layout="iq")


def write_band(folder: Path, band: Band, samples: np.ndarray | None = None, uncertainty: float | None = 1.0) -> Path:
    if samples is None:
        rng = np.random.default_rng(3)
        samples = rng.normal(size=200_000) + 1j * rng.normal(size=200_000)
    batch = SampleBatch(
        band=band, samples=samples.astype(np.complex64), sample_rate_hz=1e6, center_frequency_hz=CARRIER[band],
        first_sample=0, start=START,
    )  # fmt: skip
    return write_sigmf(folder / band.name, [batch], form=INT8, scale=20, time_uncertainty_s=uncertainty)


def write_observations(folder: Path, *, second: float) -> None:
    observation = E1Observation(
        svid=11, pseudorange_m=2.4e7, carrier_phase_cycles=0.0, doppler_hz=0.0, doppler_rate_hz_per_s=0.0, cn0_dbhz=45.0
    )
    epochs = [ObservationEpoch(time=START + second + i, observations={11: observation}) for i in range(3)]
    write_csv_observations(folder / "log.csv", epochs)


def write_recs(folder: Path, transmit_time: GalileoTime) -> None:
    chips = np.random.default_rng(1).choice(np.array([-1, 1], np.int8), 5115)
    sequence = ChipSequence.of(svid=11, transmit_time=transmit_time, chip_rate_hz=5.115e6, chips=chips)
    recs_file.write_recs_file(
        recs_file.from_segments([recs.encrypt(sequence, bytes(16), key_delay=1)], provider="GSCX"), folder
    )


def said(found: Inspection, text: str) -> bool:
    return any(line.startswith(text) for line in found.missing)


def test_what_is_there_is_found(tmp_path: Path) -> None:
    for band in Band:
        write_band(tmp_path, band)
    write_observations(tmp_path, second=0.0)
    write_recs(tmp_path, START + 0.1)
    found = inspect_recording(tmp_path, check_hash=True)
    assert [band.reader.band for band in found.bands] == [Band.E1, Band.E6]
    assert all(band.hash_agrees for band in found.bands)
    assert found.observations is not None
    assert (found.observations.n_epochs, found.observations.satellites) == (3, (11,))
    assert found.observations.span == (START, START + 2)
    assert [segment.svid for segment in found.recorded_segments] == [11]
    assert found.notes == ()
    assert not said(found, "no ")


@pytest.mark.parametrize(
    ("bands", "text"),
    [([Band.E1], "no E6 samples"), ([Band.E6], "no E1: neither samples nor observations")],
)
def test_a_missing_band_is_missed(tmp_path: Path, bands: list[Band], text: str) -> None:
    for band in bands:
        write_band(tmp_path, band)
    assert said(inspect_recording(tmp_path), text)


def test_observations_stand_for_e1_if_they_are_of_this_time(tmp_path: Path) -> None:
    write_band(tmp_path, Band.E6)
    write_observations(tmp_path, second=0.0)
    assert not said(inspect_recording(tmp_path), "no ")
    write_observations(tmp_path, second=100.0)
    assert said(inspect_recording(tmp_path), "no observations for this time: log.csv has 2021-11-25T00:41:58.000 GST")


@pytest.mark.parametrize(
    ("uncertainty", "text"),
    [
        (None, "no time uncertainty"),
        (30.0, "time uncertainty too large: the receiver clock may be wrong by 30 s"),
        (29.9, ""),
    ],
)
def test_the_clock_must_be_sure(tmp_path: Path, uncertainty: float | None, text: str) -> None:
    for band in Band:
        write_band(tmp_path, band, uncertainty=uncertainty)
    found = inspect_recording(tmp_path)
    assert said(found, text) if text else not said(found, "no ")
    assert not said(inspect_recording(tmp_path, time_uncertainty_s=1.0), "no ")


def test_recs_of_another_time_do_not_help(tmp_path: Path) -> None:
    for band in Band:
        write_band(tmp_path, band)
    write_recs(tmp_path, START + 30)
    found = inspect_recording(tmp_path)
    assert found.recorded_segments == ()
    assert said(found, "no RECS for this time")
    other = inspect_recording(tmp_path, start=START + 30)
    assert len(other.recorded_segments) == 1
    assert not said(other, "no RECS")


@pytest.mark.parametrize(("uncertainty", "proven"), [(20.0, True), (28.0, False)])
def test_the_clock_must_be_sure_before_each_key_is_on_air(tmp_path: Path, uncertainty: float, proven: bool) -> None:
    chain = make_chain(bytes(32), START, 4)
    key = next(key for key in chain.validated_keys() if key.time == START.subframe + SUBFRAME_S)
    write_band(tmp_path, Band.E6, uncertainty=uncertainty)
    start = START + 10.0
    write_recs(tmp_path, start + 0.1)
    write_key_file(tmp_path / "keys.csv", [key], [chain.root])
    pem = chain.private_key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    (tmp_path / "public_key.pem").write_bytes(pem)
    assert 21.0 < key.disclosed_at - start < 27.0
    assert said(inspect_recording(tmp_path, start=start), "time uncertainty too large for 1 of 1 RECS") is not proven


def test_a_time_must_be_told(tmp_path: Path) -> None:
    (tmp_path / "l6.bin").write_bytes(bytes(range(200)))
    (tmp_path / "recording.toml").write_text(
        'sample_rate_hz = 12e6\n[e6]\nfile = "l6.bin"\nformat = "int8"\nlayout = "iq"\n'
        "center_frequency_hz = 1278.75e6\n"
    )
    assert said(inspect_recording(tmp_path), "no start time")
    assert not said(inspect_recording(tmp_path, start=START), "no start time")
    assert inspect_recording(tmp_path, start=GalileoTime(0, 0)).recorded_segments == ()  # nothing comes before


def note_of(folder: Path, samples: np.ndarray) -> str:
    write_band(folder, Band.E6, samples)
    (note,) = inspect_recording(folder).notes
    return note


def test_odd_samples_are_noted(tmp_path: Path) -> None:
    tone = 2.5 * np.exp(2j * np.pi * 0.4 * np.arange(20_000))
    noise = np.random.default_rng(1).normal(size=20_000)
    for name, samples, text in (
        ("dead", np.full(2000, 3.0 + 1j), "all samples are equal"),
        ("clip", noise * 10 + 1j * noise[::-1] * 10, "the samples clip"),
        ("aside", tone + 0.1 * noise, "far from the carrier"),
    ):
        folder = tmp_path / name
        folder.mkdir()
        assert text in note_of(folder, samples)


def test_changed_samples_are_noted_when_asked(tmp_path: Path) -> None:
    write_band(tmp_path, Band.E6)
    data = tmp_path / "E6.sigmf-data"
    data.write_bytes(data.read_bytes()[::-1])
    assert inspect_recording(tmp_path).notes == ()
    assert "SHA-512" in inspect_recording(tmp_path, check_hash=True).notes[0]


@given(name=st.sampled_from(["E1.sigmf-meta", "E6.sigmf-data", "log.csv"]), data=st.data())
@settings(max_examples=60)
def test_a_damaged_recording_is_inspected_or_refused(
    tmp_path_factory: pytest.TempPathFactory, name: str, data: st.DataObject
) -> None:
    folder = tmp_path_factory.getbasetemp() / "damaged"
    if not folder.exists():
        folder.mkdir()
        for band in Band:
            write_band(folder, band, np.arange(2000) % 7 + 0j)
        write_observations(folder, second=0.0)
    path = folder / name
    content = path.read_bytes()
    cut, garbage = data.draw(st.integers(0, len(content))), data.draw(st.binary(max_size=30))
    try:
        path.write_bytes(content[:cut] + garbage)
        found = inspect_recording(folder)
        assert found.bands
        assert found.missing
    except VestigeError as error:
        line = str(error)
        event(line.split(": ", 1)[1][:40])
    finally:
        path.write_bytes(content)


def test_folders_and_files_without_samples(tmp_path: Path) -> None:
    write_observations(tmp_path, second=0.0)
    for path in (tmp_path, tmp_path / "log.csv"):
        found = inspect_recording(path)
        assert (found.description, found.bands) == (None, ())
        assert found.observations is not None
        assert said(found, "no E6 samples")
    (tmp_path / "x.bin").write_bytes(bytes(20))
    for name in ("x.bin", "nothing"):
        with pytest.raises(InputFileError):
            inspect_recording(tmp_path / name)
