"""The doctor of recordings: each mistake in a description, or in samples, gives its finding; a right one gives none.

Three satellites at 5 MHz, and four of the 36 satellites are looked for, so that a case takes seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from builders import received_batch, satellite
from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ
from vestige.recording.doctor import e1_signals
from vestige.recording.doctor.examination import Examination, _not_finite, examine
from vestige.recording.doctor.finding import Finding, FindingKind, TimeLimit
from vestige.recording.recording import describe_recording
from vestige.recording.samples.sample_file import open_samples
from vestige.recording.samples.sample_format import SampleFormat, encode
from vestige.records import Band

RATE_HZ = 5e6
SVIDS = (3, 8, 12)
SAID_BY_ALL = {FindingKind.E6C_OPEN, FindingKind.DURATION}


@pytest.fixture(autouse=True)
def few_satellites(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(e1_signals, "SVIDS", (*SVIDS, 30))


def sky(delay_m: float = 0.0, power_db: float = 0.0, *, encrypted: bool = False) -> list[dict]:
    found = []
    for number, (svid, rate_mps) in enumerate(zip(SVIDS, (-480.0, 350.0, 520.0), strict=True)):
        one = satellite(svid, 2.4e7 + 3.3e5 * number + delay_m, rate_mps, 48.0 - number + power_db, 48.0 - number)
        if encrypted:  # the secret chips of E6-C are noise to who has not got the key
            pilotless = tuple(part for part in one[Band.E6].components if part.signal.name != "E6-C")
            one = {**one, Band.E6: replace(one[Band.E6], components=pilotless)}
        found.append(one)
    return found


@cache
def samples(band: Band, duration_s: float = 0.125, *, encrypted: bool = False) -> np.ndarray:
    return received_batch(band, sky(encrypted=encrypted), rate_hz=RATE_HZ, duration_s=duration_s).samples


@dataclass
class Made:
    """A recording as it is written: samples as they are stored, and what the description says of them."""

    stored: dict[Band, np.ndarray]
    says: dict[Band, dict[str, object]] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        lines = ['start = "2026-11-21T12:00:16 GST"', "time_uncertainty_s = 1.0", f"sample_rate_hz = {RATE_HZ}"]
        for band, stored in self.stored.items():
            stored.tofile(folder / f"{band.value}.bin")
            lines.append(f"[{band.value.lower()}]")
            lines.extend(
                f"{key} = {str(value).lower() if isinstance(value, bool) else repr(value)}"
                for key, value in self.says[band].items()
            )
        (folder / "recording.toml").write_text("\n".join(lines))
        return folder


def stored(values: np.ndarray, component: str = "int8", layout: str = "iq", scale: float = 0.0) -> np.ndarray:
    form = SampleFormat(component=component, layout=layout)  # type: ignore[arg-type]
    deviation = float(np.std(values.view(np.float32)))
    return encode(values, form, scale=scale or 20.0 / deviation)


def right(**parts: np.ndarray) -> Made:
    carriers = {Band.E1: E1_CARRIER_HZ, Band.E6: E6_CARRIER_HZ}
    made = Made(stored={band: stored(parts.get(band.value, samples(band))) for band in Band})
    for band in Band:
        made.says[band] = {
            "file": f"{band.value}.bin", "format": "int8", "layout": "iq", "center_frequency_hz": carriers[band],
        }  # fmt: skip
    return made


def real_if(values: np.ndarray) -> np.ndarray:
    """Return complex samples as real ones at twice the rate, the carrier at a quarter of it."""
    n = values.size
    spectrum = np.zeros(2 * n, np.complex128)
    spectrum[: n // 2], spectrum[-(n - n // 2) :] = np.fft.fft(values)[: n // 2], np.fft.fft(values)[n // 2 :]
    upper = np.fft.ifft(spectrum) * np.exp(0.5j * np.pi * np.arange(2 * n))
    return upper.real.astype(np.complex64)


def examined(made: Made, folder: Path) -> Examination:
    return examine(describe_recording(made.write(folder)))


def of_faults(found: Examination) -> list[Finding]:
    return [one for one in found.findings if one.is_fault]


def faults(found: Examination) -> list[tuple[FindingKind, Band | None]]:
    return [(one.kind, one.band) for one in of_faults(found)]


def test_a_wrong_rate_is_found_at_42_dbhz_and_the_rates_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Made(stored={Band.E1: stored(weak_e1())})
    made.says[Band.E1] = right().says[Band.E1] | {"sample_rate_hz": 6e6}
    found = examined(made, tmp_path)
    assert "sample_rate_hz = 5000000" in next(one.line for one in of_faults(found))
    monkeypatch.setattr(e1_signals, "rates_by_repetition_hz", lambda *_arguments, **_more: (12.5e6, 6e6, 8e6))
    found = examined(made, tmp_path)
    assert "sampling rates 12.5, 8 Msps" in of_faults(found)[0].line


@cache
def weak_e1() -> np.ndarray:
    return received_batch(Band.E1, sky(power_db=-6.0), rate_hz=RATE_HZ, duration_s=0.125).samples


def test_a_right_description_has_no_fault(tmp_path: Path) -> None:
    found = examined(right(), tmp_path)
    assert faults(found) == []
    assert {one.kind for one in found.findings} == SAID_BY_ALL
    assert [one.svid for one in found.e1] == list(SVIDS)
    for one, cn0_dbhz, rate_mps in zip(found.e1, (48.0, 47.0, 46.0), (-480.0, 350.0, 520.0), strict=True):
        # what E1-B leaves in the pilot's correlator is noise to the estimate: up to 1.2 dB of so strong a signal
        assert one.cn0_dbhz == pytest.approx(cn0_dbhz - 0.5, abs=0.8)
        assert one.doppler_hz == pytest.approx(-rate_mps / 299_792_458 * E1_CARRIER_HZ, abs=2)
    assert [(one.svid, one.e6c_open, one.secondary_fits) for one in found.e6] == [(svid, True, True) for svid in SVIDS]
    assert [one.cn0_dbhz for one in found.e6] == pytest.approx([48.0, 47.0, 46.0], abs=0.6)


def _swapped(made: Made) -> None:
    made.says[Band.E1]["file"], made.says[Band.E6]["file"] = "E6.bin", "E1.bin"


def _says(band: Band, **values: object) -> Callable[[Made], None]:
    return lambda made: made.says[band].update(values)


def _stores(band: Band, change: Callable[[np.ndarray], np.ndarray], **values: object) -> Callable[[Made], None]:
    def make(made: Made) -> None:
        made.stored[band] = change(samples(band))
        made.says[band].update(values)

    return make


def _moved(by_hz: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: stored(
        (values * np.exp(2j * np.pi * by_hz / RATE_HZ * np.arange(values.size))).astype(np.complex64)
    )


IF_SAID = {"layout": "real", "sample_rate_hz": 2 * RATE_HZ, "center_frequency_hz": E1_CARRIER_HZ - RATE_HZ / 2}
MISTAKES = {
    "files of both bands": (_swapped, FindingKind.SWAPPED_BANDS, Band.E1, "exchange the files"),
    "rate of E1": (_says(Band.E1, sample_rate_hz=6e6), FindingKind.SAMPLING_RATE, Band.E1, "sample_rate_hz = 5000000"),
    "rate of E6": (_says(Band.E6, sample_rate_hz=6e6), FindingKind.SAMPLING_RATE, Band.E6, "sample_rate_hz = 5000000"),
    "sense of E1": (
        _says(Band.E1, spectral_inversion=True), FindingKind.REVERSED_SPECTRUM, Band.E1, "spectral_inversion = false",
    ),
    "I and Q of E1": (_says(Band.E1, layout="qi"), FindingKind.REVERSED_SPECTRUM, Band.E1, 'layout = "iq"'),
    "sense of E1 off the carrier": (
        _stores(Band.E1, _moved(1e5), center_frequency_hz=E1_CARRIER_HZ - 1e5, spectral_inversion=True),
        FindingKind.REVERSED_SPECTRUM, Band.E1, "spectral_inversion = false",
    ),
    "sense of E6": (
        _says(Band.E6, spectral_inversion=True), FindingKind.REVERSED_SPECTRUM, Band.E6, "spectral_inversion = false",
    ),
    "complex said of real": (
        _stores(Band.E1, lambda one: stored(real_if(one), layout="real"), **{**IF_SAID, "layout": "iq"}),
        FindingKind.LAYOUT, Band.E1, 'layout = "real"',
    ),
    "real said of complex": (_says(Band.E1, layout="real"), FindingKind.LAYOUT, Band.E1, 'layout = "iq"'),
    "real at twice the rate said of complex": (
        _says(Band.E1, layout="real", sample_rate_hz=2 * RATE_HZ), FindingKind.LAYOUT, Band.E1, 'layout = "iq"',
    ),
    "uint8 said of int8": (_says(Band.E1, format="uint8"), FindingKind.FORMAT, Band.E1, 'format = "int8"'),
    "int8 said of int16": (
        _stores(Band.E1, lambda one: stored(one, "int16", scale=500.0)), FindingKind.FORMAT, Band.E1, '"int16"',
    ),
    "int16 said of int8": (_says(Band.E1, format="int16"), FindingKind.FORMAT, Band.E1, 'format = "int8"'),
    "int16 said of int8 on E6": (_says(Band.E6, format="int16"), FindingKind.FORMAT, Band.E6, 'format = "int8"'),
    "centre of E1": (
        _stores(Band.E1, _moved(18e3)), FindingKind.CENTRE_FREQUENCY, Band.E1, "center_frequency_hz = 157540",
    ),
    "centre of E6": (
        _stores(Band.E6, _moved(-30e3)), FindingKind.CENTRE_FREQUENCY, Band.E6, "center_frequency_hz = 1278780",
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_description_is_found(tmp_path: Path, mistake: str) -> None:
    make, kind, band, advice = MISTAKES[mistake]
    made = right()
    make(made)
    found = examined(made, tmp_path)
    assert faults(found) == [(kind, band)]
    assert advice in of_faults(found)[0].line
    assert [one.svid for one in found.e1] == list(SVIDS)
    assert [one.svid for one in found.e6] == list(SVIDS)


@pytest.mark.slow
def test_an_encrypted_e6c_is_not_open(tmp_path: Path) -> None:
    found = examined(right(E6=samples(Band.E6, encrypted=True)), tmp_path)
    assert faults(found) == []
    assert {one.kind for one in found.findings} == {FindingKind.E6C_ENCRYPTED, FindingKind.DURATION}
    assert [(one.svid, one.e6c_open) for one in found.e6] == [(svid, False) for svid in SVIDS]


@pytest.mark.slow
def test_samples_that_are_missing_are_found(tmp_path: Path) -> None:
    """At 20 ms of E1, in the 100 ms that are searched; 2 ms behind the middle of E6, between two places."""
    e1 = np.delete(samples(Band.E1), np.arange(100_000, 100_360))
    found = examined(right(E1=e1), tmp_path)
    assert (FindingKind.LOST_SAMPLES, Band.E1) in faults(found)
    line = next(one.line for one in of_faults(found) if one.band is Band.E1)
    assert "72.0 µs (360 samples) are missing" in line
    e6 = np.delete(samples(Band.E6), np.arange(322_500, 322_700))
    found = examined(right(E6=e6), tmp_path)
    assert faults(found) == [(FindingKind.LOST_SAMPLES, Band.E6)]
    assert "+40.0 µs" in of_faults(found)[0].line or "200 samples are missing" in of_faults(found)[0].line


@pytest.mark.slow
def test_a_jump_later_in_the_recording_is_placed(tmp_path: Path) -> None:
    """5000 samples, a millisecond, are missing 1.3 s after the first."""
    e1 = np.delete(samples(Band.E1, 2.2), np.arange(6_500_000, 6_505_000))
    found = examined(right(E1=e1, E6=samples(Band.E6)), tmp_path)
    (one,) = [one for one in of_faults(found) if one.kind is FindingKind.LOST_SAMPLES]
    assert one.band is Band.E1
    assert "+1000.0 µs" in one.line
    begin_s, end_s = (float(word) for word in one.line.split("between ")[1].split(" s:")[0].split(" s and "))
    assert 1.3 - 0.45 < begin_s < 1.3 < end_s < 1.3 + 0.45


@pytest.mark.slow
def test_a_jump_of_e6_is_placed(tmp_path: Path) -> None:
    """1000 samples, 200 µs, are missing 0.45 s after the first of E6; the middle is at 0.75 s."""
    e6 = np.delete(samples(Band.E6, 1.6), np.arange(2_250_000, 2_251_000))
    found = examined(right(E1=samples(Band.E1, 1.6), E6=e6), tmp_path)
    (one,) = of_faults(found)
    assert (one.kind, one.band) == (FindingKind.LOST_SAMPLES, Band.E6)
    assert "+200.0 µs" in one.line
    begin_s, end_s = (float(word) for word in one.line.split("between ")[1].split(" s:")[0].split(" s and "))
    assert 0.1 < begin_s < 0.45 < end_s < 0.7


def _looked_for_nan(folder: Path, limit_s: float) -> list[Finding]:
    made = right()
    made.stored[Band.E6] = samples(Band.E6).view(np.float32).copy()
    made.stored[Band.E6][400_001] = np.nan
    made.says[Band.E6]["format"] = "float32"
    reader = open_samples(describe_recording(made.write(folder)).bands[Band.E6])
    return list(_not_finite(reader, TimeLimit(limit_s)))


def test_nan_between_the_places_that_are_looked_at(tmp_path: Path) -> None:
    (one,) = _looked_for_nan(tmp_path, 60.0)
    assert one.is_fault
    assert "sample 200000" in one.line


def test_a_file_too_long_to_be_read_to_its_end_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vestige.recording.doctor.examination._READ_SAMPLES", 50_000)
    monkeypatch.setattr(TimeLimit, "is_over", property(lambda limit: limit.seconds == 0.0))
    (one,) = _looked_for_nan(tmp_path, 0.0)
    assert (one.kind, one.is_fault) == (FindingKind.NOT_FINITE, False)
    assert "in the first 0.0 s of 0.1 s" in one.line


@pytest.mark.slow
def test_bands_that_are_apart_are_found(tmp_path: Path) -> None:
    made = right(E6=samples(Band.E6)[250:])
    found = examined(made, tmp_path)
    assert faults(found) == [(FindingKind.BAND_OFFSET, Band.E6)]
    assert "µs (-250 samples" in of_faults(found)[0].line
    made.says[Band.E6]["first_sample"] = 250
    assert faults(examined(made, tmp_path)) == []


def _broken() -> Iterator[tuple[str, Callable[[Made], None], tuple[FindingKind, Band], str]]:
    def zeros(made: Made) -> None:
        made.stored[Band.E6][:] = 0

    def dead_end(made: Made) -> None:
        made.stored[Band.E6][-300_000:] = 0

    def one_component(made: Made) -> None:
        made.stored[Band.E6][1::2] = 0

    def nan(made: Made) -> None:
        made.stored[Band.E6] = samples(Band.E6).view(np.float32).copy()
        made.stored[Band.E6][-7] = np.nan
        made.says[Band.E6]["format"] = "float32"

    def clipped(made: Made) -> None:
        made.stored[Band.E6] = stored(samples(Band.E6), scale=100.0 / float(np.std(samples(Band.E6).real)))

    def one_bit(made: Made) -> None:
        made.stored[Band.E6] = np.where(made.stored[Band.E6] < 0, -128, 127).astype(np.int8)

    def short(made: Made) -> None:
        made.stored[Band.E1] = made.stored[Band.E1][: 2 * 200_000]

    yield "zeros", zeros, (FindingKind.EMPTY, Band.E6), "one value only (0+0j) at the beginning"
    yield "zeros at the end", dead_end, (FindingKind.EMPTY, Band.E6), "one value only (0+0j) at the end"
    yield "one component", one_component, (FindingKind.EMPTY, Band.E6), "one of I and Q"
    yield "NaN", nan, (FindingKind.NOT_FINITE, Band.E6), "a finite number"
    yield "clipped", clipped, (FindingKind.CLIPPED, Band.E6), "lower the gain"
    yield "clipped to one bit", one_bit, (FindingKind.CLIPPED, Band.E6), "all values are at the ends of the scale"
    yield "short", short, (FindingKind.TOO_SHORT, Band.E1), "E1 lasts 40 ms, too short"


@pytest.mark.slow
@pytest.mark.parametrize("case", list(_broken()), ids=lambda case: case[0])
def test_values_that_are_wrong_are_found(tmp_path: Path, case: tuple) -> None:
    _, make, expected, text = case
    made = right()
    make(made)
    found = examined(made, tmp_path)
    assert expected in faults(found)
    assert text in next(one.line for one in of_faults(found) if one.kind is expected[0])
    assert found.e1 != ()


@pytest.mark.slow
def test_a_second_signal_is_told(tmp_path: Path) -> None:
    both = received_batch(Band.E1, [*sky(), *sky(3e5, -3.0)], rate_hz=RATE_HZ, duration_s=0.125).samples
    found = examined(right(E1=both), tmp_path)
    assert {one.kind for one in of_faults(found)} == {FindingKind.SEVERAL_SIGNALS}
    assert "2 signals of E03 at once" in of_faults(found)[0].line


@pytest.mark.slow
def test_noise_is_no_signal_and_says_what_was_tried(tmp_path: Path) -> None:
    noise = np.random.default_rng(4).normal(size=(625_000, 2)).astype(np.float32).view(np.complex64)[:, 0]
    found = examined(right(E1=noise, E6=noise[::-1].copy()), tmp_path)
    assert faults(found) == [(FindingKind.NO_SIGNAL, Band.E1), (FindingKind.NO_SIGNAL, Band.E6)]
    assert "swapped bands" in of_faults(found)[0].line
    assert (found.e1, found.e6) == ((), ())


@pytest.mark.slow
def test_e6_alone_is_examined(tmp_path: Path) -> None:
    made = right()
    del made.stored[Band.E1]
    found = examined(made, tmp_path)
    assert faults(found) == []
    assert [one.svid for one in found.e6] == list(SVIDS)
    assert FindingKind.E6C_OPEN in {one.kind for one in found.findings}
