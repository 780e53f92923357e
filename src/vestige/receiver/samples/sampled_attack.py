"""Make the spoofing signals and jamming waveforms that an attack adds to E6 at the `samples` fidelity.

A spoofing signal on E6 repeats the encrypted signal of the line of sight with a delay, or has chips that the attacker
invented. At the receiver, chip i of the spoofing signal arrives τ + τ̇ i T_c later than chip i of the true signal. Chip
0 is the first chip of the RECS, and τ is its delay. τ̇ is the rate of the delay, and T_c is the duration of a chip. So
the chips of the spoofing signal in a window of samples were sent τ earlier than the chips of the true signal in this
window. If τ is several seconds, the chips are a part of the keystream that the satellite sent τ earlier. The travel
time of these chips is computed along the line of sight for the time of their transmission. The chips fill the window
and the margins of the window.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Complex64

from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.draws import rows_of
from vestige.receiver.samples.sampled_epoch import Window, arrival, received_signal
from vestige.receiver.truth import TruthBlock
from vestige.signal_generator.keystream import encrypted_chips
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.range_model import RangeHistory
from vestige.signal_generator.synthesis import ReceivedSignal
from vestige.signals.definitions import E6C
from vestige.spoofer.attack import Jamming
from vestige.spoofer.jammers import power_in_samples
from vestige.time import GalileoTime

# number of spare chips on either side of a window, because the computed position of the chips has an error of up to a
# chip
_SPARE_CHIPS = 16
_FAR_M = 1e3  # E1 error in m above which a window contains other chips of the true signal than the RECS
_SAME_ARRIVAL_S = 5e-3  # time in s in which a range with a rate of 10 km/s changes by less than a chip
_JAMMER = 16  # number of the random stream of the first jammer, counted from `first_stream`


def spoofing_signals(
    keys: tuple[bytes, bytes],
    svid: int,
    sent: GalileoTime,
    line_of_sight: RangeHistory,
    truth: TruthBlock,
    row: int,
    taken: Window,
    *,
    amplitude: float,
) -> tuple[ReceivedSignal, ...]:
    """Return the spoofing signals that arrive in a window of samples.

    The field `start_s` of a signal is in s after the epoch. `keys` are two keys: the key of the service's encryption,
    and the key of the chips that attackers invent. `amplitude` is the amplitude of the line of sight.
    """
    effects, metres_a_hz = truth.e6, SPEED_OF_LIGHT_MPS / E6_CARRIER_HZ
    signals = []
    for k in range(effects.power_db.shape[1]):
        if effects.power_db[row, k] == -math.inf:
            continue
        delay_m, delay_rate_mps = float(effects.delay_m[row, k]), float(effects.delay_rate_mps[row, k])
        doppler_hz = float(effects.doppler_hz[row, k])
        first, n_chips = _on_air(taken, line_of_sight, truth, row, delay_m)
        later_s = first / E6C.chip_rate_hz
        chips = encrypted_chips(keys[int(effects.forged_chips[k])], svid, sent + later_s, n_chips)
        direct = arrival(line_of_sight, truth, slice(row, row + 1), later_s)
        strength = 10 ** (effects.power_db[row, k] / 20) * np.exp(1j * effects.phase_rad[row, k])
        turned = np.exp(2j * np.pi * ((doppler_hz * later_s) % 1.0))
        late_s = (delay_m + delay_rate_mps * later_s) / SPEED_OF_LIGHT_MPS
        signals.append(
            ReceivedSignal(
                chips=chips,
                start_s=later_s + float(direct.dt_s[0]) + late_s,
                doppler_hz=-(float(direct.rate_mps[0]) + delay_rate_mps) / metres_a_hz,
                doppler_rate_hz_per_s=-float(direct.acceleration_mps2[0]) / metres_a_hz,
                delay_m=np.zeros(1),
                amplitude=amplitude * direct.carrier * strength * turned,
                ray_doppler_hz=np.array([doppler_hz + delay_rate_mps / metres_a_hz]),
            )
        )
    return tuple(signals)


def true_signal(
    key: bytes,
    svid: int,
    sent: GalileoTime,
    line_of_sight: RangeHistory,
    truth: TruthBlock,
    row: int,
    taken: Window,
    *,
    amplitude: float,
) -> ReceivedSignal | None:
    """Return the true signal in a window that an attacker has moved by at least `_FAR_M`, or None for any other window.

    `key` is the key of the service's encryption. The other parameters have the same meaning as in `spoofing_signals`.
    """
    if abs(truth.e1.error_m[row]) < _FAR_M:
        return None
    first, n_chips = _on_air(taken, line_of_sight, truth, row, 0.0)
    later_s = first / E6C.chip_rate_hz
    chips = encrypted_chips(key, svid, sent + later_s, n_chips)
    alone = rows_of(truth, slice(row, row + 1))
    arrived = arrival(line_of_sight, alone, later_s=later_s)
    return received_signal(chips, arrived, alone, 0, amplitude=amplitude, later_s=later_s)


def add_jammers(
    samples: Complex64[np.ndarray, " n"],
    jammers: tuple[Jamming, ...],
    row: int,
    *,
    rate_hz: float,
    seed: int,
    epoch: int,
    first_stream: int,
) -> None:
    """Add the jamming waveforms of the epoch in row `row` of a block to samples whose noise has variance 1."""
    for number, one in enumerate(jammers):
        if one.j_over_n[row] > 0:
            power = power_in_samples(one.waveform, float(one.j_over_n[row]), one.noise_bandwidth_hz, rate_hz)
            one.waveform.add(samples, power, rate_hz, noise_key(seed, epoch, first_stream + _JAMMER + number))


def _on_air(taken: Window, line_of_sight: RangeHistory, truth: TruthBlock, row: int, delay_m: float) -> tuple[int, int]:
    """Return the number of the first chip of a delayed signal in a window, and the number of chips in the window.

    Chip 0 is the first chip of the RECS. The result includes `_SPARE_CHIPS` spare chips on either side of the window.
    """
    delay_s = delay_m / SPEED_OF_LIGHT_MPS
    arrival_s = taken.expected_s - float(truth.e1.error_m[row]) / SPEED_OF_LIGHT_MPS + delay_s
    if abs(taken.start_s - arrival_s) > _SAME_ARRIVAL_S:
        sent_s = taken.start_s - arrival_s
        arrival_s = float(arrival(line_of_sight, truth, slice(row, row + 1), sent_s).dt_s[0]) + delay_s
    first = math.floor((taken.start_s - arrival_s) * E6C.chip_rate_hz) - _SPARE_CHIPS
    last = math.ceil((taken.stop_s - arrival_s) * E6C.chip_rate_hz) + _SPARE_CHIPS
    return first, last - first
