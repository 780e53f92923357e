from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError, VestigeError
from vestige.recording.description import RecordingDescription
from vestige.recording.recording_toml import read_recording_toml
from vestige.records import Band
from vestige.time import GalileoTime

TEXT = """
start = "2021-11-25T00:40:00.000000123 UTC"
time_uncertainty_s = 1.0
sample_rate_hz = 12e6

[e1]
file = "L1.bin"
format = "int8"
layout = "real"
center_frequency_hz = 1572.42e6
bandwidth_hz = 4.2e6

[e6]
file = "L6.bin"
format = "int16"
layout = "iq"
center_frequency_hz = 1278.75e6
spectral_inversion = true
first_sample = 6_000_000
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("L1.bin", "L6.bin", "obs.rnx"):
        (tmp_path / name).write_bytes(bytes(8))
    return tmp_path


def write(folder: Path, text: str) -> Path:
    path = folder / "recording.toml"
    path.write_text(text)
    return path


def test_everything_is_read(folder: Path) -> None:
    description = read_recording_toml(write(folder, TEXT + '[observations]\nfile = "obs.rnx"\n'))
    e1, e6 = description.bands[Band.E1], description.bands[Band.E6]
    assert (str(e1.form), str(e6.form)) == ("int8 real", "int16 I,Q")
    assert e1.path == folder / "L1.bin"
    assert (e1.center_frequency_hz, e1.bandwidth_hz, e1.spectral_inversion) == (1572.42e6, 4.2e6, False)
    assert (e6.first_sample, e6.spectral_inversion, e6.bandwidth_hz) == (6_000_000, True, None)
    assert e1.start == GalileoTime(1161, 348018, 1.23e-7)
    assert e6.start == GalileoTime(1161, 348018, 0.5 + 1.23e-7)
    assert description.time_uncertainty_s == 1.0
    assert description.observations == folder / "obs.rnx"


def test_optional_keys_may_be_left_out(folder: Path) -> None:
    text = TEXT.replace('start = "2021-11-25T00:40:00.000000123 UTC"', "").replace("time_uncertainty_s = 1.0", "")
    description = read_recording_toml(write(folder, text))
    assert description.bands[Band.E1].start is None
    assert description.time_uncertainty_s == float("inf")


def test_bands_of_different_rates_share_time_zero(folder: Path) -> None:
    e6 = read_recording_toml(write(folder, TEXT + "sample_rate_hz = 24e6")).bands[Band.E6]
    assert e6.sample_rate_hz == 24e6
    assert e6.start == GalileoTime(1161, 348018, 0.25 + 1.23e-7)


@pytest.mark.parametrize(
    ("old", "new", "place", "expected"),
    [
        ("sample_rate_hz = 12e6", "", "sample_rate_hz", "a value"),
        ("sample_rate_hz = 12e6", "sample_rate_hz = nan", "sample_rate_hz", "a finite number"),
        ("sample_rate_hz = 12e6", "sample_rate_hz = 1e11", "sample_rate_hz", "less than or equal to 10000000000"),
        ("sample_rate_hz = 12e6", "sample_rate_hz = -12e6", "sample_rate_hz", "greater than or equal to 100000"),
        ("sample_rate_hz = 12e6", 'sample_rate_hz = "12e6"', "sample_rate_hz", "a valid number"),
        ("sample_rate_hz = 12e6", "sample_rate_hz = true", "sample_rate_hz", "a valid number"),
        ("sample_rate_hz = 12e6", "sampling_rate = 12e6", "sampling_rate", "one of start, time_uncertainty_s"),
        ("time_uncertainty_s = 1.0", "time_uncertainty_s = -1", "time_uncertainty_s", "greater than or equal to 0"),
        ("time_uncertainty_s = 1.0", "time_uncertainty_s = inf", "time_uncertainty_s", "a finite number"),
        ("time_uncertainty_s", "clock_error_s", "clock_error_s", "one of start, time_uncertainty_s"),
        ('"2021-11-25T00:40:00.000000123 UTC"', '"noon"', "start", "a time, such as"),
        ('"2021-11-25T00:40:00.000000123 UTC"', '"9999-12-31T23:59:59 UTC"', "start", "a time, such as"),
        ('"2021-11-25T00:40:00.000000123 UTC"', "2021-11-25T00:40:00Z", "start", "a valid string"),
        ('format = "int8"', 'format = "int4"', "e1.format", "'int8', 'uint8'"),
        ('layout = "real"', 'layout = "IQ"', "e1.layout", "'real', 'iq' or 'qi'"),
        ('file = "L1.bin"', 'file = "L5.bin"', "e1.file", "the name of a file"),
        ('file = "L1.bin"', f'file = "{"x" * 300}"', "e1.file", "the name of a file"),
        ('file = "L1.bin"', 'file = "."', "e1.file", "the name of a file"),
        ('file = "L1.bin"', 'file = "\\u0000"', "e1.file", "the name of a file"),
        ("1572.42e6", "1278.75e6", "e1.center_frequency_hz", "the E1 carrier within half a sample rate"),
        ("1572.42e6", "1560e6", "e1.center_frequency_hz", "the E1 carrier within half a sample rate"),
        ("first_sample = 6_000_000", "first_sample = -1", "e6.first_sample", "greater than or equal to 0"),
        ("first_sample = 6_000_000", "first_sample = 1.5", "e6.first_sample", "a valid integer"),
        ("first_sample = 6_000_000", "first_sampel = 6", "e6.first_sampel", "one of file, format"),
        ("bandwidth_hz = 4.2e6", "bandwidth_hz = 0", "e1.bandwidth_hz", "greater than 0"),
        ("[e6]", "[e5]", "e5", "one of start"),
        ("[e1]", "[e1", "content", "a TOML file"),
        ("[e1]", "x = " + "[" * 5000, "content", "a TOML file"),
        ("[e1]", "x = " + "1" * 5000, "content", "a TOML file"),
    ],
)  # fmt: skip
def test_bad_values_are_named(folder: Path, old: str, new: str, place: str, expected: str) -> None:
    assert old in TEXT
    path = write(folder, TEXT.replace(old, new, 1))
    with pytest.raises(InputFileError) as caught:
        read_recording_toml(path)
    assert caught.value.place == place
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_recording_has_samples(folder: Path) -> None:
    with pytest.raises(InputFileError, match="at least one band"):
        read_recording_toml(write(folder, "sample_rate_hz = 12e6"))
    with pytest.raises(InputFileError, match="readable file"):
        read_recording_toml(folder / "other.toml")


def refusal(read: Callable[[], RecordingDescription]) -> str:
    """The one line with which a file is refused, or an empty text."""
    try:
        assert read().bands
    except VestigeError as error:
        return str(error)
    return ""


@given(cut=st.integers(0, len(TEXT)), garbage=st.binary(max_size=20))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
def test_garbage_is_one_clear_line_or_a_recording(folder: Path, cut: int, garbage: bytes) -> None:
    path = folder / "recording.toml"
    path.write_bytes(TEXT[:cut].encode() + garbage + TEXT[cut + len(garbage) :].encode())
    line = refusal(lambda: read_recording_toml(path))
    assert not line or (line.startswith(f"{path}: ") and line.isprintable())
