"""Track satellites in compiled loops, code period by code period.

Theory of operation
-------------------
The code oscillator cuts the samples into code periods. Period k begins with the first sample whose code phase is not
negative. `correlator_bank_kernel` correlates a period as its samples arrive. The period gives the bank of E1-C, with
the secondary chip removed, and the prompt of E1-B. After every integration the discriminators give the errors, from the
early (E), prompt (P) and late (L) correlator:

    carrier phase     Im P / (2π A)                  of the pilot, which has no data; at most a quarter of a cycle;
                      or arg(P) / (2π), or arctan(Im P / Re P) / (2π)
    carrier frequency arg(P_k P*_{k−1}) / (2π T)     while the carrier is pulled in
    code phase        (|E|² − |L|²) / (4 A² R(d) R'(d))   [BETZ09]; A is the smoothed amplitude of P;
                      or Re((E − L) P*) / (2 A² R(0) R'(d))

Here k counts the integrations, T is the integration time, and d is half the distance from early to late. R is the
correlation of the received pulse with the replica, with R(0) = 1, and R' is the slope of R. `loop_gains` gives the
gains of the loops. The carrier loop aids the code loop with the frequency in its integrator, not with its momentary
rate.

Every 100 ms, a period of the secondary code, the 25 prompts give the C/N0 and the phase lock. The phase lock (I² −
Q²)/(I² + Q²) of the sum of these prompts estimates cos 2φ for the phase error φ [VAN-DIERENDONCK96]. C/N0 is S/(2 V)
divided by the code period of 4 ms. S is the square of the mean in-phase part minus the noise in this square, and V is
the variance of the in-phase part. S and V are smoothed over 1 s. The C/N0 does not use the quadrature part, because the
quadrature part contains the loop's own phase noise, which would reduce the C/N0 by 0.3 dB.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit
from vestige.sample_processor.tracking.correlator_bank_kernel import (
    REMOVED_STEPS,
    add_to_bank,
    bank_workspace,
    piece_length,
    removed_cycles,
    running_sums,
)
from vestige.sample_processor.tracking.settings import PERIODS_PER_SECONDARY, PLL_DISCRIMINATORS

CODE_LENGTH = 4092.0  # number of chips of the codes of E1-B and E1-C
PULL_IN, TRACKING, LOST = 0, 1, 2  # modes of a channel
ARCTAN = PLL_DISCRIMINATORS.index("arctan")  # index of the discriminator that ignores errors of half a cycle
_LARGEST_RATE = 1.001  # largest code rate over the nominal code rate: a Doppler of 1.6 MHz on E1
_AMPLITUDE_TIME_S = 0.2  # time constant in s with which the amplitude of the prompt is smoothed
_CN0_SHARE = 0.1  # share of the newest 100 ms in the smoothed signal and noise, for a time constant of 1 s
_TURNED = 0.3  # share of the amplitude; if the in-phase part is smaller, the carrier has slipped or is about to slip
_IN_PHASE_SHARE = 0.2  # share of a new prompt in the smoothed in-phase part, for a time constant of 20 ms
_LOCK_SHARE = 0.3  # share of a new value in the smoothed phase lock, for a time constant of 0.3 s

# fields of the values that a channel keeps from one code period to the next code period
CHANNEL_STATE = np.dtype(
    [
        ("first_sample", "i8"),  # first sample of the present code period
        ("next_sample", "i8"),  # first sample of the present code period that has not been correlated
        ("data", "c16"),  # prompt of E1-B, from `first_sample` to `next_sample`
        ("code_phase", "f8"),  # code phase of `first_sample`, in chips
        ("code_rate", "f8"),  # code rate in chips per sample
        ("carrier_cycles", "f8"),  # carrier phase of `first_sample`, in cycles
        ("carrier_step", "f8"),  # carrier frequency in cycles per sample
        ("doppler_hz", "f8"),  # Doppler in the integrator of the carrier loop
        ("doppler_rate", "f8"),  # second integrator of an order-3 loop, in Hz/s
        ("code_drift", "f8"),  # integrator of the code loop in chips/s; not used by order 1
        ("period", "i8"),  # number of the present code period; a secondary code begins at multiples of 25
        ("mode", "i8"),
        ("integrated", "i8"),  # number of code periods in the present integration
        ("pulled_in", "i8"),  # number of integrations since the channel started
        ("amplitude", "f8"),  # smoothed amplitude of the prompt of an integration
        ("last_re", "f8"),
        ("last_im", "f8"),
        ("sum_re", "f8"),  # real part of the sum of the prompts in the present secondary code
        ("sum_im", "f8"),
        ("sum_in_phase", "f8"),  # sum of the squared in-phase parts of the prompts in the present secondary code
        ("summed", "i8"),
        ("signal", "f8"),  # square of the mean in-phase part minus the part of the noise, smoothed
        ("noise", "f8"),  # variance of the in-phase part, smoothed; 0 before the first value
        ("cn0_dbhz", "f8"),
        ("phase_lock", "f8"),  # phase lock of the last secondary code
        ("mean_lock", "f8"),  # smoothed phase lock
        ("bad", "i8"),  # number of secondary codes in a row whose C/N0 or phase lock is below the threshold
        ("slipped", "i8"),  # whether the phase of the last secondary code is unreliable
        ("in_phase", "f8"),  # in-phase part of the prompts, smoothed over 20 ms
        ("turned", "i8"),  # whether `in_phase` was far below the amplitude in the present secondary code
    ]
)

# fields of the constants of a channel
CONSTANTS = np.dtype(
    [
        ("sample_rate_hz", "f8"),
        ("chip_rate_hz", "f8"),
        ("carrier_hz", "f8"),
        ("intermediate_hz", "f8"),  # frequency of the carrier in the samples without Doppler
        ("interval_s", "f8"),  # integration time
        ("periods", "i8"),  # number of code periods in an integration
        ("pll", "f8", (3,)),
        ("dll", "f8", (3,)),
        ("fll", "f8"),
        ("code_scale", "f8"),  # −1/(4 R(d) R'(d)) in chips; for the dot product −1/(2 R(0) R'(d))
        ("phase_kind", "i8"),  # index in `PLL_DISCRIMINATORS`
        ("code_kind", "i8"),  # index in `DLL_DISCRIMINATORS`
        ("early", "i8"),  # index of the early correlator in the bank
        ("prompt", "i8"),
        ("late", "i8"),
        ("pull_in", "i8"),  # number of integrations of the pull-in
        ("min_cn0_dbhz", "f8"),
        ("min_phase_lock", "f8"),
        ("slip_phase_lock", "f8"),
        ("patience", "i8"),  # largest number of bad secondary codes in a row before the signal is lost
        ("segments", "i8"),  # number of segments of the replica in a half chip
    ]
)

# fields of the results of one code period
PERIOD = np.dtype(
    [
        ("number", "i8"),
        ("first_sample", "i8"),
        ("code_phase", "f8"),  # code phase of the first sample, in chips
        ("code_rate", "f8"),  # code rate in chips per sample
        ("carrier_cycles", "f8"),  # carrier phase of the first sample, in cycles
        ("carrier_step", "f8"),  # carrier frequency in cycles per sample
        ("doppler_rate", "f8"),
        ("data", "c16"),  # prompt of E1-B
        ("cn0_dbhz", "f8"),
        ("phase_lock", "f8"),
        ("locked", "?"),  # whether the channel tracks, and the phase lock of the last secondary code was good
    ]
)


@njit(cache=True, nogil=True)
def track_channels(
    x, x_first, shift, secondary, replicas, lags, starts, slots, constants, states, pilots, totals, periods, banks, done
):
    """Correlate the given samples with the replicas of several channels, and update the loops of these channels.

    All channels process a piece of the samples before any channel goes to the next piece, because the channels share
    the running sums.

    Parameters
    ----------
    x
        float32[2 · n], real and imaginary parts of the samples in turn.
    x_first
        Number of the first sample.
    shift
        Frequency that is removed from all samples, in 2⁻³² cycles per sample.
    secondary
        float64[channel, 25], the secondary codes of E1-C.
    replicas
        float32[channel, 2, segment], replicas of E1-C and E1-B from `bank_replicas`.
    lags
        int64[channel, k], the positions of the correlators in samples.
    starts, slots
        Vectors from `bank_vectors` for the lags of each channel.
    constants, states
        `CONSTANTS`[channel], and `CHANNEL_STATE`[channel], which is updated.
    pilots, totals
        complex128[channel, k], updated: the banks of the unfinished code periods, which still contain the secondary
        chip, and the banks of the unfinished integrations.
    periods, banks
        `PERIOD`[channel, m] and complex64[channel, m, k], filled; m is at least the number of periods that can end in
        the samples.
    done
        int64[channel], zeros; the number of code periods that ended is added.
    """
    work = bank_workspace()
    x_end = x_first + x.size // 2
    c = constants[0]
    length = piece_length(2 * c.segments * c.chip_rate_hz / c.sample_rate_hz * _LARGEST_RATE, lags[0])
    for first in range(x_first, x_end, length):
        end = min(first + length, x_end)
        running_sums(x[2 * (first - x_first) : 2 * (end - x_first)], first, shift, work)
        for i in range(states.size):
            done[i] += _track_piece(
                work,
                first,
                end,
                shift,
                secondary[i],
                replicas[i],
                lags[i],
                starts[i],
                slots[i],
                constants[i],
                states[i],
                pilots[i],
                totals[i],
                periods[i, done[i] :],
                banks[i, done[i] :],
            )


@njit(cache=True, nogil=True)
def _track_piece(
    work, piece_first, piece_end, shift, secondary, replicas, lags, starts, slots, c, s, pilot, total, periods, banks
):
    """Track a channel to the end of a piece of samples, and return the number of code periods that end in the piece."""
    n_done = 0
    while s.mode != LOST and s.next_sample < piece_end:
        if not abs(s.code_rate * c.sample_rate_hz / c.chip_rate_hz - 1.0) < _LARGEST_RATE - 1.0:
            s.mode = LOST  # no Doppler is so large, and a piece has no room for more segments
            break
        count = np.int64(np.ceil((CODE_LENGTH - s.code_phase) / s.code_rate))
        done = s.next_sample - s.first_sample
        new = min(s.first_sample + count, piece_end) - s.next_sample
        s.data += add_to_bank(
            work,
            s.next_sample - piece_first,
            new,
            replicas,
            2 * c.segments * (s.code_phase + done * s.code_rate),
            2 * c.segments * s.code_rate,
            s.carrier_cycles + done * s.carrier_step - removed_cycles(s.next_sample, shift),
            s.carrier_step - shift / REMOVED_STEPS,
            lags,
            starts,
            slots,
            pilot,
        )
        s.next_sample += new
        if done + new < count:
            break
        if not np.isfinite(np.abs(s.data) + np.sum(np.abs(pilot))):
            s.mode = LOST  # some samples are not numbers, and the loops cannot use these samples
            break
        pilot *= secondary[s.period % PERIODS_PER_SECONDARY]
        out = periods[n_done]
        out.number, out.first_sample = s.period, s.first_sample
        out.code_phase, out.code_rate = s.code_phase, s.code_rate
        out.carrier_cycles, out.carrier_step, out.doppler_rate = s.carrier_cycles, s.carrier_step, s.doppler_rate
        out.data = s.data
        for k in range(lags.size):
            banks[n_done, k] = pilot[k]

        s.first_sample += count
        s.code_phase += count * s.code_rate - CODE_LENGTH
        s.carrier_cycles += count * s.carrier_step
        total += pilot
        s.integrated += 1
        if _lock(c, s, pilot[c.prompt]):
            total *= -1.0
        s.period += 1
        if s.integrated == c.periods:
            _update(c, s, total)
            s.integrated, total[:] = 0, 0.0
        out.cn0_dbhz, out.phase_lock = s.cn0_dbhz, s.phase_lock
        out.locked = s.mode == TRACKING and s.noise > 0.0 and s.slipped == 0
        s.data, pilot[:] = 0.0, 0.0
        n_done += 1
    return n_done


@njit(cache=True, nogil=True)
def _update(c, s, total):
    """Update the loops with the bank of one integration."""
    early, prompt, late = total[c.early], total[c.prompt], total[c.late]
    t = c.interval_s
    # the in-phase part has no bias from noise, but measures the amplitude only while the phase is locked
    size = np.hypot(prompt.real, prompt.imag) if s.mode == PULL_IN else prompt.real
    if c.phase_kind == ARCTAN:
        size = abs(size)  # the in-phase part is negative while the loop is locked half a cycle away
    s.amplitude = size if s.amplitude == 0.0 else s.amplitude + t / _AMPLITUDE_TIME_S * (size - s.amplitude)
    rate_hz = 0.0
    angle = _phase_error(c.phase_kind, prompt, s.amplitude)
    if s.mode == PULL_IN:
        if s.pulled_in > 0:
            cross = prompt.imag * s.last_re - prompt.real * s.last_im
            dot = prompt.real * s.last_re + prompt.imag * s.last_im
            gain = 1.0 / (1.0 / c.fll + s.pulled_in)  # the gain decreases, so that the whole pull-in is averaged
            s.doppler_hz += gain * np.arctan2(cross, dot) / (2 * np.pi * t)
        s.pulled_in += 1
        if s.pulled_in == c.pull_in:
            s.mode = TRACKING
            s.in_phase = s.amplitude / c.periods
            # the PLL starts without a phase error
            s.carrier_cycles += np.arctan2(prompt.imag, prompt.real) / (2 * np.pi)
            # measurements during the pull-in are not used, because the carrier still rotates
            s.noise, s.signal, s.mean_lock = 0.0, 0.0, 0.0
            s.sum_re, s.sum_im, s.sum_in_phase, s.summed = 0.0, 0.0, 0.0, 0
    else:
        s.pulled_in += 1
        s.doppler_rate += c.pll[2] * angle / t**2
        s.doppler_hz += s.doppler_rate * t + c.pll[1] * angle / t
        rate_hz = c.pll[0] * angle / t
    s.last_re, s.last_im = prompt.real, prompt.imag
    s.carrier_step = (c.intermediate_hz + s.doppler_hz + rate_hz) / c.sample_rate_hz

    if c.code_kind == 0:
        difference = (late.real**2 + late.imag**2) - (early.real**2 + early.imag**2)
    else:
        difference = (late.real - early.real) * prompt.real + (late.imag - early.imag) * prompt.imag
    # code error in chips, positive if the signal is later than the replica
    error = c.code_scale * difference / s.amplitude**2 if s.amplitude > 0.0 else 0.0
    error = min(max(error, -0.5), 0.5)
    s.code_drift -= c.dll[1] * error / t
    drift = s.code_drift - c.dll[0] * error / t
    s.code_rate = (c.chip_rate_hz * (1.0 + s.doppler_hz / c.carrier_hz) + drift) / c.sample_rate_hz


@njit(cache=True, nogil=True)
def _phase_error(kind, prompt, amplitude):
    """Return the phase error of the carrier in cycles, from the discriminator `kind`.

    The normalized quadrature is linear in the noise, while an arctangent increases the noise of weak signals.
    """
    if kind == 1:
        return np.arctan2(prompt.imag, prompt.real) / (2 * np.pi)
    if kind == ARCTAN:
        return np.arctan(prompt.imag / prompt.real) / (2 * np.pi) if prompt.real != 0.0 else 0.0
    size = max(amplitude, 0.5 * np.hypot(prompt.real, prompt.imag))
    if size <= 0.0:
        return 0.0
    if prompt.real < 0.0:  # the error exceeds a quarter of a cycle
        return 0.25 if prompt.imag > 0.0 else -0.25
    return min(max(prompt.imag / size / (2 * np.pi), -0.25), 0.25)


@njit(cache=True, nogil=True)
def _lock(c, s, prompt):
    """Add a prompt to the sums of its secondary code; after 25 prompts compute C/N0, phase lock and loss of signal.

    Return whether the phase of the replica's carrier was moved by half a cycle. A loop with the arctangent can lock
    half a cycle away from the carrier. In this case the prompts have the opposite sign of the known secondary code.
    """
    s.sum_re += prompt.real
    s.sum_im += prompt.imag
    s.sum_in_phase += prompt.real**2
    s.summed += 1
    if s.mode == TRACKING:
        s.in_phase += _IN_PHASE_SHARE * (prompt.real - s.in_phase)
        s.turned |= s.in_phase < _TURNED * s.amplitude / c.periods
    if s.period % PERIODS_PER_SECONDARY != PERIODS_PER_SECONDARY - 1:
        return False
    wide = s.sum_re**2 + s.sum_im**2
    if s.summed == PERIODS_PER_SECONDARY and wide > 0.0:
        n = PERIODS_PER_SECONDARY
        noise = max(s.sum_in_phase - s.sum_re**2 / n, 0.0) / (n - 1)  # variance of the in-phase part
        signal = (s.sum_re / n) ** 2 - noise / n
        share = 1.0 if s.noise == 0.0 else _CN0_SHARE
        s.noise += share * (noise - s.noise)
        s.signal += share * (signal - s.signal)
        period_s = c.interval_s / c.periods
        good = s.signal > 0.0 and s.noise > 0.0
        s.cn0_dbhz = 10 * np.log10(s.signal / (2 * s.noise) / period_s) if good else np.nan
        s.phase_lock = (s.sum_re**2 - s.sum_im**2) / wide
        first = s.mean_lock == 0.0
        s.mean_lock = s.phase_lock if first else s.mean_lock + _LOCK_SHARE * (s.phase_lock - s.mean_lock)
        if s.mode == TRACKING:
            weak = not s.cn0_dbhz >= c.min_cn0_dbhz
            s.bad = s.bad + 1 if weak or s.mean_lock < c.min_phase_lock else 0
            unlocked = s.turned != 0 or min(s.phase_lock, s.mean_lock) < c.slip_phase_lock
            s.slipped = 1 if unlocked else 0
            s.turned = 0
    elif s.summed == PERIODS_PER_SECONDARY:
        s.bad += 1  # the prompts have no power
    if s.bad > c.patience:
        s.mode = LOST
    opposite = c.phase_kind == ARCTAN and s.mode == TRACKING and s.sum_re < -abs(s.sum_im)
    if opposite:
        s.carrier_cycles += 0.5
        s.in_phase = -s.in_phase
    s.sum_re, s.sum_im, s.sum_in_phase, s.summed = 0.0, 0.0, 0.0, 0
    return opposite
