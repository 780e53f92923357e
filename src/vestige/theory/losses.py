"""Compute losses of C/N0 in dB that the theory of `thresholds` leaves out: grids, dynamics, filter and quantiser.

Theory of operation
-------------------
An error τ of the code offset, in chips, multiplies the amplitude of a coherent correlator by the triangle R(τ) = 1 −
|τ|. A frequency error f multiplies the amplitude by sinc(f T_I), where T_I is the integration time. On a grid of step Δ
the error is at most Δ/2. The mean loss is the loss of the mean *power* over all errors, which are uniformly
distributed. An uncompensated acceleration makes the phase a parabola over T_I. An uncompensated code Doppler moves the
signal by D chips relative to the replica over T_I, from −D/2 to D/2. The mean of the triangle over this interval is
therefore 1 − D/4.

A positive number is a loss. [WFO] leaves out all these effects.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import erf

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signals.definitions import E6C
from vestige.signals.pulse import band_limited_autocorrelation

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


class GridLoss(NamedTuple):
    """Loss in dB halfway between two grid points, and loss in dB of the mean power over all positions in the grid."""

    worst_db: float
    mean_db: float


def code_grid_loss(step_chips: float) -> GridLoss:
    """Return the loss by a grid of code offsets, for an unfiltered rectangular chip.

    The step of the grid is above 0 and below 2 chips.
    """
    worst = 1 - step_chips / 2
    mean_power = (1 - worst**3) / (3 * (1 - worst))
    return GridLoss(-20 * float(np.log10(worst)), -10 * float(np.log10(mean_power)))


def doppler_grid_loss(step_hz: float, integration_s: float) -> GridLoss:
    """Return the loss by a grid of Doppler bins."""
    error_cycles = step_hz * integration_s / 2 * (1 + _NODES) / 2
    mean_power = np.sinc(error_cycles) ** 2 @ _WEIGHTS / 2
    worst = np.sinc(step_hz * integration_s / 2)
    return GridLoss(-20 * float(np.log10(worst)), -10 * float(np.log10(mean_power)))


def acceleration_loss_db(acceleration_mps2: float, integration_s: float) -> float:
    """Return the loss in dB on E6 by an uncompensated acceleration along the line of sight.

    The frequency of the replica is correct in the middle of the integration.
    """
    time_s = integration_s / 2 * _NODES
    phase = np.pi * acceleration_mps2 / SPEED_OF_LIGHT_MPS * E6C.carrier_hz * time_s**2
    return -20 * float(np.log10(np.abs(np.exp(1j * phase) @ _WEIGHTS) / 2))


def code_doppler_loss_db(doppler_hz: float, integration_s: float) -> float:
    """Return the loss in dB by an E6-C replica without code Doppler, aligned in the middle of the integration."""
    slide_chips = abs(doppler_hz) / E6C.carrier_hz * E6C.chip_rate_hz * integration_s
    return -20 * float(np.log10(1 - slide_chips / 4))


def front_end_loss_db(bandwidth_hz: float) -> float:
    """Return the loss of E6-C in dB by an ideal front-end filter, for an unfiltered replica.

    `bandwidth_hz` is the two-sided bandwidth of the filter. The loss follows from the share of the power that passes
    the filter.
    """
    passed = band_limited_autocorrelation(
        E6C.pulse, np.zeros(1), chip_rate_hz=E6C.chip_rate_hz, bandwidth_hz=bandwidth_hz
    )
    return -10 * float(np.log10(passed[0]))


def quantisation_loss_db(bits: int) -> float:
    """Return the loss in dB at low C/N0 by a quantiser of 1 bit (sign) or 2 bits (levels ±1, ±3 with the best step).

    Let v be the step in σ of the samples, Φ = erf(v/√2) the share of the samples at the inner levels ±1, and E =
    e^{-v²/2}. With 2 bits, the share (2/π) (1 + 2E)² / (Φ + 9 (1 − Φ)) of the C/N0 remains. With a single bit, the
    share 2/π remains.
    """
    if bits not in {1, 2}:
        raise ValueError(f"the loss is known for 1 and 2 bits, found {bits}")
    step = np.linspace(0.5, 1.5, 1001) if bits == 2 else np.array([np.inf])
    inner = erf(step / np.sqrt(2))
    efficiency = 2 / np.pi * (1 + 2 * np.exp(-(step**2) / 2)) ** 2 / (inner + 9 * (1 - inner))
    return -10 * float(np.log10(np.max(efficiency)))
