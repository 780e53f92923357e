"""
Correlate IQ samples yourself
=============================

Use this example to check vestige's correlator, or to start a receiver of your own. The script makes E1 and E6 samples
of five satellites, and finds a satellite in E6 with a few lines of numpy.
"""

# %%
# ``first_light.toml`` describes a recording of 130 ms. The E6-C code is open, so the chips are known.
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from click.testing import CliRunner

import vestige as vs
from vestige.cli.main import vestige
from vestige.scenario.shipped import shipped_scenarios
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E6C

(scenario,) = (path for path in shipped_scenarios() if path.name == "first_light.toml")
folder = Path(tempfile.mkdtemp()) / "recording"
made = CliRunner().invoke(vestige, ["simulate", str(scenario), "-o", str(folder)], catch_exceptions=False)
recording = vs.open_recording(folder)
batch = recording.e6.read(0, round(4e-3 * 12.5e6))

# %%
# The samples are complex numbers around the E6 carrier. The replica is a code period of 1 ms, with a chip of the
# code for each sample.
rate_hz = batch.sample_rate_hz
n = round(1e-3 * rate_hz)
chips = primary_code(E6C, 3).astype(float)
replica = chips[(np.arange(n) * E6C.chip_rate_hz / rate_hz).astype(int)]

# %%
# Two code periods of samples contain a whole code period, wherever this period begins. An FFT correlates at all code
# phases at once, for each Doppler.
samples, time_s = batch.samples[: 2 * n], np.arange(2 * n) / rate_hz
spectrum = np.conj(np.fft.fft(replica, 2 * n))
doppler_hz = np.arange(-3000, 3001, 250)
power = []
for doppler in doppler_hz:
    wiped = samples * np.exp(-2j * np.pi * doppler * time_s)
    power.append(np.abs(np.fft.ifft(np.fft.fft(wiped) * spectrum)[:n]) ** 2)
power = np.array(power) / np.mean(power)  # 1 is the mean power of noise
row, phase = np.unravel_index(np.argmax(power), power.shape)
print(
    f"E03: Doppler {doppler_hz[row]} Hz, code phase {phase / rate_hz * 1e6:.2f} µs, {10 * np.log10(power.max()):.1f} dB"
)
print(f"The scenario says: Doppler {120.0 / 299_792_458 * E6C.carrier_hz:.0f} Hz, C/N0 · 1 ms = 17 dB")

# %%
figure, axes = plt.subplots(layout="constrained")
axes.plot(np.arange(n) / rate_hz * 1e6, power[row], linewidth=0.7)
axes.set(xlabel="code phase (µs)", ylabel="power / mean power of noise", title=f"E03 on E6-C at {doppler_hz[row]} Hz")
plt.show()
