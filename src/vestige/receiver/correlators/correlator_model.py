"""Draw banks of correlators from their distribution without samples, for the `correlators` fidelity.

For known chips, a correlator output is the sum of the paths' correlation functions and of Gaussian noise. The
covariance of the noise in two taps is proportional to the autocorrelation R of the replica. R_e is the correlation
function of an epoch's chips. N_c is the number of chips, T the integration time and d_k the offset of tap k. Path r has
the amplitude a_r, the delay τ_r after the hand-over's prediction and the residual Doppler f_r:

    c_k = Σ_r a_r e^{jπ f_r T} sinc(f_r T) R_e(τ_r − d_k) + (L z)_k,     z ~ CN(0, 1)
    L L^H = σ² [R(d_i − d_k)]_ik,   σ² = 1/(C/N0 · T)
    R_e(x) = (1 − f) A_d + f A_{d+1},   d = ⌊|x|⌋, f = |x| − d chips,   A_0 = 1,  A_d ~ N(0, 1/N_c), drawn per epoch

A_d for d ≥ 1 is the self-noise of a random code. Linear interpolation between whole chips is exact for rectangular
chips. The outputs are normalised so that, without front end, noise and residual Doppler, the line of sight alone gives
1 in a tap at its delay. The model is exact for continuous time without a front end. A correlation of samples at a rate
incommensurate with the chip rate has the same distribution, as the tests show. Behind a filter or a quantiser, R_n
replaces R, and R_e(x) = Σ_d A_|d| R_h(x − d). R_n and R_h are defined in `front_end_correlation`.

With several satellites, the other signals on air count as white noise (`other_signals`). Under attack, spoofing signals
are further paths. `disturbance` adds noise, jamming, and the self-noise of paths that are far from a tap or whose chips
do not match.

The noise floor is measured with N_c chips, so its relative standard deviation is 1/√N_c. The measured floor includes a
part of the signal's own power.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex128, Float

from vestige.receiver.correlators.disturbance import CHIPS_A_METRE, Disturbance, unrelated_correlation
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.front_end.front_end_correlation import noise_correlation, signal_correlation, spread
from vestige.signals.definitions import E6C
from vestige.signals.pulse import BPSK, autocorrelation

_SELF_NOISE_LAGS = 16  # largest distance of a path from a tap in chips at which R_e is drawn
# Number of steps for each chip in the table of R_h. Linear interpolation has an error of 3e-4 of the peak for a
# bandwidth of 20 MHz.
_STEPS_PER_CHIP = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Draws:
    """Random draws for a block of banks."""

    correlation: Float[np.ndarray, "n_epochs n_lags"]  # R_e with its self-noise
    noise: Complex128[np.ndarray, "n_epochs n_taps"]  # noise in the taps for σ = 1
    floor: Float[np.ndarray, " n_epochs"]  # measured noise floor divided by its mean


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelatorModel:
    """Model that draws banks of correlators."""

    offsets_m: tuple[float, ...]  # offsets of the taps from the hand-over's prediction in m
    n_chips: int  # number of chips of a RECS
    # front end of the samples; None is equivalent to a front end without filter and quantiser
    front_end: FrontEnd | None = None

    @property
    def integration_s(self) -> float:
        """Coherent integration time in s."""
        return self.n_chips / E6C.chip_rate_hz

    @property
    def _shaping(self) -> FrontEnd | None:
        """The front end if it changes the samples, else None."""
        return None if self.front_end is None or self.front_end.transparent else self.front_end

    def noise_factor(self) -> Float[np.ndarray, "n_taps n_taps"]:
        """Return L, a matrix root of the covariance of the noise in the taps, for σ = 1.

        The function raises `ValueError` if two taps coincide.
        """
        chips = np.asarray(self.offsets_m) * CHIPS_A_METRE
        lags = np.subtract.outer(chips, chips)
        if np.min(np.abs(lags[~np.eye(chips.size, dtype=bool)]), initial=1.0) < 1e-6:
            raise ValueError("two correlators have the same offset")
        if self._shaping is None:
            return np.linalg.cholesky(autocorrelation(BPSK, lags.ravel()).reshape(lags.shape))
        covariance = noise_correlation(self._shaping, lags.ravel()).reshape(lags.shape)
        power, vectors = np.linalg.eigh(covariance)  # behind a narrow filter, the covariance is nearly singular
        return vectors * np.sqrt(np.maximum(power, 0.0))

    def draws(self, rng: np.random.Generator, n_epochs: int) -> Draws:
        """Return the random draws of `n_epochs` banks. A `Disturbance` contains its own random draws."""
        shape = (n_epochs, len(self.offsets_m))
        self_noise = rng.standard_normal((n_epochs, _SELF_NOISE_LAGS + 2)) / np.sqrt(self.n_chips)
        self_noise[:, 0] = 1.0
        z = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * np.sqrt(0.5)
        floor = 1.0 + rng.standard_normal(n_epochs) / np.sqrt(self.n_chips)
        if self._shaping is not None:
            self_noise = self_noise @ spread(self._shaping, _SELF_NOISE_LAGS + 2, _STEPS_PER_CHIP)
        return Draws(correlation=self_noise, noise=z @ self.noise_factor().T, floor=floor)

    def banks(
        self,
        draws: Draws,
        *,
        cn0_dbhz: float,
        delay_m: Float[np.ndarray, "n_epochs n_rays"],
        amplitude: Complex128[np.ndarray, "n_epochs n_rays"],
        doppler_hz: Float[np.ndarray, "n_epochs n_rays"],
        disturbance: Disturbance | None = None,
        other_signals: Float[np.ndarray, " n_epochs"] | None = None,
    ) -> tuple[Complex128[np.ndarray, "n_epochs n_taps"], Float[np.ndarray, " n_epochs"]]:
        """Return taps and measured noise power of a block of epochs.

        `cn0_dbhz` is the C/N0 of the line of sight on E6-C. A C/N0 of −∞ means noise of variance 1 without a signal.
        The first path is the line of sight. Delays and Dopplers of paths are counted from the hand-over's prediction.
        Amplitudes are relative to the line of sight. `other_signals` is the power density over N0 of all other signals
        on air (module `other_signals`).
        """
        absent = np.isneginf(cn0_dbhz)
        variance = 1.0 if absent else 1.0 / (10 ** (cn0_dbhz / 10) * self.integration_s)
        amplitude = np.zeros_like(amplitude) if absent else amplitude
        density = 1.0 if disturbance is None else 1.0 + disturbance.white[:, None]
        if other_signals is not None:
            density = density + other_signals[:, None]
        taps = draws.noise * np.sqrt(variance * density)
        turns = doppler_hz * self.integration_s
        strength = amplitude * np.exp(1j * np.pi * turns) * np.sinc(turns)
        steps = 1 if self._shaping is None else _STEPS_PER_CHIP
        rows = np.arange(delay_m.shape[0])[:, None]
        for ray in range(delay_m.shape[1]):
            chips = (delay_m[:, ray, None] - np.asarray(self.offsets_m)) * CHIPS_A_METRE
            distance = np.abs(chips) * steps
            lag = np.minimum(distance.astype(np.int64), _SELF_NOISE_LAGS * steps)
            part = np.minimum(distance - lag, 1.0)
            correlation = (1 - part) * draws.correlation[rows, lag] + part * draws.correlation[rows, lag + 1]
            if disturbance is not None:
                far = disturbance.forged_chips[ray] | np.any(np.abs(chips) > _SELF_NOISE_LAGS, axis=1, keepdims=True)
                stranger = unrelated_correlation(disturbance.unrelated[:, ray], chips) / np.sqrt(self.n_chips)
                correlation = np.where(far, stranger, correlation)
            taps += strength[:, ray, None] * correlation
        peak, noise = self._levels()
        between = delay_m * CHIPS_A_METRE % 1.0  # each chip of the signal overlaps two chips of the replica
        own_share = np.sum(np.abs(amplitude) ** 2 * ((1 - between) ** 2 + between**2), axis=1) / self.n_chips
        noise_power = variance * noise * draws.floor + peak**2 * own_share
        if other_signals is not None:
            noise_power = noise_power + variance * noise * other_signals * draws.floor
        if disturbance is None:
            return taps, noise_power
        rise = noise * disturbance.white + disturbance.rise
        return taps + disturbance.waveforms * np.sqrt(variance), noise_power + variance * rise * draws.floor

    def _levels(self) -> tuple[float, float]:
        """Return the peaks R_h(0) and R_n(0) of the correlation functions of the signal and of the noise."""
        if self._shaping is None:
            return 1.0, 1.0
        at = np.zeros(1)
        return float(signal_correlation(self._shaping, at)[0]), float(noise_correlation(self._shaping, at)[0])
