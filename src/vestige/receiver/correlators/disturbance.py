"""Draw the disturbance of correlator banks by an attack: noise, jamming, and chips that do not match the replica.

Theory of operation
-------------------
**Chips that do not match.** Chips do not match if an attacker made up the chips, or if the signal is more than 16 chips
away from one of the taps. The correlator at the distance x from a signal whose chips do not match gives

    R_u(x) = (1 − f) B_d + f B_{d+1}       d = ⌊x⌋, f = x − d chips       B_d ~ N(0, 1/N_c), independent

R_u is the self-noise of a code without the peak. Each signal has independent values B_d.

**White noise** of density w N0, from a meaconer's repeater or a wideband jammer, scales the noise by √(1 + w).

**Jamming waveforms** in the taps are Gaussian, with the covariance from `vestige.spoofer.jammers`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.draws import DRAW_BLOCK, drawn_rows
from vestige.signals.definitions import E6C
from vestige.spoofer.spoofer import BandEffects
from vestige.streams import stream

CHIPS_A_METRE = E6C.chip_rate_hz / SPEED_OF_LIGHT_MPS


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """Disturbance of the E6 correlators in n epochs: white noise, jamming waveforms, and chips that do not match."""

    white: Float[np.ndarray, " n"]  # density of white noise divided by N0
    # jamming waveforms in the taps, in units of σ (see `correlator_model`)
    waveforms: Complex128[np.ndarray, "n n_taps"]
    rise: Float[np.ndarray, " n"]  # rise of the noise power by the jamming waveforms, in units of σ²
    unrelated: Float[np.ndarray, "n n_rays n_lags"]  # B of every path, scaled to variance 1
    forged_chips: Bool[np.ndarray, " n_rays"]  # whether the chips of a path never match the replica


def drawn_disturbance(
    effects: BandEffects,
    offsets_m: Float[np.ndarray, " n_taps"],
    forged_chips: Bool[np.ndarray, " n_rays"],
    *,
    seed: int,
    first: int,
    labels: tuple[int, ...] = (),
) -> Disturbance:
    """Draw the disturbance that the effects of an attack cause in the epochs from `first` on.

    The disturbance of an epoch does not depend on how the caller divides the epochs among calls. Each block of
    `DRAW_BLOCK` epochs has its own stream of draws. `labels` are further parts of the stream's name, such as an SVID.
    """
    n, chips = effects.white.size, offsets_m * CHIPS_A_METRE
    n_lags = int(np.ceil(np.ptp(chips))) + 2
    shape = (DRAW_BLOCK, forged_chips.size, n_lags)
    unrelated = drawn_rows(
        first, n, lambda block: stream(seed, "unrelated chips", block, *labels).standard_normal(shape)
    )
    waveforms, rise = np.zeros((n, chips.size), np.complex128), np.zeros(n)
    lags = np.subtract.outer(chips, chips)
    for number, one in enumerate(effects.jammers):
        covariance = one.waveform.covariance(E6C, lags.ravel(), one.noise_bandwidth_hz).reshape(lags.shape)
        power, vectors = np.linalg.eigh(covariance)
        factor = vectors * np.sqrt(np.maximum(power, 0.0))
        coloured = drawn_rows(first, n, partial(_coloured, seed, number, labels, factor))
        waveforms += coloured * np.sqrt(one.j_over_n)[:, None]
        rise += one.j_over_n * covariance[0, 0].real
    return Disturbance(
        white=effects.white, waveforms=waveforms, rise=rise, unrelated=unrelated, forged_chips=forged_chips
    )


def unrelated_correlation(
    noise: Float[np.ndarray, "n n_lags"], distance_chips: Float[np.ndarray, "n n_taps"]
) -> Float[np.ndarray, "n n_taps"]:
    """Return R_u √N_c at each tap. The index of B is counted from the tap with the smallest distance."""
    lag = np.floor(distance_chips).astype(np.int64)
    part = distance_chips - lag
    lag -= lag.min(axis=1, keepdims=True)
    rows = np.arange(lag.shape[0])[:, None]
    return (1 - part) * noise[rows, lag] + part * noise[rows, lag + 1]


def _coloured(
    seed: int, number: int, labels: tuple[int, ...], factor: Complex128[np.ndarray, "n_taps n_taps"], block: int
) -> Complex128[np.ndarray, "n n_taps"]:
    rng, shape = stream(seed, "jamming", number, block, *labels), (DRAW_BLOCK, len(factor))
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * np.sqrt(0.5) @ factor.T
