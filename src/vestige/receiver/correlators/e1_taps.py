"""Draw the E1 correlators of each satellite, and the power of E1, at every epoch with or without RECS.

Theory of operation
-------------------
The correlators have offsets d from the position x₀ where noise, reflections and spoofing signals let the loop settle. R
is the autocorrelation of BOC(1,1), T the integration time and s = √(2 C/N0 T). Signal i has the complex amplitude a_i
relative to the true signal, the delay τ_i, and the Doppler f_i relative to the Doppler that the carrier loop follows.
The correlators are

    ξ(d) = g [ s Σ_i a_i e^{jπ f_i T} sinc(f_i T) R(x₀ + d − τ_i) + √(1 + ρ) (L z)_d ]
    z ~ CN(0, 2),   L Lᵀ = [R(dᵢ − dₖ)]ᵢₖ

Without interference the noise has σ = 1 per dimension. ρ is the noise power that an attack adds behind the correlator,
relative to the receiver's noise. g is the factor of the gain control, which keeps the power within the bandwidth W
constant. C/N0_i is the C/N0 of satellite i, and Δf is the Doppler difference of signals j and k of a satellite. w is
the density of added white noise over N0, and J/N is the power of the jammers over the noise in W:

    g^{−2} = (1 + Σ r_i η_i + w + J/N) / (1 + Σ r_i),    r_i = C/N0_i / W
    η_i = Σ_jk a_j a_k* e^{jπ Δf T_P} sinc(Δf T_P) R(τ_j − τ_k)

A spoofing signal and the true signal beat with each other while both overlap. The power is averaged over T_P. The noise
of the averaged power has the standard deviation 4.343 dB/√(W T_P). The model has no drift of the front end.

The model of ξ assumes continuous time, and leaves out the filter and the quantiser of the front end. In a scenario of a
single line of sight the signal is BOC(1,1), as in `e1_samples`. In a scenario with a sky the signal is CBOC(6,1,1/11),
as on air. In the sum over the signals i, the correlation of CBOC with BOC(1,1) then replaces R. The peak of the
correlation of CBOC with BOC(1,1) is 0.4 dB lower than the peak of R. All other signals add noise and power
(`sky_e1_model`), as in `snapshots.sky_e1`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex128, Float

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.draws import DRAW_BLOCK, drawn_rows
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.signals.definitions import E1C
from vestige.signals.pulse import BOC11, Pulse, autocorrelation, cross_correlation
from vestige.spoofer.spoofer import BandEffects
from vestige.streams import stream

# offsets of the correlators: outer pair for power–distortion, inner pair for the loop, 0 for the prompt correlator
TAP_CHIPS = (-0.15, -0.05, 0.0, 0.05, 0.15)
INTEGRATION_S = 0.1
POWER_BANDWIDTH_HZ = 2e6  # W, two-sided
POWER_AVERAGING_S = 0.01
_DB_PER_NEPER = 10 / np.log(10)
_CHIPS_A_METRE = E1C.chip_rate_hz / SPEED_OF_LIGHT_MPS
_RAY_DOPPLER = E1_CARRIER_HZ / E6_CARRIER_HZ  # Doppler of a reflection on E1 divided by its Doppler on E6


class Arriving(NamedTuple):
    """All signals of one satellite relative to the line of sight, and the delay and Doppler that its loops follow."""

    amplitude: Complex128[np.ndarray, "n k"]
    delay_m: Float[np.ndarray, "n k"]
    doppler_hz: Float[np.ndarray, "n k"]
    settled_m: Float[np.ndarray, " n"]
    followed_hz: Float[np.ndarray, " n"]


def arriving(truth: TruthBlock, multipath_m: Float[np.ndarray, " n"], *, with_rays: bool) -> Arriving:
    """Return line of sight, reflections and spoofing signals of a satellite; for the parameters see `e1_taps`."""
    one, attack, rays = np.ones((truth.time_s.size, 1)), truth.e1_attack, truth.rays
    return Arriving(
        amplitude=np.concatenate([one + 0j, rays.amplitude_e1 * with_rays, attack.amplitude], axis=1),
        delay_m=np.concatenate([0 * one, rays.delay_m, attack.delay_m], axis=1),
        doppler_hz=np.concatenate([0 * one, rays.doppler_hz * _RAY_DOPPLER, attack.doppler_hz], axis=1),
        settled_m=truth.e1_noise_m + multipath_m + truth.e1.error_m,
        followed_hz=-truth.e1.rate_error_mps * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS,
    )


def apart_chips(arrived: Arriving) -> Float[np.ndarray, "n k"]:
    """Return the delay of the settled loop relative to each signal in chips, positive if the loop is later."""
    return (arrived.settled_m[:, None] - arrived.delay_m) * _CHIPS_A_METRE


def e1_signals(
    truth: TruthBlock,
    cn0_dbhz: Float[np.ndarray, " n"],
    multipath_m: Float[np.ndarray, " n"],
    *,
    with_rays: bool,
    pulse: Pulse,
) -> Complex128[np.ndarray, "n n_taps"]:
    """Return the correlators ξ without noise for signals of a given pulse; for the other parameters see `e1_taps`."""
    arrived = arriving(truth, multipath_m, with_rays=with_rays)
    turns = (arrived.doppler_hz - arrived.followed_hz[:, None]) * INTEGRATION_S
    strength = arrived.amplitude * np.exp(1j * np.pi * turns) * np.sinc(turns)
    apart_m = arrived.settled_m[:, None, None] - arrived.delay_m[..., None]
    chips = apart_m * _CHIPS_A_METRE + np.array(TAP_CHIPS)
    shape = cross_correlation(pulse, BOC11, chips.ravel()).reshape(chips.shape)
    signals = np.einsum("nr,nrt->nt", strength, shape)
    return np.sqrt(2 * 10 ** (cn0_dbhz / 10) * INTEGRATION_S)[:, None] * signals


def e1_taps(
    truth: TruthBlock,
    cn0_dbhz: Float[np.ndarray, " n"],
    multipath_m: Float[np.ndarray, " n"],
    *,
    with_rays: bool,
    seed: int,
    svid: int,
    first: int,
) -> Complex128[np.ndarray, "n n_taps"]:
    """Return the correlators ξ of a satellite that is alone on air with BOC(1,1), before the gain control.

    `cn0_dbhz` is the C/N0 of the true signal without interference. `multipath_m` is the pseudorange error that
    reflections cause. `with_rays` says whether the correlators receive the reflections.
    """
    signals = e1_signals(truth, cn0_dbhz, multipath_m, with_rays=with_rays, pulse=BOC11)
    return signals + receiver_noise(truth, seed=seed, svid=svid, first=first)


def receiver_noise(truth: TruthBlock, *, seed: int, svid: int, first: int) -> Complex128[np.ndarray, "n n_taps"]:
    """Return the noise of the correlators ξ, which comes from the receiver and from an attack."""
    noise = _noise(seed, svid, first, truth.time_s.size)
    return noise * np.sqrt(1 + truth.e1_attack.rise(Band.E1))[:, None]


def power_with_rays(
    truth: TruthBlock, multipath_m: Float[np.ndarray, " n"], *, averaging_s: float
) -> Float[np.ndarray, " n"]:
    """Return the mean C/N0 in the prompt correlator with reflections, over the C/N0 of the undisturbed true signal.

    The line of sight and its reflections beat with each other. Beats with a period much shorter than `averaging_s` are
    averaged out. Only the true signal has reflections. If a spoofing signal has pulled the loop more than a chip away
    from a reflection, this reflection has no effect.

    Parameters
    ----------
    truth
        Truth of the satellite's signals.
    multipath_m
        Pseudorange error in m that reflections cause.
    averaging_s
        Time in s over which the receiver averages the power.
    """
    one, rays = np.ones((truth.time_s.size, 1)), truth.rays
    delay_m = np.concatenate([0 * one, rays.delay_m], axis=1)
    doppler_hz = np.concatenate([0 * one, rays.doppler_hz * _RAY_DOPPLER], axis=1)
    chips = ((truth.e1.error_m + multipath_m)[:, None] - delay_m) * _CHIPS_A_METRE
    overlap = autocorrelation(BOC11, chips.ravel()).reshape(chips.shape)
    amplitude = np.concatenate([one + 0j, rays.amplitude_e1], axis=1) * overlap
    without_rays = autocorrelation(BOC11, truth.e1.error_m * _CHIPS_A_METRE) ** 2
    by_rays = _beating_power(amplitude, doppler_hz, averaging_s) - without_rays
    return truth.e1.gain + by_rays / (1 + truth.e1_attack.rise(Band.E1))


def _beating_power(
    amplitude: Complex128[np.ndarray, "n k"], doppler_hz: Float[np.ndarray, "n k"], averaging_s: float
) -> Float[np.ndarray, " n"]:
    """Return the mean of |Σ a e^{j2πft}|² over `averaging_s` seconds that begin at the epoch."""
    turns = (doppler_hz[:, :, None] - doppler_hz[:, None, :]) * averaging_s
    beat = np.exp(1j * np.pi * turns) * np.sinc(turns)
    return np.einsum("ni,nij,nj->n", amplitude, beat, amplitude.conj()).real


def band_power_rise_db(truth: Sequence[TruthBlock], cn0_dbhz: Float[np.ndarray, "n m"]) -> Float[np.ndarray, " n"]:
    """Return the rise of the E1 power in dB over the power without attack, −20 log₁₀ g, for signals of BOC(1,1).

    `cn0_dbhz` is the C/N0 of the true signals; NaN means out of view.
    """
    relative_power = np.stack(
        [power_with_beat(one, partial(autocorrelation, BOC11), with_rays=False) for one in truth], axis=1
    )
    return rise_over_nominal_db(truth[0].e1_attack, cn0_dbhz, relative_power, POWER_BANDWIDTH_HZ)


def e6_power_rise_db(
    truth: Sequence[TruthBlock], cn0_dbhz: Float[np.ndarray, "n m"], *, bandwidth_hz: float
) -> Float[np.ndarray, " n"]:
    """Return the rise of the E6 power in dB over the power without attack.

    Beats are left out, because E6 signals are far below the noise.
    """
    relative_power = np.stack([1 + np.sum(10 ** (one.e6.power_db / 10), axis=1) for one in truth], axis=1)
    return rise_over_nominal_db(truth[0].e6, cn0_dbhz, relative_power, bandwidth_hz)


def rise_over_nominal_db(
    effects: BandEffects,
    cn0_dbhz: Float[np.ndarray, "n m"],
    relative_power: Float[np.ndarray, "n m"],
    bandwidth_hz: float,
) -> Float[np.ndarray, " n"]:
    """Return the rise of a band's power over the power without attack, in dB.

    Parameters
    ----------
    effects
        Noise and jamming of an attack in the band.
    cn0_dbhz
        Power of each line of sight divided by N0, in dBHz; NaN if the satellite is out of view.
    relative_power
        Power of all signals of each satellite, divided by the power of the satellite's line of sight.
    bandwidth_hz
        Bandwidth in Hz in which the power is measured.
    """
    share = np.where(np.isfinite(cn0_dbhz), 10 ** (cn0_dbhz / 10), 0.0) / bandwidth_hz
    added = effects.white.copy()
    for jamming in effects.jammers:
        added += jamming.j_over_n * jamming.noise_bandwidth_hz / bandwidth_hz
    return 10 * np.log10((1 + np.sum(share * relative_power, axis=1) + added) / (1 + share.sum(axis=1)))


def power_with_beat(
    truth: TruthBlock, overlap: Callable[[Float[np.ndarray, " k"]], Float[np.ndarray, " k"]], *, with_rays: bool
) -> Float[np.ndarray, " n"]:
    """Return η, the power of a satellite's signals divided by the power of the line of sight.

    Signals that overlap beat with each other.

    Parameters
    ----------
    truth
        Truth of the satellite's signals.
    overlap
        Function that returns the correlation of two signals from their distance in chips.
    with_rays
        Whether reflections are included.
    """
    one, attack, rays = np.ones((truth.time_s.size, 1)), truth.e1_attack, truth.rays
    first = (one + 0j, 0 * one, 0 * one)
    spoofing_signals = (attack.amplitude, attack.delay_m, attack.doppler_hz)
    reflections = (rays.amplitude_e1, rays.delay_m, rays.doppler_hz * _RAY_DOPPLER)
    present = (first, reflections, spoofing_signals) if with_rays else (first, spoofing_signals)
    amplitude, delay_m, doppler_hz = (np.concatenate(parts, axis=1) for parts in zip(*present, strict=True))
    chips, turns = (
        (values[:, :, None] - values[:, None, :]) * unit
        for values, unit in ((delay_m, _CHIPS_A_METRE), (doppler_hz, POWER_AVERAGING_S))
    )
    beat = overlap(chips.ravel()).reshape(chips.shape) * np.exp(1j * np.pi * turns) * np.sinc(turns)
    return np.einsum("ni,nij,nj->n", amplitude, beat, amplitude.conj()).real


def power_noise_db(
    seed: int,
    first: int,
    n: int,
    *,
    band: Band = Band.E1,
    bandwidth_hz: float = POWER_BANDWIDTH_HZ,
    averaging_s: float = POWER_AVERAGING_S,
) -> Float[np.ndarray, " n"]:
    """Return the noise of the power measurements of n epochs, in dB."""
    sigma_db = _DB_PER_NEPER / np.sqrt(bandwidth_hz * averaging_s)
    return sigma_db * drawn_rows(
        first, n, lambda block: stream(seed, f"{band.value} power", block).standard_normal(DRAW_BLOCK)
    )


def _noise(seed: int, svid: int, first: int, n: int) -> Complex128[np.ndarray, "n n_taps"]:
    lags = np.subtract.outer(TAP_CHIPS, TAP_CHIPS)
    factor = np.linalg.cholesky(autocorrelation(BOC11, lags.ravel()).reshape(lags.shape))

    def draw(block: int) -> Complex128[np.ndarray, "n n_taps"]:
        real, imaginary = stream(seed, "E1 taps", block, svid).standard_normal((2, DRAW_BLOCK, len(TAP_CHIPS)))
        # Blocks are multiplied whole, because the last bits of a matrix product depend on the number of rows.
        return (real + 1j * imaginary) @ factor.T

    return drawn_rows(first, n, draw)
