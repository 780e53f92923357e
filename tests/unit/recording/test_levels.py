from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.errors import InputFileError
from vestige.recording import adc_statistics as module
from vestige.recording.adc_statistics import adc_statistics
from vestige.recording.description import BandFile
from vestige.recording.samples.sample_file import SampleReader, open_samples
from vestige.recording.samples.sample_format import SampleFormat, encode
from vestige.records import Band

RATE = 12.5e6


def reader(path: Path, samples: np.ndarray, form: SampleFormat, *, center: float, scale: float = 1.0) -> SampleReader:
    path.write_bytes(encode(samples.astype(np.complex64), form, scale=scale).tobytes())
    return open_samples(
        BandFile(band=Band.E1, path=path, described_in=path, form=form, sample_rate_hz=RATE, center_frequency_hz=center)
    )


def band_noise(n_samples: int, center: float, width: float) -> np.ndarray:
    """White noise plus noise of power 100 in `width` Hz around `center` Hz."""
    rng = np.random.default_rng(5)
    frequency = np.fft.fftfreq(n_samples, 1 / RATE)
    spectrum = rng.normal(size=n_samples) + 1j * rng.normal(size=n_samples)
    return np.fft.ifft(spectrum * np.where(np.abs(frequency - center) < width / 2, 10.0, 1.0)) * np.sqrt(n_samples)


def test_counts_by_hand(tmp_path: Path) -> None:
    samples = np.array([1 + 3j, -3 + 1j, -1 - 1j, 1 - 1j])
    got = adc_statistics(reader(tmp_path / "x", samples, SampleFormat(component="int8", layout="iq"), center=1575.42e6))
    assert (got.n_distinct, got.outermost, got.outermost_fraction) == (4, 3.0, 0.25)
    assert got.rms == pytest.approx(np.sqrt(24 / 8))
    assert got.mean == -0.5 + 0.5j
    assert got.spectral_center_hz is None


@pytest.mark.parametrize("offset", [-3e6, 0.0, 2e6])
def test_spectral_center_of_complex_samples(tmp_path: Path, offset: float) -> None:
    samples = band_noise(1 << 16, offset, 4e6)
    got = adc_statistics(
        reader(tmp_path / "x", samples, SampleFormat(component="int16", layout="iq"), center=1575e6, scale=50)
    )
    assert got.spectral_center_hz == pytest.approx(1575e6 + offset, abs=50e3)


@pytest.mark.parametrize("center", [1572.42e6, 1578.42e6])  # mixed from below and from above
def test_spectral_center_of_real_samples(tmp_path: Path, center: float) -> None:
    samples = band_noise(1 << 16, 3e6, 2e6).real
    got = adc_statistics(
        reader(tmp_path / "x", samples, SampleFormat(component="int16", layout="real"), center=center, scale=50)
    )
    assert got.spectral_center_hz == pytest.approx(1575.42e6, abs=50e3)


def test_a_dead_front_end_has_no_center(tmp_path: Path) -> None:
    got = adc_statistics(
        reader(tmp_path / "x", np.full(5000, 7.0), SampleFormat(component="int8", layout="iq"), center=1575e6)
    )
    assert got.spectral_center_hz is None
    assert got.n_distinct == 2


def test_only_the_beginning_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    form = SampleFormat(component="float32", layout="iq")
    source = reader(tmp_path / "x", np.ones(100), form, center=1575e6)
    content = bytearray(source.file.path.read_bytes())
    content[-4:] = np.float32(np.nan).tobytes()
    source.file.path.write_bytes(content)
    with pytest.raises(InputFileError, match="sample 99"):
        adc_statistics(source)
    monkeypatch.setattr(module, "LOOKED_AT", 99)
    assert adc_statistics(source).rms > 0
