"""Compute E1 correlators and power of a single line of sight from samples, as a reference for `e1_taps`.

With a sky of several satellites, the correlators come from samples that all satellites share (`snapshots.sky_e1`).

Theory of operation
-------------------
For each epoch and satellite, samples of the length T = 0.1 s are synthesised. The samples contain E1-C with multipath,
spoofing signals, noise and jamming. The processor's own correlator processes the samples. The correlator processes
BOC(1,1) as a code of twice the chip rate, in which each chip is followed by its opposite. The signals of an epoch are
sent at a whole tenth of a second, at which the secondary code begins. Time zero is the delay x₀ at which the loop has
settled, so a signal of delay τ lies at τ − x₀. The sampling phase and the Dopplers of code and carrier follow from the
pseudorange. With M = f_s T samples of noise variance 1, the mean of samples times replica, multiplied by √(2M), is the
correlator ξ of `e1_taps` before the gain control.

The samples of each satellite have their own noise, which differs from the noise of a recording. The power of the band
comes from further samples with all satellites, at the sampling rate W. Without an attack the expected mean square of
these samples is 1 + Σ r_i. W and r_i are defined in `e1_taps`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Complex64, Complex128, Float, Int8

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_taps import (
    INTEGRATION_S,
    POWER_AVERAGING_S,
    POWER_BANDWIDTH_HZ,
    TAP_CHIPS,
    arriving,
)
from vestige.receiver.samples.sampled_attack import add_jammers
from vestige.receiver.truth import TruthBlock
from vestige.records import Band, ChipSequence, Handover, SampleBatch
from vestige.sample_processor.correlator import correlate
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.signals.codes import tiered_code
from vestige.signals.definitions import E1C
from vestige.time import GalileoTime

SAMPLE_RATE_HZ = 4e6  # sampling rate, which is no whole multiple of the chip rate
_CHIP_RATE_HZ = 2 * E1C.chip_rate_hz  # rate of BOC(1,1) as a code
_PERIOD_CHIPS = 2 * E1C.code_length * E1C.secondary_length
_SPARE_CHIPS = 64  # number of spare half chips on either side of the segment, 9 km
_MARGIN_S = 5e-6
_ANY_TIME = GalileoTime(0, 0)  # the samples of an epoch need no real time
_NOISE = 1  # number of the noise stream; each satellite has `_STREAMS_A_SATELLITE` streams, from `_E1` on
_STREAMS_A_SATELLITE, _E1 = 1 << 16, 1 << 32


def sampled_e1_taps(
    truth: TruthBlock,
    cn0_dbhz: Float[np.ndarray, " n"],
    multipath_m: Float[np.ndarray, " n"],
    *,
    with_rays: bool,
    seed: int,
    svid: int,
    first: int,
) -> Complex128[np.ndarray, "n n_taps"]:
    """Return the correlators ξ of one satellite before the gain control, from samples; NaN out of view.

    The parameters are the same as for `e1_taps`.
    """
    signals = arriving(truth, multipath_m, with_rays=with_rays)
    carrier_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS * (truth.rate_mps + truth.clock_drift_mps)
    phase = (truth.range_m + truth.clock_m) / SPEED_OF_LIGHT_MPS * SAMPLE_RATE_HZ % 1.0
    replica = e1c_replica(svid)
    offsets_m = np.array(TAP_CHIPS) / E1C.chip_rate_hz * SPEED_OF_LIGHT_MPS
    taps = np.full((truth.time_s.size, len(TAP_CHIPS)), np.nan + 0j)
    for row in np.flatnonzero(truth.geometry.in_view).tolist():
        start_s = _MARGIN_S + phase[row] / SAMPLE_RATE_HZ
        samples = _samples(
            _signals(
                svid,
                _PERIOD_CHIPS,
                start_s=start_s,
                doppler_hz=float(carrier_hz[row]),
                delay_m=signals.delay_m[row] - signals.settled_m[row],
                amplitude=amplitude(float(cn0_dbhz[row]), SAMPLE_RATE_HZ) * signals.amplitude[row],
                ray_doppler_hz=signals.doppler_hz[row],
            ),
            truth,
            row,
            rate_hz=SAMPLE_RATE_HZ,
            duration_s=INTEGRATION_S + 2 * _MARGIN_S,
            keys=(seed, first + row, _E1 + _STREAMS_A_SATELLITE * svid),
        )
        batch = SampleBatch(
            band=Band.E1,
            samples=samples,
            sample_rate_hz=SAMPLE_RATE_HZ,
            center_frequency_hz=E1_CARRIER_HZ,
            first_sample=0,
            start=_ANY_TIME,
        )
        handover = Handover(
            svid=svid,
            chips=replica,
            start_time=_ANY_TIME + start_s,
            doppler_hz=float(carrier_hz[row] + signals.followed_hz[row]),
            doppler_rate_hz_per_s=0.0,
        )
        bank = correlate(batch, handover, offsets_m)
        assert bank is not None  # noqa: S101  (the margin is ours)
        taps[row] = bank.taps * np.sqrt(2 * SAMPLE_RATE_HZ * bank.integration_s)
    return taps


def sampled_power_rise_db(
    truth: Sequence[TruthBlock],
    cn0_dbhz: Float[np.ndarray, "n m"],
    svids: tuple[int, ...],
    *,
    seed: int,
    first: int,
) -> Float[np.ndarray, " n"]:
    """Return the rise of the E1 power in dB over the power without attack, measured on samples.

    `truth` and `cn0_dbhz` are the same as for `band_power_rise_db`. `svids` are the satellites in the order of `truth`.
    `seed` and the number `first` of the first epoch determine the noise.
    """
    share = np.where(np.isfinite(cn0_dbhz), 10 ** (cn0_dbhz / 10), 0.0) / POWER_BANDWIDTH_HZ
    rise_db = np.empty(cn0_dbhz.shape[0])
    for row in range(rise_db.size):
        signals: list[ReceivedSignal] = []
        for column in np.flatnonzero(share[row] > 0).tolist():
            one = truth[column]
            carrier_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS * (one.rate_mps[row] + one.clock_drift_mps[row])
            on_air = np.concatenate([[1.0 + 0j], one.e1_attack.amplitude[row]])
            signals += _signals(
                svids[column],
                round(_CHIP_RATE_HZ * POWER_AVERAGING_S),
                start_s=0.0,
                doppler_hz=float(carrier_hz),
                delay_m=np.concatenate([[0.0], one.e1_attack.delay_m[row]]),
                amplitude=np.sqrt(share[row, column]) * on_air,
                ray_doppler_hz=np.concatenate([[0.0], one.e1_attack.doppler_hz[row]]),
            )
        samples = _samples(
            tuple(signals),
            truth[0],
            row,
            rate_hz=POWER_BANDWIDTH_HZ,
            duration_s=POWER_AVERAGING_S,
            keys=(seed, first + row, _E1),
        )
        rise_db[row] = 10 * np.log10(np.mean(np.abs(samples.astype(np.complex128)) ** 2) / (1 + share[row].sum()))
    return rise_db


def _signals(
    svid: int,
    n_chips: int,
    *,
    start_s: float,
    doppler_hz: float,
    delay_m: Float[np.ndarray, " k"],
    amplitude: Complex128[np.ndarray, " k"],
    ray_doppler_hz: Float[np.ndarray, " k"],
) -> tuple[ReceivedSignal, ...]:
    """Return all signals of a satellite on air; signals with a large `delay_m` have their own chip sequences."""
    present = np.abs(amplitude) > 0
    delay_chips = delay_m / SPEED_OF_LIGHT_MPS * _CHIP_RATE_HZ
    shift = np.where(np.abs(delay_chips) < _SPARE_CHIPS - 2, 0, np.floor(delay_chips)).astype(np.int64)
    found = []
    for one in np.unique(shift[present]).tolist():
        mine = present & (shift == one)
        found.append(
            ReceivedSignal(
                chips=_on_air(svid, one % _PERIOD_CHIPS, n_chips),
                start_s=start_s,
                doppler_hz=doppler_hz,
                doppler_rate_hz_per_s=0.0,
                delay_m=delay_m[mine] - one * SPEED_OF_LIGHT_MPS / _CHIP_RATE_HZ,
                amplitude=amplitude[mine],
                ray_doppler_hz=ray_doppler_hz[mine],
                lead_chips=_SPARE_CHIPS,
            )
        )
    return tuple(found)


def _samples(
    signals: tuple[ReceivedSignal, ...],
    truth: TruthBlock,
    row: int,
    *,
    rate_hz: float,
    duration_s: float,
    keys: tuple[int, int, int],
) -> Complex64[np.ndarray, " n_samples"]:
    """Return the samples of one epoch with noise and jamming; `keys` are seed, epoch and first stream."""
    seed, epoch, first_stream = keys
    attack = truth.e1_attack
    samples = synthesize(
        signals,
        sample_rate_hz=rate_hz,
        n_samples=int(np.ceil(duration_s * rate_hz)),
        noise_key=noise_key(seed, epoch, first_stream + _NOISE),
        noise_power=1.0 + float(attack.white[row]),
        carrier_hz=E1_CARRIER_HZ,
        center_frequency_hz=E1_CARRIER_HZ,
    )
    add_jammers(samples, attack.jammers, row, rate_hz=rate_hz, seed=seed, epoch=epoch, first_stream=first_stream)
    return samples


@lru_cache(maxsize=64)
def e1c_replica(svid: int) -> ChipSequence:
    """Return E1-C as BOC(1,1) with its secondary code over its period of 0.1 s, as half chips."""
    return _sequence(svid, np.kron(tiered_code(E1C, svid), np.array([1, -1], np.int8)).astype(np.int8))


@lru_cache(maxsize=32)
def _on_air(svid: int, shift: int, n_chips: int) -> ChipSequence:
    """Return the chips of a signal delayed by `shift` half chips, with spare chips before and after."""
    number = np.arange(-_SPARE_CHIPS, n_chips + _SPARE_CHIPS) - shift
    return _sequence(svid, e1c_replica(svid).chips[number % _PERIOD_CHIPS])


def _sequence(svid: int, chips: Int8[np.ndarray, " n_chips"]) -> ChipSequence:
    return ChipSequence.of(svid=svid, transmit_time=_ANY_TIME, chip_rate_hz=_CHIP_RATE_HZ, chips=chips)
