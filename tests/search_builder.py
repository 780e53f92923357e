"""Samples of E6 with the chips of a RECS at known places, for tests of the searches."""

from __future__ import annotations

import numpy as np

from builders import START
from vestige.records import Band, ChipSequence, SampleBatch
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.signals.definitions import E6C

RATE_HZ = 12.5e6


def arrival(
    chips: ChipSequence, start_s: float, cn0_dbhz: float, doppler_hz: float = 0.0, rate: float = 0.0, phase: float = 0.0
) -> ReceivedSignal:
    """Return the chips as they arrive `start_s` after the first sample at 12.5 MHz, alone on air."""
    return ReceivedSignal(
        chips=chips,
        start_s=start_s,
        doppler_hz=doppler_hz,
        doppler_rate_hz_per_s=rate,
        delay_m=np.zeros(1),
        amplitude=np.array([amplitude(cn0_dbhz, RATE_HZ) * np.exp(1j * phase)]),
        ray_doppler_hz=np.zeros(1),
    )


def e6_source(
    signals: list[ReceivedSignal], duration_s: float, seed: int | None, center_frequency_hz: float = E6C.carrier_hz
) -> BatchSource:
    """Return samples with noise of variance 1, or without noise for seed None."""
    samples = synthesize(
        tuple(signals),
        sample_rate_hz=RATE_HZ,
        n_samples=round(duration_s * RATE_HZ),
        noise_key=None if seed is None else noise_key(seed, 0, 6),
        center_frequency_hz=center_frequency_hz,
    )
    return BatchSource(
        SampleBatch(
            band=Band.E6,
            samples=samples,
            sample_rate_hz=RATE_HZ,
            center_frequency_hz=center_frequency_hz,
            first_sample=1000,
            start=START,
        )
    )
