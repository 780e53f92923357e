"""Compute the thermal noise of an E1 range from a delay lock loop, and of an E6 range from one snapshot.

Theory of operation
-------------------
The spectrum S(f) has unit area over all frequencies, and I{·} is an integral over the front-end bandwidth. Let d be the
early-late spacing in s. B_L is the one-sided loop bandwidth in Hz, and T is the integration time in s [BETZ09]:

    non-coherent DLL    σ² = B_L (1 − ½ B_L T) I{S sin²(πfd)} / ((2π)² (C/N0) I{f S sin(πfd)}²)
                             · (1 + I{S cos²(πfd)} / (T (C/N0) I{S cos(πfd)}²))
    dot-product DLL, Re((L − E) P*) in place of |L|² − |E|²: the last factor is 1 + 1 / (T (C/N0) I{S})
    one snapshot        σ² ≥ 1 / (8π² (C/N0) T I{f²S})              Cramér-Rao bound

The E6 range from a snapshot has more noise than the E1 range from a tracking loop. At 35 dBHz, the range from a loop of
1 Hz has a standard deviation of 0.4 to 1 m. The smallest possible standard deviation of a range from 16 ms of E6 is 2.1
m with a bandwidth of 20.46 MHz. The range from three taps 15 m apart has a standard deviation of 2.5 m.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signals.definitions import E1C, E6C
from vestige.signals.pulse import BOC11, BOC61, Pulse, band_limited_autocorrelation, gabor_bandwidth_hz, spectrum

MBOC: Mapping[Pulse, float] = {BOC11: 10 / 11, BOC61: 1 / 11}  # power shares in E1-B plus E1-C [OS-ICD, 2.3.3]

_CELLS = 20_000  # number of cells of a frequency integral, for a relative error below 1e-7


def dll_noise_m(
    cn0_dbhz: float,
    *,
    bandwidth_hz: float,
    spacing_chips: float,
    shares: Mapping[Pulse, float] = MBOC,
    loop_bandwidth_hz: float = 1.0,
    integration_s: float = 20e-3,
    chip_rate_hz: float = E1C.chip_rate_hz,
    dot_product: bool = False,
) -> float:
    """Return the standard deviation in m of the pseudorange from a non-coherent delay lock loop.

    The discriminator of the loop is |L|² − |E|². With `dot_product` the discriminator is Re((L − E) P*).

    `cn0_dbhz` is the C/N0 of the tracked signal. `bandwidth_hz` is the two-sided bandwidth of the front end.
    `spacing_chips` is the distance between the early and the late correlator. `shares` are the power shares of the
    pulses of signal and replica. `loop_bandwidth_hz` is the one-sided bandwidth of the loop.
    """
    cn0 = 10.0 ** (cn0_dbhz / 10.0)
    of = _dll_integrals(tuple(shares.items()), bandwidth_hz, spacing_chips, chip_rate_hz)
    loop = loop_bandwidth_hz * (1 - 0.5 * loop_bandwidth_hz * integration_s)
    coherent = loop * of.sine_squared / (cn0 * of.slope**2)
    if dot_product:
        squaring = 1 / (integration_s * cn0 * of.power)
    else:
        squaring = of.cosine_squared / (integration_s * cn0 * of.cosine**2)
    return SPEED_OF_LIGHT_MPS * float(np.sqrt(coherent * (1 + squaring)))


class _DllIntegrals(NamedTuple):
    """Integrals for a delay lock loop, which do not depend on the C/N0."""

    slope: float  # 2π I{f S sin(πfd)}
    sine_squared: float
    cosine_squared: float
    cosine: float
    power: float  # I{S}, power within the bandwidth


@lru_cache(maxsize=64)
def _dll_integrals(
    shares: tuple[tuple[Pulse, float], ...], bandwidth_hz: float, spacing_chips: float, chip_rate_hz: float
) -> _DllIntegrals:
    f = (np.arange(_CELLS) + 0.5) * bandwidth_hz / 2 / _CELLS
    density = np.zeros(_CELLS)
    for pulse, share in shares:
        density += share * spectrum(pulse, f, chip_rate_hz) * bandwidth_hz / _CELLS
    angle = np.pi * f * spacing_chips / chip_rate_hz
    return _DllIntegrals(
        slope=2 * np.pi * np.sum(density * f * np.sin(angle)),
        sine_squared=np.sum(density * np.sin(angle) ** 2),
        cosine_squared=np.sum(density * np.cos(angle) ** 2),
        cosine=np.sum(density * np.cos(angle)),
        power=np.sum(density),
    )


def snapshot_noise_bound_m(cn0_dbhz: float, integration_s: float, bandwidth_hz: float) -> float:
    """Return the Cramér-Rao bound in m for the standard deviation of the E6-C range from one snapshot.

    `bandwidth_hz` is the two-sided bandwidth of the front end.
    """
    band = {"chip_rate_hz": E6C.chip_rate_hz, "bandwidth_hz": bandwidth_hz}
    passed = float(band_limited_autocorrelation(E6C.pulse, np.zeros(1), **band)[0])
    second_moment = gabor_bandwidth_hz(E6C.pulse, **band) ** 2 * passed
    snr = 10.0 ** (cn0_dbhz / 10.0) * integration_s
    return SPEED_OF_LIGHT_MPS / float(np.sqrt(8 * np.pi**2 * snr * second_moment))


def pll_variance_rad2(
    cn0_hz: Float[np.ndarray, "*n"], *, bandwidth_hz: float, integration_s: float
) -> Float[np.ndarray, "*n"]:
    """Return the phase variance of a phase lock loop in rad² [KAPLAN06, 5.6.1]; `bandwidth_hz` is one-sided."""
    return bandwidth_hz / cn0_hz * (1 + 1 / (2 * integration_s * cn0_hz))


def fll_variance_hz2(
    cn0_hz: Float[np.ndarray, "*n"], *, bandwidth_hz: float, integration_s: float
) -> Float[np.ndarray, "*n"]:
    """Return the Doppler variance of a frequency lock loop in Hz² [KAPLAN06, 5.6.2]; `bandwidth_hz` is one-sided."""
    spread = 4 * bandwidth_hz / cn0_hz * (1 + 1 / (integration_s * cn0_hz))
    return spread / (2 * np.pi * integration_s) ** 2
