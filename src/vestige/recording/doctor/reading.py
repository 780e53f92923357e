"""Make other descriptions of the same samples, each of which differs from the given description by one mistake."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from vestige.errors import InputFileError
from vestige.recording.description import BandFile
from vestige.recording.doctor.finding import Finding, FindingKind, fault
from vestige.recording.samples.sample_file import open_samples
from vestige.recording.samples.sample_format import SampleFormat, SampleType
from vestige.records import SampleBatch
from vestige.signals.definitions import CARRIER_HZ

_LOOKED_AT = 1 << 16  # number of samples for the decision whether a format is plausible
_KURTOSIS = (1.2, 6.0)  # kurtosis of noise behind a quantiser of 2 bits or more; a wrong byte order gives other values
_LEAST_IF = 0.05  # smallest intermediate frequency of real samples, as a share of the sampling rate
_SIBLINGS: dict[SampleType, SampleType] = {"int8": "uint8", "uint8": "int8", "int16": "uint16", "uint16": "int16"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Changed description with which the samples of a band can be read."""

    kind: FindingKind  # kind of the mistake in the given description
    file: BandFile
    says: str  # difference from the given description, as words for the evidence: "with the spectrum reversed"
    change: str  # change to make in the description

    def fault(self, evidence: str) -> Finding:
        """Return the finding that the samples fit this reading, and not the given description."""
        return fault(self.kind, self.file.band, f"{self.file.band.value}: {evidence}", self.change)


def head(file: BandFile, duration_s: float, first_s: float = 0.0) -> SampleBatch | None:
    """Return up to `duration_s` of samples of a file from `first_s` on, or None if the samples cannot be read.

    The result is also None if the file has no sample from `first_s` on, or if samples are not finite numbers, for
    example because the format is wrong.
    """
    try:
        reader = open_samples(file)
        first = min(round(first_s * file.sample_rate_hz), reader.n_samples)
        count = min(round(duration_s * file.sample_rate_hz), reader.n_samples - first)
        return reader.read(reader.first_sample + first, count) if count > 0 else None
    except InputFileError:
        return None


def reversed_readings(file: BandFile) -> Iterator[Reading]:
    """Yield the reading with the opposite direction of the spectrum."""
    if file.form.is_complex:
        inverted = not file.spectral_inversion
        yield Reading(
            kind=FindingKind.REVERSED_SPECTRUM,
            file=replace(file, spectral_inversion=inverted),
            says="with the spectrum reversed",
            change=f"set spectral_inversion = {str(inverted).lower()}, or exchange I and Q: layout = "
            f'"{"iq" if file.form.layout == "qi" else "qi"}"; both have the same effect',
        )
        return
    center_hz = 2 * CARRIER_HZ[file.band] - file.center_frequency_hz
    if center_hz != file.center_frequency_hz:
        yield Reading(
            kind=FindingKind.REVERSED_SPECTRUM,
            file=replace(file, center_frequency_hz=center_hz),
            says="with the local oscillator on the other side of the carrier",
            change=f"set center_frequency_hz = {center_hz:.10g}",
        )


def swapped_readings(file: BandFile, other: BandFile) -> Iterator[Reading]:
    """Yield the samples of the other band's file, read with the description of either band."""
    shift_hz = CARRIER_HZ[file.band] - CARRIER_HZ[other.band]
    seen = []
    for one in (
        replace(
            file,
            path=other.path,
            header_bytes=other.header_bytes,
            trailing_bytes=other.trailing_bytes,
            form=replace(file.form, channels=other.form.channels, channel=other.form.channel),
        ),
        replace(other, band=file.band, center_frequency_hz=other.center_frequency_hz + shift_hz, start=file.start),
    ):
        alike = (one.form, one.sample_rate_hz, one.center_frequency_hz, one.spectral_inversion)
        if alike not in seen and (one.form.is_complex or _has_intermediate_frequency(one)):
            seen.append(alike)
            framed = other.form.channels > 1
            yield Reading(
                kind=FindingKind.SWAPPED_BANDS,
                file=one,
                says=f"in {other.path.name}, the {'channel' if framed else 'file'} of {other.band.value}",
                change=f"exchange {'E1 and E6 in `frame`' if framed else 'the files of E1 and E6'} in the description",
            )


def _has_intermediate_frequency(file: BandFile) -> bool:
    """Return whether the carrier is far enough from 0 Hz for real samples.

    Near 0 Hz the noise of real samples exceeds the threshold of the acquisition.
    """
    return abs(CARRIER_HZ[file.band] - file.center_frequency_hz) >= _LEAST_IF * file.sample_rate_hz


def layout_readings(file: BandFile) -> Iterator[Reading]:
    """Yield the readings of complex samples as real samples, or of real samples as complex samples."""
    form, rate_hz = file.form, file.sample_rate_hz
    if form.is_complex:
        if not _has_intermediate_frequency(file):
            return
        real = replace(form, layout="real")
        for rate, more in ((2 * rate_hz, f", sample_rate_hz = {2 * rate_hz:.10g}"), (rate_hz, "")):
            yield _layout(file, real, rate, "read as real samples", f'set layout = "real"{more}')
        return
    for rate, more in ((rate_hz, ""), (rate_hz / 2, f", sample_rate_hz = {rate_hz / 2:.10g}")):
        iq = _layout(file, replace(form, layout="iq"), rate, "read as complex samples", f'set layout = "iq"{more}')
        yield iq
        yield replace(
            iq,
            file=replace(iq.file, spectral_inversion=True),
            change=f"{iq.change}, spectral_inversion = true",
        )


def _layout(file: BandFile, form: SampleFormat, rate_hz: float, says: str, change: str) -> Reading:
    other = replace(file, form=form, sample_rate_hz=rate_hz, spectral_inversion=False)
    return Reading(kind=FindingKind.LAYOUT, file=other, says=says, change=change)


def format_readings(file: BandFile) -> Iterator[Reading]:
    """Yield the readings in other number types or byte orders that give plausible samples, the most plausible first."""
    forms = [
        replace(file.form, component=component, big_endian=big)
        for component in get_args(SampleType)
        for big in (False, True)
        if not (big and component in ("int8", "uint8"))
    ]
    ranked: list[tuple[float, int, BandFile]] = []
    for form in forms:
        if form != file.form:
            other = replace(file, form=form)
            away = _implausibility(other)
            if away is not None:
                ranked.append((away, len(ranked), other))
    for _, _, other in sorted(ranked):
        order = ", in a file of the other byte order" if other.form.big_endian else ""
        yield Reading(
            kind=FindingKind.FORMAT,
            file=other,
            says=f"read as {other.form}",
            change=f'set format = "{other.form.component}"{order}',
        )


def better_sibling(file: BandFile) -> Reading | None:
    """Return the reading with signed instead of unsigned numbers, or the reverse, if the given format must be wrong.

    The given format is wrong if the other format gives plausible values with at most half of the rms. The values in the
    given format then lie at the ends of the scale. If signed numbers are read as offset binary, or the reverse, all
    signs are reversed and the magnitudes are wrong. The signals are still found, but are about 2 dB weaker.
    """
    sibling = _SIBLINGS.get(file.form.component)
    if sibling is None:
        return None
    other = replace(file, form=replace(file.form, component=sibling))
    given, instead = _components(file), _components(other)
    if given is None or instead is None or _implausibility(other) is None or len(np.unique(instead)) <= 2:
        return None
    rms, smaller = (float(np.sqrt(np.mean(one**2))) for one in (given, instead))
    if smaller > rms / 2:
        return None
    return Reading(
        kind=FindingKind.FORMAT,
        file=other,
        says=f"all values lie at the ends of the scale, rms {rms:.0f}; as {other.form} rms {smaller:.0f}",
        change=f'set format = "{sibling}"',
    )


def rate_reading(file: BandFile, rate_hz: float) -> Reading:
    """Return the reading with another sampling rate."""
    return Reading(
        kind=FindingKind.SAMPLING_RATE,
        file=replace(file, sample_rate_hz=rate_hz),
        says=f"at {rate_hz / 1e6:.10g} Msps",
        change=f"set sample_rate_hz = {rate_hz:.10g}",
    )


def centre_reading(file: BandFile, offset_hz: float) -> Reading:
    """Return the reading with another centre frequency, for signals `offset_hz` above the expected frequency."""
    center_hz = file.center_frequency_hz - offset_hz
    return Reading(
        kind=FindingKind.CENTRE_FREQUENCY,
        file=replace(file, center_frequency_hz=center_hz),
        says=f"{offset_hz / 1e3:+.1f} kHz away from the frequency in the description",
        change=f"set center_frequency_hz = {center_hz:.0f} (to ±4 kHz); if the frequency in the description was set, "
        f"correct the oscillator, which is {-offset_hz / CARRIER_HZ[file.band] * 1e6:+.1f} ppm off",
    )


def _components(file: BandFile) -> np.ndarray | None:
    batch = head(file, _LOOKED_AT / file.sample_rate_hz)
    if batch is None:
        return None
    values = batch.samples.view(np.float32) if file.form.is_complex else batch.samples.real
    return values.astype(np.float64)


def _implausibility(file: BandFile) -> float | None:
    """Return how far the kurtosis of the first samples of a file is from 3, the kurtosis of Gaussian noise.

    If the values cannot be samples, the result is None.
    """
    values = _components(file)
    if values is None or values.size < 256:
        return None
    values = np.clip(values, -1e30, 1e30)
    scale = float(np.max(np.abs(values)))
    if scale == 0:
        return None
    values = values / scale
    mean, deviation = float(np.mean(values)), float(np.std(values))
    if deviation < 1e-3 or abs(mean) > 2 * deviation:
        return None
    kurtosis = float(np.mean((values - mean) ** 4)) / deviation**4
    return abs(kurtosis - 3.0) if _KURTOSIS[0] <= kurtosis <= _KURTOSIS[1] else None
