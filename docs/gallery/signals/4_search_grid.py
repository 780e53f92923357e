"""
Two signals of one satellite
============================

Use this example to see how a vestigial search finds two signals. A meaconer without nulling leaves the true signal in
the samples, so the grid of code phase and Doppler has both signals.
"""

# %%
# The samples have E1 of a satellite and its copy, which is 4 dB stronger and 1.37 ms late.
import matplotlib.pyplot as plt
import numpy as np

from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1C

RATE_HZ, CN0_DBHZ = 4.1e6, 47.0
n = round(4e-3 * RATE_HZ)
time_s = np.arange(2 * n) / RATE_HZ
code = np.repeat(primary_code(E1C, 11), 2) * np.tile([1.0, -1.0], 4092)  # BOC(1,1): two half chips for each chip


def signal(delay_s, doppler_hz, cn0_dbhz):
    """Return the E1-C samples of one satellite, scaled for noise of power 1."""
    half_chip = np.floor((time_s - delay_s) * 2 * E1C.chip_rate_hz).astype(int) % code.size
    amplitude = np.sqrt(10 ** (cn0_dbhz / 10) / RATE_HZ)
    return amplitude * code[half_chip] * np.exp(2j * np.pi * doppler_hz * time_s)


generator = np.random.default_rng(3)
noise = (generator.standard_normal(2 * n) + 1j * generator.standard_normal(2 * n)) / np.sqrt(2)
samples = noise + signal(0.81e-3, 1700.0, CN0_DBHZ) + signal(2.18e-3, 1700.0, CN0_DBHZ + 4)

# %%
# Correlate one code period at each Doppler, and add the powers of two periods. ``vestige search e1`` makes this search
# for all satellites, over 100 ms.
replica = np.conj(np.fft.fft(code[np.floor(time_s[:n] * 2 * E1C.chip_rate_hz).astype(int) % code.size]))
doppler_hz = np.arange(-500, 4001, 125)
grid = np.zeros((doppler_hz.size, n))
for row, doppler in enumerate(doppler_hz):
    wiped = samples * np.exp(-2j * np.pi * doppler * time_s)
    for period in (wiped[:n], wiped[n:]):
        grid[row] += np.abs(np.fft.ifft(np.fft.fft(period) * replica)) ** 2 / n * n / n
grid /= np.median(grid)

# %%
figure, axes = plt.subplots(layout="constrained")
shown = grid[:, : n // 64 * 64].reshape(doppler_hz.size, -1, 64).max(axis=2)  # maximum of 64 neighbours
mesh = axes.pcolormesh(np.linspace(0, 4, shown.shape[1]), doppler_hz, 10 * np.log10(shown), cmap="cividis", vmin=9)
figure.colorbar(mesh, label="power over the median (dB)")
arrow = {"color": "white", "width": 0.5, "headwidth": 4}
axes.annotate("true signal: the earlier one", (0.81, 2000), (0.1, 3500), color="white", arrowprops=arrow)
axes.annotate("copy", (2.18, 2000), (2.6, 3500), color="white", arrowprops=arrow)
axes.set(xlabel="code phase (ms)", ylabel="Doppler (Hz)")
plt.show()
