"""
Autocorrelation of the E6-C code
================================

Use this example to see why the early detector needs a distance of a chip between two signals, and how the bandwidth
of a front end changes the peak. A chip of E6-C is 58.6 m long.
"""

# %%
# The autocorrelation of the code of 1 ms over whole chips has a single peak, and side lobes at least 27 dB lower.
import matplotlib.pyplot as plt
import numpy as np

from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1C, E6C
from vestige.signals.pulse import band_limited_autocorrelation

chips = primary_code(E6C, 11).astype(float)
spectrum = np.fft.fft(chips)
correlation = np.fft.ifft(np.abs(spectrum) ** 2).real / chips.size
side_lobes = np.abs(correlation[1:])
print(f"{chips.size} chips; highest side lobe {20 * np.log10(side_lobes.max()):.1f} dB")

# %%
# The figure shows the peak for the bandwidths of three front ends, and the peak of E1-C for comparison. A narrow front
# end rounds the peak, so a second signal with a similar delay is harder to detect.
chip_m = 299_792_458.0 / E6C.chip_rate_hz
delay_m = np.linspace(-200, 200, 1601)
figure, axes = plt.subplots(layout="constrained")
for bandwidth_hz in (5e6, 10e6, 40e6):
    peak = band_limited_autocorrelation(
        E6C.pulse, np.abs(delay_m) / chip_m, chip_rate_hz=E6C.chip_rate_hz, bandwidth_hz=bandwidth_hz
    )
    axes.plot(delay_m, peak, label=f"E6-C, {bandwidth_hz / 1e6:.0f} MHz")
e1 = band_limited_autocorrelation(
    E1C.pulse,
    np.abs(delay_m) * E1C.chip_rate_hz / 299_792_458.0,
    chip_rate_hz=E1C.chip_rate_hz,
    bandwidth_hz=24e6,
)
axes.plot(delay_m, e1, "--", color="grey", label="E1-C, 24 MHz")
axes.set(xlabel="delay (m)", ylabel="correlation", title="One chip of E6-C is 58.6 m")
axes.legend()
plt.show()
