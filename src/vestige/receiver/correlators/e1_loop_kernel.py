"""Compute an E1 loop, which follows the stable zero of early minus late power, in compiled code.

Positions and delays are in chips, relative to the true signal and positive if later. R, P, a_i, τ_i, H_ij and d are
defined in `e1_loop`.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit

_STEPS_PER_SPACING = 8
_REACH_CHIPS = 1.0  # if no zero is within this distance, the loop stays at its position
_HALVINGS = 40
_NEAR = 1e-6  # distance in chips from a zero at which the stability of the zero is tested
_TIE = 1e-9  # relative difference below which early and late power count as equal


@njit(cache=True, nogil=True, error_model="numpy")
def correlation(levels, x):
    """Return R(x), interpolated linearly between `levels`.

    `levels` are the values of R at equal steps from −1 to 1 chip. R is 0 outside this range.
    """
    half = (levels.size - 1) // 2
    at = abs(x) * half
    k = int(at)
    if k >= half:
        return 0.0
    return levels[half + k] + (at - k) * (levels[half + k + 1] - levels[half + k])


@njit(cache=True, nogil=True, error_model="numpy")
def power(levels, x, delay, product):
    """Return P(x) = Σ_ij Re(a_i a_j* H_ij) R(x − τ_i) R(x − τ_j), the mean power of the correlator at x."""
    total = 0.0
    for i in range(delay.size):
        r = correlation(levels, x - delay[i])
        if r != 0.0:
            total += product[i, i] * r * r
            for j in range(i):
                total += 2.0 * product[i, j] * r * correlation(levels, x - delay[j])
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _early_side(levels, x, delay, product, half_spacing):
    """Return whether the loop at x moves earlier: the early power is at least the late power, and is not 0."""
    early = power(levels, x - half_spacing, delay, product)
    late = power(levels, x + half_spacing, delay, product)
    return early - late > -_TIE * (early + late)


@njit(cache=True, nogil=True, error_model="numpy")
def _next(n_levels, x, delay, half_spacing, direction):
    """Return the next x at which D is tested: the next kink of a correlation function, but at most d/8 away.

    D is the early minus late power, which is quadratic between kinks.
    """
    half = (n_levels - 1) // 2
    best = 2.0 * half_spacing / _STEPS_PER_SPACING
    for tau in delay:
        for side in (-half_spacing, half_spacing):
            for level in range(-half, half + 1):
                ahead = direction * (tau + side + level / half - x)
                if _TIE < ahead < best:
                    best = ahead
    return x + direction * best


@njit(cache=True, nogil=True, error_model="numpy")
def settle(levels, x, delay, product, half_spacing):
    """Return the stable zero of D = early − late power that a loop at x reaches; x if no zero is within reach.

    D > 0 moves the loop earlier. With D = 0 the loop also moves earlier, so on a plateau of P between two equal signals
    the loop moves to the earlier signal.
    """
    after = _early_side(levels, x + _NEAR, delay, product, half_spacing)
    before = _early_side(levels, x - _NEAR, delay, product, half_spacing)
    if after and not before:
        return x
    earlier = _early_side(levels, x, delay, product, half_spacing)
    a = x
    while abs(a - x) < _REACH_CHIPS:
        b = _next(levels.size, a, delay, half_spacing, -1.0 if earlier else 1.0)
        if _early_side(levels, b, delay, product, half_spacing) != earlier:
            for _ in range(_HALVINGS):
                middle = 0.5 * (a + b)
                if _early_side(levels, middle, delay, product, half_spacing) == earlier:
                    a = middle
                else:
                    b = middle
            return 0.5 * (a + b)
        a = b
    return x


@njit(cache=True, nogil=True, error_model="numpy")
def strongest(levels, delay, product):
    """Return the delay of the signal at which the power is largest; the first signal if several powers are equal."""
    best, at = -1.0, 0.0
    for i in range(delay.size):
        here = power(levels, delay[i], delay, product)
        if product[i, i] > 0.0 and here > best * (1.0 + _TIE):
            best, at = here, delay[i]
    return at


@njit(cache=True, nogil=True, error_model="numpy")
def follow_peak(levels, x, wait, delay, amplitude, doppler_hz, anew, lock_power, acquisition, half_spacing, pole_hz):
    """Return for each step the loop's delay, the power and strongest signal in the prompt correlator, and the wait.

    The wait is the number of steps until a receiver that acquires a signal tracks again. The wait is 0 while the
    receiver tracks.

    Parameters
    ----------
    levels
        R at equal steps from −1 to 1 chip.
    x
        Position of the loop before the first step, in chips after the true signal.
    wait
        Number of steps that the receiver still waits before the first step.
    delay, amplitude, doppler_hz
        Delays in chips, complex amplitudes, and Dopplers in Hz, each [n_steps, n_signals]; the true signal is the
        first.
    anew
        Whether an attack restarts the receiver, for each step.
    lock_power
        Power of the prompt correlator below which lock is lost, for each step.
    acquisition
        Duration in steps of an acquisition that begins at each step; 0 for an immediate acquisition.
    half_spacing
        Half the early-late spacing in chips.
    pole_hz
        Pole of the loop in Hz; beats that are much faster than the pole are averaged out.
    """
    n, k = delay.shape
    place, prompt, dominant, waits = np.empty(n), np.empty(n), np.empty(n, np.int64), np.empty(n, np.int64)
    product = np.empty((k, k))
    for step in range(n):
        for i in range(k):
            for j in range(i + 1):
                beat = (doppler_hz[step, i] - doppler_hz[step, j]) / pole_hz
                z = amplitude[step, i] * np.conj(amplitude[step, j]) / complex(1.0, beat)
                product[i, j] = z.real
                product[j, i] = z.real
        if anew[step] or wait > 0:
            x = strongest(levels, delay[step], product)
            wait = acquisition[step] if anew[step] else wait - 1
        x = settle(levels, x, delay[step], product, half_spacing)
        here = power(levels, x, delay[step], product)
        if here < lock_power[step]:
            x = settle(levels, strongest(levels, delay[step], product), delay[step], product, half_spacing)
            here = power(levels, x, delay[step], product)
            wait = acquisition[step]
        best = -1.0
        for i in range(k):
            r = correlation(levels, x - delay[step, i])
            if product[i, i] * r * r > best * (1.0 + _TIE):
                best, dominant[step] = product[i, i] * r * r, i
        place[step], prompt[step], waits[step] = x, here, wait
    return place, prompt, dominant, waits
