"""Fill the table of a band's modulation, and add the signal of each path to samples of a recording, in compiled loops.

Theory of operation
-------------------
All components of a satellite in a band have the same code phase and carrier. So the components are added *before*
sampling. The table contains the sum of the components on the finest sub-chip grid of the band. The rate of the grid is
12.276 MHz on E1 and 5.115 MHz on E6. With this table a path needs only one look-up and one rotation per sample, for any
number of components:

    x_i += level[⌊u_0 + i u_1⌋] · (a e^{jφ_i})          u_0, u_1 in float64, new for each block

The code phase of sample i is u_0 + i u_1 sub-chips. The path has the amplitude a and the carrier phase φ_i. Code phase
and carrier phase are parabolas in time. Code rate and carrier phase are computed in float64 at the middle of each block
of 1024 samples. Several consecutive blocks use one table of the carrier. The number of these blocks follows from the
Doppler rate, so that the phase error does not exceed `_MAX_TURN_RAD`. At very high Doppler rates each block has its own
table, and the phase error may be larger.

No sum depends on the order of vector lanes, and products and sums are fused explicitly. So a block has equal bits on
every machine.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit
from vestige.signals.float_kernel import fma
from vestige.signals.rotator_kernel import BLOCK, MIDDLE, rotator_table, turn_at

_MAX_TURN_RAD = 5e-6


@njit(cache=True, nogil=True)
def fill_periodic(levels, first, pattern, signs, first_period):
    """Add to the levels a component that repeats its primary code, with a sign for each period.

    Parameters
    ----------
    levels
        float32[n]: levels to which the component is added.
    first
        Number of the first sub-chip of `levels`, counted from the reference second.
    pattern
        float32[m]: levels of one period of the code.
    signs
        float32[k]: secondary chip times symbol of each period, from number `first_period` on.
    """
    size = pattern.size
    place = 0
    while place < levels.size:
        number = first + place
        period = number // size
        inside = number - period * size
        n = min(size - inside, levels.size - place)
        sign = signs[period - first_period]
        out, part = levels[place : place + n], pattern[inside : inside + n]
        for i in range(n):
            out[i] += sign * part[i]
        place += n


@njit(cache=True, nogil=True)
def fill_chips(levels, chips, pulse):
    """Add to the levels a component that is given chip by chip; each chip is multiplied by the levels of the pulse."""
    per_chip = pulse.size
    for k in range(per_chip):
        for i in range(chips.size):
            levels[i * per_chip + k] += pulse[k] * np.float32(chips[i])


@njit(cache=True, nogil=True)
def _add_block(x, levels, u, step, cos, sin, re, im, index):
    """Add amplitude × rotator × level to the samples of a block, whose real and imaginary parts alternate in `x`."""
    for i in range(index.size):
        index[i] = np.int32(u + i * step)
    for i in range(index.size):
        level = levels[index[i]]
        x[2 * i] = fma(level, fma(re, cos[i], -im * sin[i]), x[2 * i])
        x[2 * i + 1] = fma(level, fma(re, sin[i], im * cos[i]), x[2 * i + 1])


@njit(cache=True, nogil=True)
def add_path(x, levels, middle, dt, code, rate, acceleration, amplitude, doppler_hz, doppler_rate, growth=0.0):
    """Add to samples the signal that arrives by one path.

    Parameters
    ----------
    x
        float32[2 n], samples with alternating real and imaginary parts.
    levels
        float32[m]: table of the modulation at each sub-chip, long enough for every sample.
    middle
        Number of the sample to which code, amplitude and Doppler refer.
    dt
        Sampling interval in s.
    code, rate, acceleration
        Code phase as a position in the table in sub-chips, and its derivatives in sub-chips/s and sub-chips/s².
    amplitude
        Amplitude with the phase of the carrier, complex128.
    doppler_hz, doppler_rate
        Frequency of the carrier in the samples in Hz, and its rate of change in Hz/s.
    growth
        Relative growth of the amplitude per s; the amplitude is constant within a block.
    """
    n_samples = x.size // 2
    n_blocks = -(-n_samples // BLOCK)
    # phase error in rad that each further block with the same table adds; the frequency of the table is exact in the
    # middle of these blocks
    turn = np.pi * abs(doppler_rate) * dt * dt * BLOCK / 2 * BLOCK
    held = n_blocks if turn * n_blocks <= _MAX_TURN_RAD else max(1, int(_MAX_TURN_RAD / turn))
    cos, sin = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    index = np.empty(BLOCK, np.int32)
    for b in range(n_blocks):
        if b % held == 0:
            last = min(b + held, n_blocks)
            at = ((b + last) / 2 * BLOCK - middle) * dt
            rotator_table((doppler_hz + doppler_rate * at) * dt, cos, sin)
        n = min(BLOCK, n_samples - b * BLOCK)
        start = (b * BLOCK - middle) * dt
        centre = start + MIDDLE * dt
        step = (rate + acceleration * centre) * dt
        u = code + rate * centre + 0.5 * acceleration * centre * centre - MIDDLE * step
        a = amplitude * turn_at(doppler_hz, doppler_rate, centre) * (1.0 + growth * centre)
        _add_block(
            x[2 * b * BLOCK : 2 * (b * BLOCK + n)],
            levels,
            u,
            step,
            cos[:n],
            sin[:n],
            np.float32(a.real),
            np.float32(a.imag),
            index[:n],
        )
