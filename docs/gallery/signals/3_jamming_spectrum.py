"""
Spectrum of four jammers
========================

Use this example to recognise a jammer in the spectrum of a recording. Each waveform has 20 dB
more power than the white noise to which it is added.
"""

# %%
# A scenario uses the same waveforms in ``[[attack]] kind = "jamming"``.
import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import welch

from vestige.spoofer.jammers import Chirp, ContinuousWave, Pulsed, Wideband

RATE_HZ = 12.5e6
JAMMERS = {
    "wideband": Wideband(),
    "continuous wave, 1 MHz above the carrier": ContinuousWave(offset_hz=1e6),
    "chirp over 8 MHz in 20 µs": Chirp(bandwidth_hz=8e6, sweep_s=20e-6),
    "pulses, 10 % of each ms": Pulsed(duty=0.1, period_s=1e-3),
}
generator = np.random.default_rng(1)
noise = generator.standard_normal((2, 250_000)) / np.sqrt(2)

# %%
# The pulsed and the wideband jammer have the same spectrum. Only the magnitude against time distinguishes these two
# jammers.
figure, axes = plt.subplots(2, 1, layout="constrained", figsize=(6.4, 6.4))
for name, jammer in JAMMERS.items():
    samples = (noise[0] + 1j * noise[1]).astype(np.complex64)
    jammer.add(samples, 100.0, RATE_HZ, np.uint64(7))
    frequency_hz, density = welch(samples, RATE_HZ, nperseg=2048, return_onesided=False)
    order = np.argsort(frequency_hz)
    axes[0].plot(frequency_hz[order] / 1e6, 10 * np.log10(density[order] * RATE_HZ), linewidth=0.8, label=name)
    axes[1].plot(np.arange(25_000) / RATE_HZ * 1e3, np.abs(samples[:25_000]), linewidth=0.3)
axes[0].set(xlabel="frequency from the carrier (MHz)", ylabel="density over noise (dB)")
axes[0].legend(fontsize="small")
axes[1].set(xlabel="time (ms)", ylabel="magnitude (σ of the noise)")
plt.show()
