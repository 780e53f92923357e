"""Compute which signal an E1 tracking loop follows under attack, and when a spoofing signal captures the loop.

Theory of operation
-------------------
R is the autocorrelation of BOC(1,1). Signal i has the complex amplitude a_i, the delay τ_i and the Doppler f_i. The
first signal is the true signal (a = 1, τ = 0). The correlator at x has the mean power

    P(x) = Σ_ij Re(a_i a_j* H_ij) R(x − τ_i) R(x − τ_j)         H_ij = 1/(1 + j 2π(f_i − f_j)/4B)

H_ij is the part of the beat between signals i and j that passes the loop. The loop has the noise bandwidth B and its
pole at 4B rad/s. If the phase between two signals changes slowly, the amplitudes of the signals add. If the phase
between two signals changes fast, the powers of the signals add. The loop settles at a stable zero of P(x − d/2) − P(x +
d/2), where d is the early-late spacing. When the signals change, the loop moves to the nearest zero in the direction of
its discriminator. So the position of the loop depends on earlier positions. A loop stays on the peak that the loop
already tracks. If the epochs are at most 30 s apart, the model computes steps of at most 0.1 s, which are short enough
for pull-off rates up to 100 m/s. With longer intervals the model computes 300 steps for each epoch.

**Capture.** A spoofing signal may start aligned with the true signal and then move away. If the spoofing signal has
more power than the true signal, the loop follows the spoofing signal at any phase. With less power the spoofing signal
never captures the loop [JWCN18, Eq. 4-6]. With equal power the loop of the model can follow only a spoofing signal that
moves earlier. A spoofing signal that stays more than a chip away never captures a locked loop.

**Lock.** A receiver acquires the strongest signal if the C/N0 in the prompt correlator falls below the lock limit, or
if an attack restarts the receiver (`acquired`). The lock limit is 20 dBHz, or 6 dB below the undisturbed C/N0 if this
value is lower. Acquisition takes `reacquisition_s`, during which a signal above the lock limit must be present. E1 has
no measurements until the end of the acquisition. When a spoofing signal that the loop follows ends and no other signal
keeps the loop locked, the receiver acquires the strongest signal that is left. At the first epoch the receiver has
already completed its acquisition.

`REACQUISITION_S` is the reacquisition time of the tracking receiver on samples (`sample_processor.tracking`). The
tracking receiver looks for a lost satellite every second. The search takes 0.1 s of samples, and the pull-in of the
carrier takes 0.2 s. The receiver needs 0.2 s more to confirm C/N0 and phase lock. So the first observations come 0.5 to
1.5 s after the signal returns (`test_reacquisition.py`).

**Side peaks.** R² has side peaks half a chip from the main peak, which are 6 dB lower than the main peak. A loop stays
on the nearest peak. For example, the true signal vanishes, and a spoofing signal that arrives 170 m after the true
signal stays on air. The loop then moves later by 16 m to a side peak of the spoofing signal, and not to the main peak.
The tracking loops on samples also stay on the nearest peak, because these loops do not look for side peaks. The loop of
the model and the loops on samples settle a quarter of their early-late spacing before the side peak. The loop of the
model has d = 0.1 chip and moves by 16 m. On samples of 12.3 MHz d is 0.166 chip, and the loop moves by 11 m.

The model leaves out the carrier loop, the dynamics of the delay loop, and reflections. The tracked Doppler of the model
is the Doppler of the strongest signal in the prompt correlator. The error that reflections cause is added separately
(`e1_multipath`).

If both signals have the same carrier frequency, the tracking loops on samples follow the same signal as the model. The
results differ if the spoofing signal's Doppler agrees with its pull-off rate and jumps by more than the carrier loop's
bandwidth. After a jump of 210 Hz the loops on samples stay with the true signal. After a jump of 26 Hz the two signals
beat, so the loops lose both signals and then acquire the stronger signal. If the results of model and samples differ,
the model favours the attacker.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from jaxtyping import Bool, Float, Shaped

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_loop_kernel import follow_peak
from vestige.receiver.draws import joined_blocks
from vestige.records import Band
from vestige.signals.definitions import E1C
from vestige.signals.pulse import BOC11, autocorrelation
from vestige.spoofer.spoofer import Spoofer

LOCK_DBHZ = 20.0  # C/N0 below which E1-C is no longer tracked; lower for weak signals
REACQUISITION_S = 1.0  # time from when a signal can be acquired to the first measurement
_LOCK_RANGE_DB = 6.0  # largest drop in dB below the undisturbed C/N0 at which a weak signal stays locked
_SPACING_CHIPS = 0.1  # d, the early-late spacing
_STEP_S = 0.1
_MAX_STEPS = 300  # largest number of steps per epoch
_PIECE_STEPS = 60_000  # number of steps computed at a time, which limits the memory
_METRES_A_CHIP = SPEED_OF_LIGHT_MPS / E1C.chip_rate_hz
_NO_POWER = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Tracking:
    """Effect of spoofing signals and added noise on E1 tracking, for each epoch.

    Without an attack the errors are 0, the gain is 1, and the receiver tracks the true signal.
    """

    error_m: Float[np.ndarray, " n"]  # error of the pseudorange in m
    worst_error_m: Float[np.ndarray, " n"]  # pseudorange error of largest magnitude since the previous epoch
    rate_error_mps: Float[np.ndarray, " n"]  # error of the range rate, from the Doppler of the tracked signal
    gain: Float[np.ndarray, " n"]  # C/N0 of the tracked signal divided by the C/N0 of the undisturbed true signal
    # Whether the receiver acquires a signal and has no measurements. During an acquisition, error and gain belong to
    # the signal that the receiver will acquire.
    acquiring: Bool[np.ndarray, " n"]
    # whether the receiver tracks, and a spoofing signal is the strongest signal in the prompt correlator
    captured: Bool[np.ndarray, " n"]
    # whether the strongest signal has the attacker's own navigation data, which are then demodulated
    forged_nav_data: Bool[np.ndarray, " n"]


class E1Loop:
    """Model of one satellite's E1 loop through an attack, epoch after epoch.

    `cn0_dbhz` is the C/N0 of undisturbed E1-C, and `loop_bandwidth_hz` is the noise bandwidth B of the loop.
    `reacquisition_s` is the duration of an acquisition.
    """

    def __init__(
        self,
        spoofer: Spoofer,
        svid: int,
        *,
        interval_s: float,
        cn0_dbhz: float,
        loop_bandwidth_hz: float = 1.0,
        reacquisition_s: float = REACQUISITION_S,
    ) -> None:
        self._spoofer, self._svid, self._interval_s = spoofer, svid, interval_s
        self._steps = min(max(ceil(interval_s / _STEP_S - 1e-9), 1), _MAX_STEPS)
        half = len(BOC11.levels)
        self._levels = autocorrelation(BOC11, np.arange(-half, half + 1) / half)
        self._pole_hz = 4 * loop_bandwidth_hz / (2 * pi)
        self._lock = 10 ** ((min(LOCK_DBHZ, cn0_dbhz - _LOCK_RANGE_DB) - cn0_dbhz) / 10)
        self._acquisition_steps = ceil(reacquisition_s * self._steps / interval_s - 1e-9)
        self._place, self._wait = 0.0, 0

    def advance(self, first: int, count: int) -> E1Tracking:
        """Return the tracking of E1 at the next epochs, `first` to `first + count − 1`."""
        if not self._spoofer.attacks:
            zero, never = np.zeros(count), np.zeros(count, bool)
            return E1Tracking(
                error_m=zero,
                worst_error_m=zero,
                rate_error_mps=zero,
                gain=np.ones(count),
                acquiring=never,
                captured=never,
                forged_nav_data=never,
            )
        at_once = max(1, _PIECE_STEPS // self._steps)
        pieces = [
            self._piece(begin, min(at_once, first + count - begin)) for begin in range(first, first + count, at_once)
        ] or [self._piece(first, 0)]
        return joined_blocks(pieces)

    def _piece(self, first: int, count: int) -> E1Tracking:
        epochs = np.repeat(first + np.arange(count), self._steps)
        back = np.tile(np.arange(self._steps - 1, -1, -1), count)
        times_s = epochs * self._interval_s - back * (self._interval_s / self._steps)
        back_before, epochs_before = (back + 1) % self._steps, epochs - (back == self._steps - 1)
        before_s = epochs_before * self._interval_s - back_before * (self._interval_s / self._steps)
        effects = self._spoofer.effects(Band.E1, self._svid, times_s)
        one, zero = np.ones((times_s.size, 1)), np.zeros((times_s.size, 1))
        doppler_hz = _joined(zero, effects.doppler_hz)
        noise = 1.0 + effects.rise(Band.E1)
        place, power, dominant, wait = follow_peak(
            self._levels,
            self._place,
            self._wait,
            _joined(zero, effects.delay_m / _METRES_A_CHIP),
            _joined(one + 0j, effects.amplitude),
            doppler_hz,
            self._spoofer.acquired_anew(self._svid, before_s, times_s),
            self._lock * noise,
            np.where(times_s > 0, self._acquisition_steps, 0),
            _SPACING_CHIPS / 2,
            self._pole_hz,
        )
        if place.size:
            self._place, self._wait = float(place[-1]), int(wait[-1])
        epoch = slice(self._steps - 1, None, self._steps)
        error_m = place.reshape(count, self._steps) * _METRES_A_CHIP
        # a step without a measurement counts as a step without error
        measured_m = np.where(wait.reshape(error_m.shape) > 0, 0.0, error_m)
        worst = np.argmax(np.abs(measured_m), axis=1) if count else np.zeros(0, np.int64)
        acquiring = wait[epoch] > 0
        tracked_hz = doppler_hz[np.arange(times_s.size), dominant][epoch]
        return E1Tracking(
            error_m=error_m[:, -1],
            worst_error_m=measured_m[np.arange(count), worst],
            rate_error_mps=-tracked_hz * SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ + 0.0,
            gain=(np.maximum(power, _NO_POWER) / noise)[epoch],
            acquiring=acquiring,
            captured=(dominant[epoch] > 0) & ~acquiring,
            forged_nav_data=np.concatenate([[False], effects.forged_nav_data])[dominant[epoch]],
        )


def _joined(true: Shaped[np.ndarray, "n 1"], others: Shaped[np.ndarray, "n m"]) -> Shaped[np.ndarray, "n sources"]:
    """Return the values of all signals, stored row by row, so that the kernel is compiled for one layout only."""
    return np.ascontiguousarray(np.concatenate([true, others], axis=1))
