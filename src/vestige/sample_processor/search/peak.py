"""Refine the position of a signal that a search in E6 found, with taps 0.05 chip apart."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import ChipSequence, Handover, SampleSource
from vestige.sample_processor.correlator import correlate
from vestige.signals.definitions import E6C
from vestige.time import GalileoTime

_FINE_CHIPS = np.arange(-25, 26) / 20  # taps 0.05 chip apart; the peak is within a chip of its cell
_MARGIN_S = 1e-6  # duration in s of additional samples before and after the chips


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """A signal in E6 that carries the chips of a RECS.

    Attributes
    ----------
    start_time
        Receiver-clock time at which the first chip arrives.
    doppler_hz
        Carrier Doppler on E6 at `start_time`, in Hz.
    magnitude
        Magnitude at the refined position, in standard deviations of the noise per dimension.
    threshold
        Detection threshold in the unit of the magnitude; the tested grid cell exceeded this threshold.
    cn0_dbhz
        C/N0 of E6-C in dBHz that corresponds to the magnitude.
    """

    svid: int
    start_time: GalileoTime
    doppler_hz: float
    magnitude: float
    threshold: float
    cn0_dbhz: float


def peak_at(source: SampleSource, handover: Handover, threshold: float) -> Peak | None:
    """Return the peak within 1¼ chips of a hand-over at its Doppler; None if the samples do not contain the chips.

    Parameters
    ----------
    handover
        Hand-over of the cell, with the chips that were correlated.
    threshold
        Threshold that the cell exceeded, in standard deviations of the noise per dimension.
    """
    chips = handover.chips
    duration_s = (chips.n_chips + 4) / chips.chip_rate_hz + 2 * _MARGIN_S
    head = source.read(source.first_sample, 1)
    rate = head.sample_rate_hz
    first = head.first_sample + int((handover.start_time - head.start - _MARGIN_S) * rate)
    first = max(first, source.first_sample)
    count = min(int(np.ceil(duration_s * rate)), source.end_sample - first)
    if count <= 0:
        return None
    batch = source.read(first, count)
    # at an end of the samples only the taps on one side lie in the samples
    for offsets in (_FINE_CHIPS, _FINE_CHIPS[_FINE_CHIPS >= 0], _FINE_CHIPS[_FINE_CHIPS <= 0]):
        bank = correlate(batch, handover, offsets / chips.chip_rate_hz * SPEED_OF_LIGHT_MPS)
        if bank is not None:
            break
    else:
        return None
    best = int(np.argmax(np.abs(bank.taps)))
    magnitude = float(np.abs(bank.taps[best]) / np.sqrt(bank.noise_power / 2))
    snr = max(magnitude**2 / 2 - 1.0, 1e-3)
    return Peak(
        svid=handover.svid,
        start_time=handover.start_time + float(bank.offsets_m[best]) / SPEED_OF_LIGHT_MPS,
        doppler_hz=handover.doppler_hz,
        magnitude=magnitude,
        threshold=threshold,
        cn0_dbhz=float(10 * np.log10(snr / bank.integration_s)),
    )


def shortened(chips: ChipSequence, n_chips: int) -> ChipSequence:
    """Return the sequence of the first `n_chips` chips of a sequence, or of all chips if the sequence is shorter."""
    return ChipSequence.of(
        svid=chips.svid,
        transmit_time=chips.transmit_time,
        chip_rate_hz=chips.chip_rate_hz,
        chips=chips.chips[:n_chips],
    )


def separated(peaks: Iterable[Peak]) -> tuple[Peak, ...]:
    """Return the peaks in order of time, without peaks within one chip of a stronger peak of the same satellite.

    The correlation triangle is two chips wide, and all Doppler side lobes of a signal lie at its code offset. So a
    weaker peak within a chip is taken as a part of the stronger peak, at any Doppler.
    """
    kept: list[Peak] = []
    for peak in sorted(peaks, key=lambda one: -one.magnitude):
        near = (abs(peak.start_time - other.start_time) * E6C.chip_rate_hz for other in kept if other.svid == peak.svid)
        if all(chips > 1.0 for chips in near):
            kept.append(peak)
    return tuple(sorted(kept, key=lambda one: one.start_time))
