"""Noise of all other signals of a sky behind an E6-C correlator, for banks that are drawn.

Satellite j sends E6-B and E6-C as BPSK(5), each with the C/N0 c_j. A replica matches only the E6-C of its own
satellite. Any other code of power C is noise behind the correlator, of the density κ C over N0 (`code_noise_density_s`:
0.13 µs in continuous time). A satellite's own E6-B is aligned with its E6-C chip by chip, so its noise density is
1/R_c, 3/2 times as much. For satellite i

    w_i = 2 κ Σ_{j≠i} c_j p_j + c_i p_i / R_c,    p = 1 + power of multipath and spoofing signals over the line of sight

Eight satellites of 45 dBHz raise the noise by 7 %. The taps get white noise of this density. The model neglects that
code noise is more correlated between taps less than a chip apart.
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
    """Return the density over N0 of all signals on E6 other than the E6-C of each satellite.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of one component of the line of sight; −∞ if there is no signal.
    relative_power
        Power of line of sight, multipath and spoofing signals together, over that of the line of sight.
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
