"""Estimate C/N0 from prompt correlators with estimators that receivers use, and name the weakness of each estimator.

Theory of operation
-------------------
Prompts P_k = I_k + jQ_k of coherent time T are a phasor of power S plus noise of power N (both dimensions together).
C/N0 is S/(N T). Each row of the input is a block of prompts. Within a row the phasor keeps its phase, and also its sign
if data bits are removed.

| estimator | from | weakness |
|---|---|---|
| narrow to wide power ratio | power of a sum of M prompts over their power [VAN-DIERENDONCK96] | needs M equal signs |
| second and fourth moment | mean power and mean squared power of P [PINI08] | large spread below 30 dBHz |
| signal to noise variance | magnitude of I [PINI08] | too high where S < N |
| Beaulieu | differences of the magnitude of I [PINI08] | too high where S < 3 N |
| real signal, complex noise | power of Q, which is noise alone [PINI08] | needs phase lock |

The narrow-to-wide ratio is the best choice over all C/N0. The bias of this estimator is at most 0.2 dB from 25 to 45
dBHz. At 25 dBHz the estimators with a smaller spread have a bias of about 1 dB or more (docs/checks/cn0.md). An
estimate is NaN if noise makes the formula undefined.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Complex, Float

NWPR_PROMPTS = 20  # default number M of prompts in a group [VAN-DIERENDONCK96]


def narrow_to_wide_dbhz(
    prompts: Complex[np.ndarray, "n k"], integration_s: float, *, together: int = NWPR_PROMPTS
) -> Float[np.ndarray, " n"]:
    """Return C/N0 = (μ − 1)/(M − μ)/T of each row in dBHz, where μ is the mean of |Σ_M P|² / Σ_M |P|².

    M is `together`, the number of consecutive prompts that are summed coherently. Prompts at the end of a row that do
    not fill a group of M prompts are not used.

    The function raises `ValueError` if a row has fewer than M prompts.
    """
    n, k = prompts.shape
    if k < together:
        raise ValueError(f"the narrow-to-wide ratio needs {together} prompts, found {k}")
    groups = prompts[:, : k - k % together].reshape(n, -1, together)
    wide = np.sum(_power(groups), axis=2)
    ratio = np.mean(_power(np.sum(groups, axis=2)) / np.where(wide > 0, wide, np.nan), axis=1)
    return _dbhz(ratio - 1, together - ratio, integration_s)


def moments_dbhz(prompts: Complex[np.ndarray, "n k"], integration_s: float) -> Float[np.ndarray, " n"]:
    """Return C/N0 of each row from S = √(2 M₂² − M₄) and N = M₂ − S, where M₂ and M₄ are the means of |P|² and |P|⁴."""
    power = _power(prompts)
    second, fourth = np.mean(power, axis=1), np.mean(power**2, axis=1)
    inner = 2 * second**2 - fourth
    signal = np.sqrt(np.where(inner > 0, inner, np.nan))
    return _dbhz(signal, second - signal, integration_s)


def signal_to_noise_variance_dbhz(prompts: Complex[np.ndarray, "n k"], integration_s: float) -> Float[np.ndarray, " n"]:
    """Return C/N0 of each row from S = (mean |I|)² and N = mean |P|² − S."""
    signal = np.mean(np.abs(prompts.real), axis=1) ** 2
    return _dbhz(signal, np.mean(_power(prompts), axis=1) - signal, integration_s)


def beaulieu_dbhz(prompts: Complex[np.ndarray, "n k"], integration_s: float) -> Float[np.ndarray, " n"]:
    """Return C/N0 of each row from S/N = 1/mean[(|I_k| − |I_{k−1}|)² / ½(I_k² + I_{k−1}²)]."""
    size = np.abs(prompts.real)
    mean_power = (size[:, 1:] ** 2 + size[:, :-1] ** 2) / 2
    noise = np.mean((size[:, 1:] - size[:, :-1]) ** 2 / np.where(mean_power > 0, mean_power, np.nan), axis=1)
    return _dbhz(np.ones_like(noise), noise, integration_s)


def real_signal_complex_noise_dbhz(
    prompts: Complex[np.ndarray, "n k"], integration_s: float
) -> Float[np.ndarray, " n"]:
    """Return C/N0 of each row from N = 2 mean Q² and S = mean |P|² − N."""
    noise = 2 * np.mean(prompts.imag**2, axis=1)
    return _dbhz(np.mean(_power(prompts), axis=1) - noise, noise, integration_s)


Cn0Estimator = Callable[[Complex[np.ndarray, "n k"], float], Float[np.ndarray, " n"]]

CN0_ESTIMATORS: Mapping[str, Cn0Estimator] = {
    "narrow-to-wide": narrow_to_wide_dbhz,
    "moments": moments_dbhz,
    "signal-to-noise-variance": signal_to_noise_variance_dbhz,
    "beaulieu": beaulieu_dbhz,
    "real-signal-complex-noise": real_signal_complex_noise_dbhz,
}


def _power(values: Complex[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    return values.real**2 + values.imag**2


def _dbhz(
    signal: Float[np.ndarray, " n"], noise: Float[np.ndarray, " n"], integration_s: float
) -> Float[np.ndarray, " n"]:
    """Return 10 log₁₀(S/(N T)), NaN unless S and N are positive."""
    defined = (signal > 0) & (noise > 0)
    ratio = np.where(defined, signal, 1.0) / np.where(defined, noise, 1.0)
    return np.where(defined, 10 * np.log10(ratio / integration_s), np.nan)
