"""The `correlators` fidelity: banks of correlators drawn from their exact distribution, without samples.

Given the chips, a correlator output is a sum of the rays' correlation functions and of Gaussian noise whose
covariance over the taps is that of the replicas. With N_c chips, T the integration time, d_k the tap's offset, and
ray r of amplitude a_r, delay τ_r after the hand-over's prediction and residual Doppler f_r:

    c_k = Σ_r a_r e^{jπ f_r T} sinc(f_r T) R_e(τ_r − d_k) + (L z)_k,     z ~ CN(0, 1)
    L L^H = σ² [R(d_i − d_k)]_ik,   σ² = 1/(C/N0 · T)
    R_e(x) = (1 − f) A_d + f A_{d+1},   d = ⌊|x|⌋, f = |x| − d chips,   A_0 = 1,  A_d ~ N(0, 1/N_c), drawn an epoch

A_d is the self-noise of a random code: linear interpolation between whole chips is exact for rectangular chips. The
outputs are normalised so that the line of sight alone, on a tap, gives 1. It is the limit of continuous time without a
front-end filter: a sampled correlation at an incommensurate rate has the same distribution, and the tests hold that.

The measured noise floor comes from N_c chips, so it scatters by 1/√N_c, and it holds the signal's own share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex128, Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signals.definitions import E6C
from vestige.signals.pulse import BPSK, autocorrelation

_SELF_NOISE_LAGS = 16  # chips: rays may be as far as this from a tap


@dataclass(frozen=True, slots=True, kw_only=True)
class Draws:
    """What is random in a block of banks: self-noise of the code, noise of σ = 1 in the taps, scatter of the floor."""

    self_noise: Float[np.ndarray, "n_epochs n_lags"]
    noise: Complex128[np.ndarray, "n_epochs n_taps"]
    floor: Float[np.ndarray, " n_epochs"]

    def part(self, first: int, last: int) -> Draws:
        """Return the draws of some of the epochs."""
        return Draws(self_noise=self.self_noise[first:last], noise=self.noise[first:last], floor=self.floor[first:last])


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelatorModel:
    """Draws banks of correlators.

    Attributes
    ----------
    offsets_m
        Offsets of the taps in m.
    n_chips
        Chips of a RECS.
    """

    offsets_m: tuple[float, ...]
    n_chips: int

    @property
    def integration_s(self) -> float:
        """Coherent integration time in s."""
        return self.n_chips / E6C.chip_rate_hz

    def noise_factor(self) -> Float[np.ndarray, "n_taps n_taps"]:
        """Return L for σ = 1.

        Raises
        ------
        ValueError
            If two taps coincide.
        """
        chips = np.asarray(self.offsets_m) / SPEED_OF_LIGHT_MPS * E6C.chip_rate_hz
        lags = np.subtract.outer(chips, chips)
        if np.min(np.abs(lags[~np.eye(chips.size, dtype=bool)]), initial=1.0) < 1e-6:
            raise ValueError("two correlators have the same offset")
        return np.linalg.cholesky(autocorrelation(BPSK, lags.ravel()).reshape(lags.shape))

    def draws(self, rng: np.random.Generator, n_epochs: int) -> Draws:
        """Return everything random of `n_epochs` banks."""
        shape = (n_epochs, len(self.offsets_m))
        self_noise = rng.standard_normal((n_epochs, _SELF_NOISE_LAGS + 2)) / np.sqrt(self.n_chips)
        self_noise[:, 0] = 1.0
        z = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * np.sqrt(0.5)
        floor = 1.0 + rng.standard_normal(n_epochs) / np.sqrt(self.n_chips)
        return Draws(self_noise=self_noise, noise=z @ self.noise_factor().T, floor=floor)

    def banks(
        self,
        draws: Draws,
        *,
        cn0_dbhz: float,
        delay_m: Float[np.ndarray, "n_epochs n_rays"],
        amplitude: Complex128[np.ndarray, "n_epochs n_rays"],
        doppler_hz: Float[np.ndarray, "n_epochs n_rays"],
    ) -> tuple[Complex128[np.ndarray, "n_epochs n_taps"], Float[np.ndarray, " n_epochs"]]:
        """Return taps and measured noise power of a block of epochs.

        Parameters
        ----------
        draws
            The randomness of these epochs.
        cn0_dbhz
            C/N0 of E6-C's line of sight.
        delay_m
            Delay of every ray after the hand-over's prediction in m; the line of sight is the first ray.
        amplitude
            Complex amplitude of every ray; 1 is the line of sight's magnitude.
        doppler_hz
            Residual Doppler of every ray in Hz.
        """
        variance = 1.0 / (10 ** (cn0_dbhz / 10) * self.integration_s)
        taps = draws.noise * np.sqrt(variance)
        turns = doppler_hz * self.integration_s
        strength = amplitude * np.exp(1j * np.pi * turns) * np.sinc(turns)
        scale = E6C.chip_rate_hz / SPEED_OF_LIGHT_MPS
        rows = np.arange(delay_m.shape[0])[:, None]
        for ray in range(delay_m.shape[1]):
            distance = np.abs(delay_m[:, ray, None] - np.asarray(self.offsets_m)) * scale
            lag = np.minimum(distance.astype(np.int64), _SELF_NOISE_LAGS)
            part = np.minimum(distance - lag, 1.0)
            correlation = (1 - part) * draws.self_noise[rows, lag] + part * draws.self_noise[rows, lag + 1]
            taps += strength[:, ray, None] * correlation
        noise_power = variance * draws.floor + np.sum(np.abs(amplitude) ** 2, axis=1) / self.n_chips
        return taps, noise_power
