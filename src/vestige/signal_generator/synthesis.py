"""Make samples of spread-spectrum signals with paths, Doppler and noise at any sampling rate, faster than `waveform`.

Theory of operation
-------------------
Sample n is taken at the time t_n after the start of the signal (`start_s`). At the start, chip number L (`lead_chips`)
arrives by a path without delay. The first L chips arrive before the start. A signal has Doppler f_d and Doppler rate
ḟ_d on its carrier f_c. A signal with the paths r adds the samples

    x_n = Σ_r a_r · chip[L + ⌊u_n − d_r⌋] · exp j2π[(f_c − f_0 + f_d + f_r) t_n + ½ ḟ_d t_n²]
    u_n = R_c (1 + f_d/f_c) t_n + ½ R_c (ḟ_d/f_c) t_n²        chips

R_c is the chip rate, and f_0 is the radio frequency at 0 Hz in the samples. The Doppler thus affects code and carrier
alike. If a signal has only one path and f_r = 0, a correlator with the start and the Doppler of the signal gives a_r at
the delay d_r. A path's own Doppler f_r rotates only the phase of the path. The change of the delay d_r by f_r is
neglected, because a Doppler of 1 Hz moves the delay by only 4 mm in 16 ms. A signal with another range rate, such as a
spoofing signal, needs its own `ReceivedSignal`.

**Strength.** Noise is complex, white and Gaussian with variance 1 per sample, so N0 is 1/f_s. A component with a given
C/N0 has the amplitude √(C/N0 / f_s). The noise is a pure function of its key and the number of the sample.

**Band.** No filter is applied. Chips are rectangular, so the sampling rate must not be a small multiple of the chip
rate (`vestige.receiver.samples.staircase`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Complex128, Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import ChipSequence
from vestige.signal_generator.noise_kernel import fill_normals
from vestige.signal_generator.synthesis_kernel import add_paths
from vestige.signals.definitions import E6C
from vestige.signals.rotator_kernel import BLOCK

SIGMA = np.float32(np.sqrt(0.5))  # standard deviation per dimension of complex noise of variance 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedSignal:
    """Received signal: its chips, the start of the chips, and the paths by which the chips arrive."""

    chips: ChipSequence  # rectangular (BPSK) chips; there is no signal before the first and after the last chip
    # Time in s at which chip number `lead_chips` arrives by a path without delay; the time may be negative. The time
    # counts from sample 0, or from the origin that `origin_sample` and `origin_s` of `synthesize` state.
    start_s: float
    doppler_hz: float  # Doppler of the carrier in Hz at `start_s`
    doppler_rate_hz_per_s: float  # rate of change of the Doppler in Hz/s
    delay_m: Float[np.ndarray, " n_rays"]  # delay of each path in m, positive if later
    amplitude: Complex128[np.ndarray, " n_rays"]  # amplitude of each path with its phase at `start_s`
    ray_doppler_hz: Float[np.ndarray, " n_rays"]  # Doppler of each path minus `doppler_hz`, in Hz
    lead_chips: int = 0  # number of chips before `start_s`, for earlier samples and late paths


def amplitude(cn0_dbhz: float, sample_rate_hz: float) -> float:
    """Return the amplitude √(C/N0 / f_s) of a component in noise of variance 1 per sample."""
    return float(np.sqrt(10 ** (cn0_dbhz / 10) / sample_rate_hz))


def synthesize(
    signals: tuple[ReceivedSignal, ...],
    *,
    sample_rate_hz: float,
    n_samples: int,
    noise_key: np.uint64 | None,
    noise_power: float = 1.0,
    first_sample: int = 0,
    origin_sample: int = 0,
    origin_s: float = 0.0,
    carrier_hz: float = E6C.carrier_hz,
    center_frequency_hz: float = E6C.carrier_hz,
) -> Complex64[np.ndarray, " n_samples"]:
    """Return `n_samples` samples from number `first_sample` on; several calls give the same bits as one call.

    Parameters
    ----------
    signals
        All signals in the band.
    sample_rate_hz
        Complex sampling rate in Hz.
    noise_key
        Key of the noise (`noise_kernel.noise_key`); None for no noise.
    origin_sample
        Number of the sample at `origin_s`. This sample should be near the signals, because float64 rounds large times
        in a long recording.
    origin_s
        Time in s of `origin_sample` on the time axis of `ReceivedSignal.start_s`.
    noise_power
        Variance of the noise. Amplitudes refer to variance 1, so a larger variance means additional white interference.
    carrier_hz
        Carrier frequency of all signals in Hz.
    center_frequency_hz
        Radio frequency in Hz that lies at 0 Hz in the samples.
    """
    skip = first_sample % BLOCK  # blocks are counted from sample 0, so that rounding does not depend on `first_sample`
    first = first_sample - skip
    samples = np.empty(skip + n_samples, np.complex64)
    x = samples.view(np.float32)
    if noise_key is None:
        x[:] = 0
    else:
        fill_normals(noise_key, np.int64(first), SIGMA * np.float32(np.sqrt(noise_power)), x)
    for signal in signals:
        _add(
            x,
            signal,
            (first - origin_sample) / sample_rate_hz - (signal.start_s - origin_s),
            sample_rate_hz,
            carrier_hz,
            carrier_hz - center_frequency_hz,
        )
    return samples[skip:]


def _add(
    x: Float[np.ndarray, " n"],
    signal: ReceivedSignal,
    t0: float,
    sample_rate_hz: float,
    carrier_hz: float,
    if_hz: float,
) -> None:
    """Add a signal to samples; the first sample is taken `t0` s after the signal's `start_s`."""
    rate = signal.chips.chip_rate_hz
    add_paths(
        x,
        signal.chips.packed,
        signal.chips.n_chips,
        signal.delay_m / SPEED_OF_LIGHT_MPS * rate - signal.lead_chips,
        signal.amplitude,
        signal.ray_doppler_hz,
        t0,
        1.0 / sample_rate_hz,
        rate * (1.0 + signal.doppler_hz / carrier_hz),
        rate * signal.doppler_rate_hz_per_s / carrier_hz,
        if_hz + signal.doppler_hz,
        float(signal.doppler_rate_hz_per_s),
    )
