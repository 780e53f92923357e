"""Compute the noise of all codes and the power of all signals of a sky for simulated E1 correlators.

Theory of operation
-------------------
Satellite j sends E1-B and E1-C, each with the C/N0 c_j, as CBOC(6,1,1/11) with the signs + and −. The replica of E1-C
in a correlator is BOC(1,1).

**Unaligned signals** are signals of other satellites, and signals of the same satellite that are a chip or more away
from the replica. u = Σ c_j p_j is the power of one component of all unaligned signals divided by N0, in Hz. p_j is the
power of all signals of satellite j divided by the power of its line of sight. For the replica's own satellite, p_j
contains only the unaligned signals. The signals are sampled at f_s. In two correlators δ apart, the noise of the
unaligned signals has the covariance u A(δ) in each dimension. The covariance of the receiver's own noise is the
correlation of the two replicas.

    A(δ) = 1/f_s Σ_m [R_B(m/f_s) + R_C(m/f_s)] R(m/f_s − δ)

R_B and R_C are the autocorrelations of the two components, and R is the autocorrelation of BOC(1,1). In continuous time
A(0) is 0.59 µs, so seven other satellites with a C/N0 of 45 dBHz raise the noise by 13 %. At a sampling rate of 6.2 MHz
A(0) is 18 % larger, because sampling folds BOC(6,1) into the band.

**The satellite's own E1-B** is aligned with the replica. In each code period of N = 4092 chips E1-B gives the output of
E1-C times X/N, times the symbol ±1. X = Σ b_k c_k is the correlation at delay zero of the chips b_k of E1-B with the
chips c_k of E1-C. Symbols are random. So over the integration time T, E1-B acts as noise with the shape and the phase
of the signals. The variance of this noise is X²/(N T R_c) times the power of the signals, where R_c is the chip rate.

**Power** means the power within the bandwidth W around the carrier. Two signals with the delay difference τ have the
common power P(τ), summed over both components and divided by the power of one component:

    P(τ) = W/f_s Σ_m [R_B(m/f_s − τ) + R_C(m/f_s − τ)] sinc(W m/f_s)

A satellite thus adds the power P(0) c η/W, relative to the noise within W. η is computed as in `e1_taps`, with the
overlap P(τ)/P(0). η contains the reflections if the scenario lets reflections disturb E1.

The model leaves out the filter of the front end. On filtered samples (`front_end.bandwidth_hz`) the correlation peaks
are rounder than in the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Complex128, Float

from vestige.receiver.correlators.e1_taps import (
    INTEGRATION_S,
    POWER_BANDWIDTH_HZ,
    TAP_CHIPS,
    apart_chips,
    arriving,
    power_with_beat,
    rise_over_nominal_db,
)
from vestige.receiver.draws import DRAW_BLOCK, drawn_rows
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.truth import TruthBlock
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C
from vestige.signals.pulse import BOC11, autocorrelation
from vestige.streams import stream

# the overlap of filtered signals that are more than 4 chips apart, at most 4 %, is neglected
_GRID_CHIPS = np.linspace(-4.0, 4.0, 801)


def sky_power(truth: TruthBlock, *, with_rays: bool, sample_rate_hz: float) -> Float[np.ndarray, " n"]:
    """Return η, the power of all signals of a satellite divided by the power of its line of sight, within W."""
    table = _overlaps(sample_rate_hz)
    return power_with_beat(
        truth, lambda chips: np.interp(chips, _GRID_CHIPS, table, left=0.0, right=0.0), with_rays=with_rays
    )


def sky_power_rise_db(
    truth: Sequence[TruthBlock],
    cn0_dbhz: Float[np.ndarray, "n m"],
    relative_power: Float[np.ndarray, "n m"],
    *,
    sample_rate_hz: float,
) -> Float[np.ndarray, " n"]:
    """Return the rise of the E1 power over the power without attack, in dB.

    Parameters
    ----------
    truth
        Truth of each satellite.
    cn0_dbhz
        C/N0 of one component of each line of sight without interference; NaN if the satellite is out of view.
    relative_power
        Result of `sky_power` for each satellite.
    """
    passed = passed_components(np.zeros(1), bandwidth_hz=POWER_BANDWIDTH_HZ, sample_rate_hz=sample_rate_hz)
    passed_dbhz = cn0_dbhz + 10 * np.log10(passed)
    return rise_over_nominal_db(truth[0].e1_attack, passed_dbhz, relative_power, POWER_BANDWIDTH_HZ)


def strangers_hz(
    truth: Sequence[TruthBlock],
    cn0_dbhz: Float[np.ndarray, "n m"],
    multipath_m: Float[np.ndarray, "n m"],
    relative_power: Float[np.ndarray, "n m"],
    *,
    with_rays: bool,
) -> Float[np.ndarray, "n m"]:
    """Return u, the summed C/N0 in Hz of one component of all signals that are not aligned with a satellite's replica.

    Parameters
    ----------
    truth, multipath_m
        Parameters of `e1_taps`, given for each satellite.
    cn0_dbhz, relative_power
        Parameters of `sky_power_rise_db`.
    """
    strength_hz = np.nan_to_num(10 ** (cn0_dbhz / 10))
    of_all_hz = strength_hz * relative_power
    far = np.empty(cn0_dbhz.shape)
    for column, own in enumerate(truth):
        arrived = arriving(own, multipath_m[:, column], with_rays=with_rays)
        far[:, column] = np.sum(np.abs(arrived.amplitude) ** 2 * (np.abs(apart_chips(arrived)) >= 1), axis=1)
    return of_all_hz.sum(axis=1, keepdims=True) - of_all_hz + strength_hz * far


def code_noise(
    signals: Complex128[np.ndarray, "n n_taps"],
    of_strangers_hz: Float[np.ndarray, " n"],
    *,
    sample_rate_hz: float,
    seed: int,
    svid: int,
    first: int,
) -> Complex128[np.ndarray, "n n_taps"]:
    """Return the noise of all other codes in the correlators of one satellite.

    Parameters
    ----------
    signals
        Correlators ξ of E1-C without noise (see `e1_taps`).
    of_strangers_hz
        Result of `strangers_hz` for the satellite.
    """
    factor = np.linalg.cholesky(strangers_covariance_s(sample_rate_hz))

    def draw(block: int) -> Complex128[np.ndarray, "n n_taps_and_1"]:
        real, imaginary = stream(seed, "E1 codes", block, svid).standard_normal((2, DRAW_BLOCK, len(TAP_CHIPS) + 1))
        # Blocks are multiplied whole, because the last bits of a matrix product depend on the number of rows.
        strangers = (real[:, :-1] + 1j * imaginary[:, :-1]) @ factor.T
        return np.concatenate([strangers, real[:, -1:] + 0j], axis=1)

    drawn = drawn_rows(first, of_strangers_hz.size, draw)
    of_own = signals * drawn[:, -1:].real * (_aligned(svid) / np.sqrt(INTEGRATION_S * E1C.chip_rate_hz))
    return of_own + np.sqrt(of_strangers_hz)[:, None] * drawn[:, :-1]


@lru_cache(maxsize=64)
def _aligned(svid: int) -> float:
    """Return X/√N, the correlation of a satellite's E1-B and E1-C codes at delay zero."""
    own, pilot = (primary_code(one, svid).astype(np.float64) for one in (E1B, E1C))
    return float(own @ pilot) / np.sqrt(E1C.code_length)


@lru_cache(maxsize=4)
def strangers_covariance_s(sample_rate_hz: float) -> Float[np.ndarray, "n_taps n_taps"]:
    """Return A in s, the covariance that unaligned signals cause in the correlators if u is 1 Hz.

    Examples
    --------
    >>> strangers_covariance_s(12.5e6)[0, 0].round(9).item()
    6.09e-07
    """
    reach = int(2 * sample_rate_hz / E1C.chip_rate_hz)
    chips = np.arange(-reach, reach + 1) * (E1C.chip_rate_hz / sample_rate_hz)
    received = sum(autocorrelation(one.pulse, chips) for one in (E1B, E1C))
    lags = np.subtract.outer(TAP_CHIPS, TAP_CHIPS)
    behind = autocorrelation(BOC11, np.subtract.outer(lags.ravel(), chips).ravel()).reshape(-1, chips.size)
    return (behind @ received / sample_rate_hz).reshape(lags.shape)


def folding_rate_hz(front_end: FrontEnd) -> float:
    """Return f_s, the sampling rate that folds the spectrum; with a filter, the rate at the filter's input."""
    return front_end.sample_rate_hz if front_end.bandwidth_hz is None else front_end.input_rate_hz


def passed_components(
    delay_chips: Float[np.ndarray, " n"], *, bandwidth_hz: float, sample_rate_hz: float
) -> Float[np.ndarray, " n"]:
    """Return P, the common power of two signals within a bandwidth, divided by the power of one component.

    Parameters
    ----------
    delay_chips
        τ, delay difference of the two signals in chips.
    bandwidth_hz
        W, two-sided bandwidth in Hz.
    sample_rate_hz
        f_s, sampling rate in Hz.

    Examples
    --------
    >>> import numpy as np
    >>> passed_components(np.zeros(1), bandwidth_hz=2e6, sample_rate_hz=1e9).round(3)[0].item()
    1.139
    """
    chips_a_sample = E1C.chip_rate_hz / sample_rate_hz
    reach = int((1 + np.max(np.abs(delay_chips))) / chips_a_sample) + 1
    samples = np.arange(-reach, reach + 1)
    apart = np.subtract.outer(delay_chips, samples * chips_a_sample)
    both = sum(autocorrelation(one.pulse, apart.ravel()) for one in (E1B, E1C))
    weight = np.sinc(bandwidth_hz / sample_rate_hz * samples) * (bandwidth_hz / sample_rate_hz)
    return np.reshape(both, apart.shape) @ weight


@lru_cache(maxsize=4)
def _overlaps(sample_rate_hz: float) -> Float[np.ndarray, " n"]:
    """Return P(τ)/P(0) for the delay differences τ of `_GRID_CHIPS`."""
    found = passed_components(_GRID_CHIPS, bandwidth_hz=POWER_BANDWIDTH_HZ, sample_rate_hz=sample_rate_hz)
    return found / found[_GRID_CHIPS.size // 2]
