"""Compute the spectrum and the correlation of chip pulses, with and without a band limit.

Every Galileo pulse in vestige is piecewise constant over a chip. A chip has n equal sub-chips with levels a_0 … a_{n-1}
and mean square 1. Spectrum and correlations follow exactly from the levels. With the duration T_c of a chip and the
width w = T_c/n of a sub-chip, the functions are:

    spectrum          S(f) = (w sinc(f w))² |Σ_k a_k e^{-j2πf(k+½)w}|² / T_c        unit area over all f
    autocorrelation   R(τ): linear between R(m w) = (1/n) Σ_k a_k a_{k+m}           random code, |τ| < T_c
    band-limited      R_B(τ) = ∫_{-B/2}^{B/2} S(f) cos(2πfτ) df                     ideal filter

CBOC(6,1,1/11) is √(10/11) BOC(1,1) ± √(1/11) BOC(6,1), on twelve sub-chips [OS-ICD, 2.3.3]. The sign is + on E1-B and −
on E1-C. In the average over E1-B and E1-C the cross term cancels, so the average spectrum is MBOC = 10/11 BOC(1,1) +
1/11 BOC(6,1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Complex128, Float

_NODES_PER_LOBE = 24  # number of Gauss-Legendre nodes per spectral lobe, for a relative error below 1e-9


@dataclass(frozen=True, slots=True)
class Pulse:
    """Chip pulse that is piecewise constant.

    Parameters
    ----------
    name
        Usual name, such as `BPSK` or `BOC(1,1)`.
    levels
        Amplitudes on the equal sub-chips of a chip; the mean square of the amplitudes is 1.
    """

    name: str
    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        if not np.isclose(np.mean(np.square(self.levels)), 1.0, rtol=0, atol=1e-12):
            raise ValueError(f"pulse {self.name} does not have unit power")


def boc_levels(half_cycles: int) -> Float[np.ndarray, " half_cycles"]:
    """Return the levels +1, −1, … of a sine-phased BOC pulse with `half_cycles` half cycles per chip."""
    return np.where(np.arange(half_cycles) % 2 == 0, 1.0, -1.0)


_SHARE_11, _SHARE_61 = float(np.sqrt(10 / 11)), float(np.sqrt(1 / 11))  # CBOC(6,1,1/11) [OS-ICD, 2.3.3]


def _cboc(sign: float) -> tuple[float, ...]:
    low, high = np.repeat(boc_levels(2), 6), boc_levels(12)
    return tuple((_SHARE_11 * low + sign * _SHARE_61 * high).tolist())


BPSK = Pulse("BPSK", (1.0,))
BOC11 = Pulse("BOC(1,1)", (1.0, -1.0))
BOC61 = Pulse("BOC(6,1)", tuple(boc_levels(12).tolist()))
CBOC_PLUS = Pulse("CBOC(6,1,1/11,+)", _cboc(+1.0))
CBOC_MINUS = Pulse("CBOC(6,1,1/11,-)", _cboc(-1.0))


def spectrum(pulse: Pulse, frequency_hz: Float[np.ndarray, " n"], chip_rate_hz: float) -> Float[np.ndarray, " n"]:
    """Return the power spectral density S(f) in 1/Hz, of unit area over all frequencies, for a random code.

    Parameters
    ----------
    frequency_hz
        Frequency minus the carrier frequency in Hz.
    chip_rate_hz
        Chip rate in chips/s.
    """
    return np.abs(_line(pulse, frequency_hz, chip_rate_hz)) ** 2 * chip_rate_hz


def _line(pulse: Pulse, frequency_hz: Float[np.ndarray, " n"], chip_rate_hz: float) -> Complex128[np.ndarray, " n"]:
    """Return the Fourier transform of one pulse, in s, at frequencies relative to the carrier."""
    levels = np.asarray(pulse.levels)
    width = 1.0 / (chip_rate_hz * levels.size)
    centers = (np.arange(levels.size) + 0.5) * width
    turns = np.exp(-2j * np.pi * np.multiply.outer(frequency_hz, centers)) @ levels
    return width * np.sinc(frequency_hz * width) * turns


def autocorrelation(pulse: Pulse, delay_chips: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the autocorrelation R(τ) of an unfiltered signal with a random code, which is 0 beyond one chip.

    Parameters
    ----------
    delay_chips
        Delay τ in chips.
    """
    return cross_correlation(pulse, pulse, delay_chips)


def cross_correlation(received: Pulse, replica: Pulse, delay_chips: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the correlation of an unfiltered signal with a replica that has another pulse and the same random code.

    If the two pulses have the same symmetry about the middle of the chip, the correlation is even. Beyond one chip the
    correlation is zero.

    Parameters
    ----------
    received, replica
        Pulses of the received signal and of the replica.
    delay_chips
        Delay of the replica relative to the received pulse in chips, positive if later.

    Examples
    --------
    A receiver that correlates E1-C with BOC(1,1) gets the amplitude √(10/11), a loss of 0.4 dB:

    >>> import numpy as np
    >>> from vestige.signals.pulse import BOC11, CBOC_MINUS, cross_correlation
    >>> cross_correlation(CBOC_MINUS, BOC11, np.zeros(1)).round(4)[0].item()
    0.9535
    """
    return np.interp(delay_chips, *_corners(received, replica))


@lru_cache(maxsize=16)
def _corners(received: Pulse, replica: Pulse) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Return delays in chips and values at the corners of the correlation, which is linear between its corners."""
    n = math.lcm(len(received.levels), len(replica.levels))
    first, second = (np.repeat(one.levels, n // len(one.levels)) for one in (received, replica))
    values = np.pad(np.correlate(first, second, mode="full") / n, 1)
    return np.arange(-n, n + 1) / n, values


def band_limited_autocorrelation(
    pulse: Pulse, delay_chips: Float[np.ndarray, " n"], *, chip_rate_hz: float, bandwidth_hz: float
) -> Float[np.ndarray, " n"]:
    """Return the autocorrelation R_B(τ) after an ideal filter; R_B(0) is the share of the power that passes the filter.

    Parameters
    ----------
    delay_chips
        Delay τ in chips.
    chip_rate_hz
        Chip rate in chips/s.
    bandwidth_hz
        Two-sided bandwidth B in Hz.
    """
    f, weight = _frequency_nodes(bandwidth_hz, chip_rate_hz, float(np.max(np.abs(delay_chips), initial=0.0)))
    density = weight * spectrum(pulse, f, chip_rate_hz)
    return 2 * np.cos(2 * np.pi * np.multiply.outer(delay_chips / chip_rate_hz, f)) @ density


def band_limited_correlation(
    received: Pulse,
    replica: Pulse,
    delay_chips: Float[np.ndarray, " n"],
    *,
    chip_rate_hz: float,
    bandwidth_hz: float,
) -> Float[np.ndarray, " n"]:
    """Return the correlation of a signal, received through an ideal filter, with a replica that has another pulse.

    The correlation is R(τ) = ∫ S_rp(f) e^{j2πfτ} df over ±B/2, with S_rp the cross spectrum for a random code. For two
    equal pulses R is `band_limited_autocorrelation`. The two pulses must have the same symmetry about the middle of the
    chip, so that R is real.

    Parameters
    ----------
    delay_chips
        Delay of the received pulse relative to the replica in chips, positive if later.
    chip_rate_hz
        Chip rate in chips/s.
    bandwidth_hz
        Two-sided bandwidth B in Hz.
    """
    f, weight = _frequency_nodes(bandwidth_hz, chip_rate_hz, float(np.max(np.abs(delay_chips), initial=0.0)))
    density = weight * (_line(received, f, chip_rate_hz) * np.conj(_line(replica, f, chip_rate_hz))).real * chip_rate_hz
    return 2 * np.cos(2 * np.pi * np.multiply.outer(delay_chips / chip_rate_hz, f)) @ density


def gabor_bandwidth_hz(pulse: Pulse, *, chip_rate_hz: float, bandwidth_hz: float) -> float:
    """Return the rms (Gabor) bandwidth √(∫f²S / ∫S) within ±B/2, in Hz."""
    f, weight = _frequency_nodes(bandwidth_hz, chip_rate_hz, 0.0)
    density = weight * spectrum(pulse, f, chip_rate_hz)
    return float(np.sqrt(np.sum(f**2 * density) / np.sum(density)))


@lru_cache(maxsize=1)
def _gauss_nodes() -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    nodes, weights = np.polynomial.legendre.leggauss(_NODES_PER_LOBE)
    return nodes, weights


def _frequency_nodes(
    bandwidth_hz: float, chip_rate_hz: float, delay_chips: float
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Return Gauss-Legendre nodes in Hz and weights over 0 to B/2, enough for the lobes of S(f) and for cos(2πfτ)."""
    if not bandwidth_hz > 0:
        raise ValueError(f"bandwidth must be positive, found {bandwidth_hz}")
    lobes = bandwidth_hz / 2 / chip_rate_hz * (1 + delay_chips)
    nodes, weights = _gauss_nodes()
    edges = np.linspace(0.0, bandwidth_hz / 2, max(2, int(np.ceil(lobes)) + 1))
    half = np.diff(edges)[:, None] / 2
    return ((edges[:-1, None] + half) + half * nodes).ravel(), (half * weights).ravel()
