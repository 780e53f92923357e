"""Draw the C/N0 that E1 tracking reports, an estimate from a second of prompt correlators.

The estimate uses the K = 50 prompt correlators ξ_k of a second, each over T = 20 ms. ξ_k is in standard deviations of
the noise per dimension. A correlator with a code that no satellite sends measures the noise density at the same time.
The error of this noise density is neglected. C is the true C/N0 in Hz, and the estimate Ĉ is

    Ĉ = (1/(2K) Σ_k |ξ_k|² − 1)/T,        Σ_k |ξ_k|² ~ non-central χ²(2K) with the non-centrality λ = 2 K C T

The estimate has no bias, and its relative variance is (2 C T + 1)/(K C² T²). The standard deviation is 0.11 dB at 35
dBHz and 0.7 dB at 20 dBHz. A non-central χ²(2K) is (z + √λ)² + χ²(2K − 1), where z is a standard normal variable. So
each estimate needs two draws.

The tracking receiver (`sample_processor.tracking`) estimates the noise from its own prompts, which contain other codes.
The other codes and the BOC(1,1) replica lower the estimate of the tracking receiver by 0.9 dB. The beat of two signals
also counts as noise in the tracking receiver. The model of this module neglects all three effects, so the model's
estimate is higher.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.receiver.draws import DRAW_BLOCK, drawn_rows
from vestige.streams import stream

PROMPTS = 50
CN0_INTEGRATION_S = 0.02
_LEAST_SNR = 1e-3  # lower limit of the estimated SNR, which noise can make negative


def estimated_cn0_dbhz(
    cn0_dbhz: Float[np.ndarray, " n"], *, seed: int, svid: int, first: int
) -> Float[np.ndarray, " n"]:
    """Return the estimated C/N0 of one satellite at each epoch, in dBHz.

    `cn0_dbhz` is the true C/N0 of the signal that the loop tracks, with the noise of attacks included.
    """
    normal, rest = drawn_rows(first, cn0_dbhz.size, lambda block: _draws(seed, block, svid)).T
    mean = 2 * PROMPTS * 10 ** (cn0_dbhz / 10) * CN0_INTEGRATION_S
    power = (normal + np.sqrt(mean)) ** 2 + rest
    return 10 * np.log10(np.maximum(power / (2 * PROMPTS) - 1, _LEAST_SNR) / CN0_INTEGRATION_S)


def _draws(seed: int, block: int, svid: int) -> Float[np.ndarray, "n 2"]:
    rng = stream(seed, "E1 C/N0", block, svid)
    return np.stack([rng.standard_normal(DRAW_BLOCK), 2 * rng.standard_gamma(PROMPTS - 0.5, DRAW_BLOCK)], axis=1)
