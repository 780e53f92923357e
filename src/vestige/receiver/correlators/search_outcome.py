"""Draw the outcome of the vestigial searches for one satellite from detection theory, without samples.

Theory of operation
-------------------
The true signal and all spoofing signals are on air, with amplitudes a_i, delays τ_i and Dopplers f_i. At the delay and
Doppler of signal i, a correlator with the integration time T receives the sum of all signals,

    h_i = Σ_j a_j R(τ_i − τ_j) sinc((f_j − f_i) T),      s_i² = 2 (C/N0) T |h_i|² L_i / (1 + ρ)

So only the remainder of a nulled signal counts. ρ is the noise power that an attack adds, relative to the receiver's
noise. L_i is the loss due to the distance from the nearest cell of the grid. On E1 and in the exhaustive search the
distance is drawn for every signal, uniformly over a step of code and of Doppler. In the hand-over search the distance
from the nearest tap follows from the delays that were measured on E1. The statistic of the nearest cell is compared
with the threshold for which all cells together have the false-alarm probability `p_fa`. The statistics are

    E1          K = 48 squared magnitudes (24 periods, two components), χ²(2K) about the mean Σ s² + 2K
    hand-over   |s + z|,  z ~ CN(0, 2), at the nearest tap; only at the delays of signals found on E1
    exhaustive  |s + z|,  the same samples, so the same z; at any delay

In a real search a neighbouring cell may be stronger. The model leaves out this effect, so P_d is too low by about 0.02
near P_d = ½ (docs/vestigial_search.md).

If two signals are closer than the separation rule allows, only the stronger signal counts. On E1 the rule is two chips
modulo 4 ms. In E6 the rule is the larger of one chip and 2¼ − s/s' chips. The weaker signal has the amplitude s, and
the stronger signal has the amplitude s'. The limit of 2¼ − s/s' chips is needed because the fine search of the weaker
signal can end on the flank of the stronger signal. The fine search covers 1¼ chips on both sides of its cell. On E1 a
signal that is more than 16 dB below the strongest signal does not count. On E1 every other signal counts that is found
and obeys the separation rule. In E6 only a signal with the chips of the RECS counts. Each search that is run has a
false alarm with the probability p_fa. A false alarm in E6 lies anywhere in the window.

The earliest signal in E6 is taken as the true signal. A receiver uses the delay of this signal minus the predicted E6 −
E1 delay as a range. This range has three errors: the delay of the earliest signal relative to the true signal, the
residuals of ionosphere and group delays as in every hand-over, and the noise of a single snapshot. After a hand-over
search the range is used if at least as many signals were found in E6 as on E1. The range is also used if the search is
sure not to miss any signal of E1. The search is sure if every signal found on E1 has P_d ≥ 0.9999 at its C/N0 on E1 and
a code error of a quarter chip. After an exhaustive search the range is used if at least two signals were found. A
single signal may be the spoofing signal, with the true signal lost in noise.

In this model multipath components do not count as signals of their own. The model also searches for a satellite that is
more than 16 dB weaker than the strongest other satellite.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Complex128, Float, Int64

from vestige.constants import E1_CODE_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.receiver.draws import DRAW_BLOCK, drawn_rows
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.sample_processor.acquisition import CROSS_CORRELATION_DB, MAX_STRETCHES
from vestige.sample_processor.search.e1_search import BLIND_CHIPS
from vestige.signals.definitions import E1C, E6C
from vestige.signals.pulse import BOC11, BPSK, autocorrelation, band_limited_autocorrelation
from vestige.spoofer.spoofer import BandEffects
from vestige.streams import stream
from vestige.theory.search_budget import SEARCH_P_FA
from vestige.theory.thermal_noise import MBOC, snapshot_noise_bound_m
from vestige.theory.thresholds import correlator_amplitude, probability_of_detection, threshold

SURE_PD = 0.9999  # smallest P_d at which a hand-over search counts as sure to find a signal
_WORST_CODE_LOSS_DB = 2.5  # loss in dB at a code error of a quarter chip
WINDOW_S = 15.0  # half width of the search window in s; a receiver that searches does not rely on its clock
HANDOVER_TAPS = 5  # number of correlators of the hand-over search, at half-chip intervals
FINE_REACH_CHIPS = 1.25  # reach of the fine search `peak_at` on each side of a cell
_E1_BAND_HZ = 4.096e6  # bandwidth of the E1 search, which passes 86 % of the power of BOC(1,1)
_E1_PHASES = 16384  # number of code phases of a period in the band of the E1 search, ¼ chip apart
_E1_BINS, _E1_BIN_HZ = 81, 125.0
_E6_BINS = 321  # number of Dopplers within ±5 kHz, 1/(2 T) apart for T = 16 ms
_MEASURE_SIGMA_M = 3.0  # standard deviation in m of a code phase that is measured in 100 ms of E1
_E6_BANDWIDTH_HZ = 2 * E6C.chip_rate_hz
# `_range_noise_m` is called with 0 dBHz, and the caller divides the result by the square root of C/N0
_range_noise_m = cache(snapshot_noise_bound_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchOutcome:
    """Outcome of the searches for one satellite, for each epoch."""

    e1_signals: Float[np.ndarray, " n"]  # number of signals found on E1; 0 means no hand-over
    # number of signals that the hand-over search found in E6; 0 if the hand-over search was not run
    handover_carrying: Float[np.ndarray, " n"]
    # error of the E1 range that follows from the earliest signal in E6; NaN if no search was run, no signal was found,
    # or a signal could have been missed
    handover_error_m: Float[np.ndarray, " n"]
    exhaustive_signals: Float[np.ndarray, " n"]  # number of signals found by the exhaustive search
    # error of the E1 range that follows from the earliest signal of the exhaustive search; NaN with fewer than two
    # signals
    exhaustive_error_m: Float[np.ndarray, " n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BandSignals:
    """The signals of one satellite in one band at each epoch; the true signal is the first."""

    # amplitude, delay and Doppler are relative to the true signal; amplitude 0 means no signal
    amplitude: Complex128[np.ndarray, "n k"]
    delay_m: Float[np.ndarray, "n k"]
    doppler_hz: Float[np.ndarray, "n k"]
    cn0_dbhz: Float[np.ndarray, " n"]  # C/N0 of the true signal, with all noise that is present


def band_signals(effects: BandEffects, band: Band, cn0_dbhz: Float[np.ndarray, " n"]) -> BandSignals:
    """Return the signals of a band; an E6 signal with chips that the attacker invented has the amplitude 0.

    `cn0_dbhz` is the C/N0 of the true signal without attack; −∞ or NaN means no signal.
    """
    n = cn0_dbhz.size
    present = np.where(np.isfinite(cn0_dbhz), 1.0, 0.0)[:, None]
    added = np.where(effects.forged_chips & (band is Band.E6), 0.0, effects.amplitude)
    zero = np.zeros((n, 1))
    return BandSignals(
        amplitude=np.concatenate([present + 0j, added * present], axis=1),
        delay_m=np.concatenate([zero, effects.delay_m], axis=1),
        doppler_hz=np.concatenate([zero, effects.doppler_hz], axis=1),
        cn0_dbhz=np.nan_to_num(cn0_dbhz, nan=0.0, neginf=0.0) - 10 * np.log10(1 + effects.rise(band)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchDraws:
    """Random draws for the searches of a block of epochs; each array except `alarm` has a column for each signal."""

    e1_cell: Float[np.ndarray, "n k 2"]  # offset from the nearest cell of code and Doppler, −½ to ½ step
    e6_cell: Float[np.ndarray, "n k 2"]
    e1_z: Complex128[np.ndarray, "n k"]  # noise of unit variance per dimension in the tested cell
    e6_z: Complex128[np.ndarray, "n k"]
    e1_rest: Float[np.ndarray, "n k"]  # sum of the other K − 1 squared magnitudes of E1, χ²(2K − 2)
    measured: Float[np.ndarray, "n k 2"]  # errors of E1's code phase and of the range in E6, σ = 1
    # Uniform draws: each of the first three gives a false signal if the draw is below `p_fa` (on E1, at the hand-over,
    # in the exhaustive search). The last draw gives the delay of the false signal.
    alarm: Float[np.ndarray, "n 4"]


def search_draws(rng: np.random.Generator, n: int, signals: int, *, periods: int = MAX_STRETCHES) -> SearchDraws:
    """Return the draws of n searches with the given numbers of signals and of code periods on E1."""
    shape = (n, signals)
    normal = rng.standard_normal((6, *shape))
    return SearchDraws(
        e1_cell=rng.random((*shape, 2)) - 0.5,
        e6_cell=rng.random((*shape, 2)) - 0.5,
        e1_z=normal[0] + 1j * normal[1],
        e6_z=normal[2] + 1j * normal[3],
        e1_rest=2 * rng.standard_gamma(2 * periods - 1, shape),
        measured=np.stack([normal[4], normal[5]], axis=-1),
        alarm=rng.random((n, 4)),
    )


def search_outcome(
    truth: TruthBlock,
    *,
    cn0_e1_dbhz: float,
    cn0_e6_dbhz: float,
    integration_s: float,
    seed: int,
    svid: int,
    first: int,
    p_fa: float = SEARCH_P_FA,
    clock_offset_s: float = 0.0,
) -> SearchOutcome:
    """Return the outcome of the searches in the epochs from `first` on, which is the same for any block length.

    `cn0_e1_dbhz` and `cn0_e6_dbhz` are the C/N0 of the undisturbed pilots, before the effect of elevation. `p_fa` is
    the false-alarm probability of each search (see `outcome`). `clock_offset_s` is the error of the receiver's clock.
    """
    seen_db = np.where(truth.geometry.in_view, 20 * np.log10(truth.geometry.amplitude), -np.inf)
    e1 = band_signals(truth.e1_attack, Band.E1, cn0_e1_dbhz + seen_db)
    e6 = band_signals(truth.e6, Band.E6, cn0_e6_dbhz + seen_db)
    n, signals = e1.amplitude.shape
    draws = drawn_rows(first, n, lambda block: search_draws(stream(seed, "searches", block, svid), DRAW_BLOCK, signals))
    return outcome(
        e1,
        e6,
        draws,
        shift_m=truth.iono_diff_m + truth.bias_m,
        integration_s=integration_s,
        e1_p_fa=p_fa,
        exhaustive_p_fa=p_fa,
        clock_offset_s=clock_offset_s,
    )


def outcome(
    e1: BandSignals,
    e6: BandSignals,
    draws: SearchDraws,
    *,
    shift_m: Float[np.ndarray, " n"],
    integration_s: float,
    e1_p_fa: float = SEARCH_P_FA,
    exhaustive_p_fa: float = SEARCH_P_FA,
    window_s: float = WINDOW_S,
    periods: int = MAX_STRETCHES,
    clock_offset_s: float = 0.0,
) -> SearchOutcome:
    """Return the outcome of the searches for given signals and random draws.

    `shift_m` is the delay of E6 after E1 that the prediction does not contain. `e1_p_fa` is the false-alarm probability
    of each search of one satellite, on E1 and at the hand-over. `exhaustive_p_fa` is the false-alarm probability of the
    whole search of E6. `window_s` is half the width of the search window. The window lies around the time of
    transmission according to the receiver's clock, which has the error `clock_offset_s`.
    """
    on_e1 = _found_on_e1(e1, draws, e1_p_fa, periods)
    e1_count = on_e1.sum(axis=1) + (draws.alarm[:, 0] < e1_p_fa)
    tried = e1_count >= 2
    near = np.abs(e6.delay_m + clock_offset_s * SPEED_OF_LIGHT_MPS) <= window_s * SPEED_OF_LIGHT_MPS
    correlator_power = _correlator_power(e6, Band.E6, integration_s)
    strength = correlator_amplitude(e6.cn0_dbhz, integration_s)[:, None] * np.sqrt(correlator_power)

    rule = {"blind_m": _metres_a_chip(Band.E6), "fine_m": FINE_REACH_CHIPS * _metres_a_chip(Band.E6)}
    places = 2 * window_s / E1_CODE_PERIOD_S * np.maximum(e1_count, 1) * HANDOVER_TAPS
    p_fa = (e1_p_fa / places)[:, None]
    code_chips = _off_tap_chips(e1.delay_m + _MEASURE_SIGMA_M * draws.measured[..., 0], on_e1, e6.delay_m, shift_m)
    above = np.abs(strength * (1 - np.abs(code_chips)) + draws.e6_z) > threshold(p_fa)
    handover = _separate(above & near & tried[:, None] & (correlator_power > 0), correlator_power, e6.delay_m, **rule)
    predicted_dbhz = e1.cn0_dbhz[:, None] + 10 * np.log10(_correlator_power(e1, Band.E1, E1_CODE_PERIOD_S) + 1e-30)
    pd = probability_of_detection(predicted_dbhz - _WORST_CODE_LOSS_DB, integration_s, float(np.min(p_fa)))
    sure = (handover.sum(axis=1) >= e1_count) | np.all((pd >= SURE_PD) | ~on_e1, axis=1)

    cells = 4 * window_s * E6C.chip_rate_hz * _E6_BINS
    loss = (1 - np.abs(draws.e6_cell[..., 0]) / 2) * np.sinc(draws.e6_cell[..., 1] / 2)
    above = np.abs(strength * loss + draws.e6_z) > threshold(exhaustive_p_fa / cells)
    exhaustive = _separate(above & near & (correlator_power > 0), correlator_power, e6.delay_m, **rule)

    root_cn0 = np.maximum(strength / np.sqrt(2 * integration_s), 1.0)
    sigma_m = _range_noise_m(0.0, integration_s, _E6_BANDWIDTH_HZ) / root_cn0
    range_m = e6.delay_m + shift_m[:, None] + sigma_m * draws.measured[..., 1]
    anywhere_m = (2 * draws.alarm[:, 3] - 1) * window_s * SPEED_OF_LIGHT_MPS
    of_handover = _counted(handover, range_m, tried & (draws.alarm[:, 1] < e1_p_fa), anywhere_m)
    of_all = _counted(exhaustive, range_m, draws.alarm[:, 2] < exhaustive_p_fa, anywhere_m)
    return SearchOutcome(
        e1_signals=e1_count.astype(np.float64),
        handover_carrying=of_handover[0].astype(np.float64),
        handover_error_m=np.where(sure, of_handover[1], np.nan),
        exhaustive_signals=of_all[0].astype(np.float64),
        exhaustive_error_m=np.where(of_all[0] > 1, of_all[1], np.nan),
    )


def _counted(
    found: Bool[np.ndarray, "n k"],
    range_m: Float[np.ndarray, "n k"],
    false: Bool[np.ndarray, " n"],
    anywhere_m: Float[np.ndarray, " n"],
) -> tuple[Int64[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the number of signals, false alarms included, and the earliest range in m; NaN without a signal."""
    earliest_m = np.min(np.where(found, range_m, np.inf), axis=1)
    earliest_m = np.where(false, np.minimum(earliest_m, anywhere_m), earliest_m)
    return found.sum(axis=1) + false, np.where(np.isfinite(earliest_m), earliest_m, np.nan)


def _off_tap_chips(
    lines_m: Float[np.ndarray, "n k"],
    there: Bool[np.ndarray, "n k"],
    places_m: Float[np.ndarray, "n l"],
    shift_m: Float[np.ndarray, " n"],
) -> Float[np.ndarray, "n l"]:
    """Return the distance of each E6 signal from the nearest tap around a found E1 signal, in chips and at most 1."""
    apart_m = _wrapped(
        places_m[:, :, None] + shift_m[:, None, None] - lines_m[:, None, :], E1_CODE_PERIOD_S * SPEED_OF_LIGHT_MPS
    )
    chips = np.min(np.where(there[:, None, :], np.abs(apart_m), np.inf), axis=2) / _metres_a_chip(Band.E6)
    chips = np.minimum(chips, HANDOVER_TAPS)
    return np.minimum(np.abs(chips - np.clip(np.round(2 * chips) / 2, 0, (HANDOVER_TAPS - 1) / 4)), 1.0)


def _found_on_e1(air: BandSignals, draws: SearchDraws, p_fa: float, periods: int) -> Bool[np.ndarray, "n k"]:
    """Return whether the search of E1 detects each signal."""
    correlator_power = _correlator_power(air, Band.E1, E1_CODE_PERIOD_S)
    step_chips = E1_CODE_PERIOD_S * E1C.chip_rate_hz / _E1_PHASES
    shape, passed = _e1_shape()
    code = np.interp(np.abs(draws.e1_cell[..., 0]) * step_chips, *shape)
    loss = (code * np.sinc(draws.e1_cell[..., 1] * _E1_BIN_HZ * E1_CODE_PERIOD_S)) ** 2 * passed
    added = 2 * periods
    mean = 2 * added * 10 ** (air.cn0_dbhz[:, None] / 10) * E1_CODE_PERIOD_S * correlator_power * loss
    statistic = np.abs(np.sqrt(mean) + draws.e1_z) ** 2 + draws.e1_rest
    snr = np.maximum(statistic / (2 * added) - 1, 1e-3)  # estimated as in `CellPowers.acquisition`
    loud = snr > np.max(np.where(correlator_power > 0, snr, 0), axis=1, keepdims=True) * 10 ** (
        -CROSS_CORRELATION_DB / 10
    )
    blind_m = BLIND_CHIPS * _metres_a_chip(Band.E1)
    limit = threshold(p_fa / (_E1_PHASES * _E1_BINS), added) ** 2
    found = (statistic > limit) & loud & (correlator_power > 0)
    return _separate(found, statistic, air.delay_m, blind_m, period_m=E1_CODE_PERIOD_S * SPEED_OF_LIGHT_MPS)


def _correlator_power(air: BandSignals, band: Band, integration_s: float) -> Float[np.ndarray, "n k"]:
    """Return |h|² at the delay of each signal; 0 if there is no signal."""
    apart_m = air.delay_m[:, :, None] - air.delay_m[:, None, :]
    pulse = BOC11 if band is Band.E1 else BPSK
    if band is Band.E1:
        apart_m = _wrapped(apart_m, E1_CODE_PERIOD_S * SPEED_OF_LIGHT_MPS)
    shape = autocorrelation(pulse, (apart_m / _metres_a_chip(band)).ravel()).reshape(apart_m.shape)
    beat = np.sinc((air.doppler_hz[:, :, None] - air.doppler_hz[:, None, :]) * integration_s)
    correlator_power = np.abs(np.einsum("nij,nj->ni", shape * beat, air.amplitude)) ** 2
    return np.where(air.amplitude != 0, correlator_power, 0.0)


def _separate(
    found: Bool[np.ndarray, "n k"],
    strength: Float[np.ndarray, "n k"],
    delay_m: Float[np.ndarray, "n k"],
    blind_m: float,
    *,
    fine_m: float = 0.0,
    period_m: float = np.inf,
) -> Bool[np.ndarray, "n k"]:
    """Return whether each found signal is kept, because it is separate from every stronger signal that is kept.

    Separate signals are more than `blind_m` apart. If `fine_m` is given, separate signals are also more than `fine_m` +
    `blind_m` (1 − s/s') apart. The weaker signal has the amplitude s, and the stronger signal has the amplitude s'.
    Distances count modulo `period_m`.
    """
    order = np.argsort(np.where(found, -strength, np.inf), axis=1)
    rows = np.arange(found.shape[0])
    kept = np.zeros(found.shape, bool)
    for rank in range(found.shape[1]):
        mine = order[:, rank]
        apart_m = np.abs(_wrapped(delay_m - delay_m[rows, mine][:, None], period_m))
        weaker = np.sqrt(strength[rows, mine][:, None] / np.where(kept, strength, np.inf))
        rule_m = np.maximum(blind_m, fine_m + blind_m * (1 - weaker) if fine_m else 0.0)
        kept[rows, mine] = found[rows, mine] & ~np.any(kept & (apart_m <= rule_m), axis=1)
    return kept


def _wrapped(distance_m: Float[np.ndarray, "*n"], period_m: float) -> Float[np.ndarray, "*n"]:
    """Return a distance modulo a period, between −½ and ½ period."""
    return distance_m if np.isinf(period_m) else distance_m - period_m * np.round(distance_m / period_m)


def _metres_a_chip(band: Band) -> float:
    return SPEED_OF_LIGHT_MPS / (E1C if band is Band.E1 else E6C).chip_rate_hz


@cache
def _e1_shape() -> tuple[tuple[np.ndarray, np.ndarray], float]:
    """Return R of BOC(1,1) behind the filter of the search, and the power behind the filter.

    R(0) is 1. The power is the share of CBOC's power that is BOC(1,1) and passes the filter.
    """
    chips = np.linspace(0.0, 0.5, 51)
    shape = band_limited_autocorrelation(BOC11, chips, chip_rate_hz=E1C.chip_rate_hz, bandwidth_hz=_E1_BAND_HZ)
    return (chips, shape / shape[0]), float(shape[0]) * MBOC[BOC11]
