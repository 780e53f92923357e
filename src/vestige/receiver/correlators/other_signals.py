"""Compute the noise that all other signals of a sky cause in an E6-C correlator, for simulated correlators.

Satellite j sends E6-B and E6-C as BPSK(5), each with the C/N0 c_j. A replica matches only the E6-C of its own
satellite. Any other code acts as noise behind the correlator. A code with the C/N0 c adds noise whose density, divided
by N0, is κ c. κ is `code_noise_density_s`, 0.13 µs in continuous time. The chips of a satellite's E6-B are aligned with
the chips of its E6-C, so E6-B of the same satellite adds c/R_c, where R_c is the chip rate. In continuous time c/R_c is
3/2 times κ c. The correlator of satellite i receives noise whose density, divided by N0, is

    w_i = 2 κ Σ_{j≠i} c_j p_j + c_i p_i / R_c,    p = 1 + power of multipath and spoofing signals over the line of sight

At a sampling rate of 12.5 MHz, eight satellites with a C/N0 of 45 dBHz raise the noise of a correlator by 7 %. The
model adds white noise of the density w_i to the taps. The model neglects that code noise is more correlated than white
noise between taps that are less than a chip apart.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.front_end.front_end_correlation import code_noise_density_s
from vestige.signals.definitions import E6C

_COMPONENTS = 2  # E6-B and E6-C, of equal power


def other_signals_density(
    cn0_dbhz: Float[np.ndarray, "n m"], relative_power: Float[np.ndarray, "n m"], front_end: FrontEnd
) -> Float[np.ndarray, "n m"]:
    """Return the density, divided by N0, of the noise that all other signals cause in each satellite's correlator.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of one component of the line of sight; −∞ if there is no signal.
    relative_power
        Power of line of sight, multipath and spoofing signals together, divided by the power of the line of sight.
    front_end
        Filter, gain control and quantiser of the samples.

    Examples
    --------
    >>> import numpy as np
    >>> from vestige.receiver.front_end.front_end import FrontEnd
    >>> front_end = FrontEnd(sample_rate_hz=12.5e6)
    >>> other_signals_density(np.full((1, 8), 45.0), np.ones((1, 8)), front_end).round(3)[0, 0].item()
    0.069
    """
    strength = 10 ** (cn0_dbhz / 10) * relative_power
    others = strength.sum(axis=1, keepdims=True) - strength
    return code_noise_density_s(front_end) * _COMPONENTS * others + strength / E6C.chip_rate_hz
