"""Simulate jamming waveforms as samples, and compute their effect on correlators.

Theory of operation
-------------------
A correlator multiplies the samples by random chips c and integrates over a time T, much longer than a chip. Each output
is a sum over many chips, so the output is almost Gaussian. For a jammer of spectral density S_J, the covariance of the
outputs at the delays d_i and d_k is

    C(d_i − d_k) = 1/T ∫ S_J(f) S_c(f) e^{j2πf(d_i − d_k)} df        S_c: spectrum of the chips

White noise N0 gives the covariance N0/T · R(d_i − d_k), with the autocorrelation R of the chips. With J/N in a noise
bandwidth B, the jammer's power is J = (J/N) N0 B. In units of N0/T, the covariance C(Δ) at the distance Δ = d_i − d_k
is

    wideband, pulsed noise   (J/N) R(Δ)                   white while on; mean power counts, many pulses fall in T
    continuous wave          (J/N) B S_c(f) e^{j2πfΔ}     all correlators see the same amplitude
    chirp over B_s           (J/N) (B/B_s) R_{B_s}(Δ)     many sweeps fall in T; R_B: behind a filter of width B

Sampling aliases the side lobes of S_c beyond ±f_s/2 onto the frequencies of the continuous wave or the sweep. This
effect, about 3 % more noise at 12.5 MHz, is neglected. C(0) is the *rise* of the noise density, which the jammer causes
after the correlator. The phase of a wave, a sweep or a pulse is drawn at random once per epoch of a campaign, or once
per recording.
"""

# ruff: noqa: ARG002  all waveforms have the same signature

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Annotated, ClassVar, Literal

import numpy as np
from jaxtyping import Complex64, Complex128, Float
from pydantic import Field

from vestige.signal_generator.noise_kernel import fill_normals
from vestige.signals.definitions import SignalDefinition
from vestige.signals.pulse import autocorrelation, band_limited_autocorrelation, spectrum

_SHORTEST_S = 0.999e-6  # shortest duration of a pulse in s, which is a few samples
_PIECE = 8192  # number of samples that are processed together; the arrays of these samples fit into the cache


class _White:
    """Base class of noise that is white while the jammer is on."""

    __slots__ = ()
    white: ClassVar[bool] = True  # whether the waveform is white noise while the jammer is on
    reach_hz: ClassVar[float] = 0.0  # largest distance in Hz of a wave or a sweep from the carrier; 0 for noise

    def covariance(
        self, signal: SignalDefinition, lag_chips: Float[np.ndarray, " n"], noise_bandwidth_hz: float
    ) -> Complex128[np.ndarray, " n"]:
        """Return the covariance C(Δ) of correlators for J/N = 1, in units of N0/T."""
        return autocorrelation(signal.pulse, np.abs(lag_chips)) + 0j


@dataclass(frozen=True, slots=True, kw_only=True)
class Wideband(_White):
    """White Gaussian noise that is wider than the receiver's band."""

    kind: Literal["wideband"] = "wideband"

    def add(
        self, x: Complex64[np.ndarray, " n"], power: float, sample_rate_hz: float, key: np.uint64, first: int = 0
    ) -> None:
        """Add the waveform to the samples `x`.

        Noise in the samples has variance 1, and the waveform has the mean power `power`. `key` determines the random
        numbers of the waveform (`noise_key`). `first` is the number of the first sample, so that consecutive pieces of
        a waveform are continuous.
        """
        _add_noise(x, power, key, first)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousWave:
    """Continuous wave at a frequency `offset_hz` above the carrier."""

    offset_hz: float = 0.0
    kind: Literal["cw"] = "cw"
    white: ClassVar[bool] = False  # whether the waveform is white noise while the jammer is on

    @property
    def reach_hz(self) -> float:
        """Distance of the continuous wave from the carrier in Hz."""
        return abs(self.offset_hz)

    def covariance(
        self, signal: SignalDefinition, lag_chips: Float[np.ndarray, " n"], noise_bandwidth_hz: float
    ) -> Complex128[np.ndarray, " n"]:
        """Return the covariance C(Δ) of correlators for J/N = 1, in units of N0/T."""
        density = float(spectrum(signal.pulse, np.array([self.offset_hz]), signal.chip_rate_hz)[0])
        turns = self.offset_hz * lag_chips / signal.chip_rate_hz
        return noise_bandwidth_hz * density * np.exp(2j * pi * turns)

    def add(
        self, x: Complex64[np.ndarray, " n"], power: float, sample_rate_hz: float, key: np.uint64, first: int = 0
    ) -> None:
        """Add the waveform to samples; `Wideband.add` explains the parameters."""
        step = 2j * pi * self.offset_hz / sample_rate_hz
        piece = np.exp(step * np.arange(min(_PIECE, x.size))).astype(np.complex64)
        for place in range(0, x.size, _PIECE):
            turn = np.complex64(np.sqrt(power) * np.exp(step * (first + place) + 2j * pi * _uniform(key)))
            x[place : place + _PIECE] += turn * piece[: x.size - place]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chirp:
    """Sawtooth sweep over `bandwidth_hz` around the carrier; the period `sweep_s` is rounded to whole samples."""

    bandwidth_hz: float = 10e6
    sweep_s: float = 20e-6
    kind: Literal["chirp"] = "chirp"
    white: ClassVar[bool] = False  # whether the waveform is white noise while the jammer is on

    def __post_init__(self) -> None:
        if not (0 < self.bandwidth_hz <= 1e9 and 1e-6 <= self.sweep_s <= 1e-3):
            raise ValueError("a chirp has a bandwidth up to 1 GHz and a sweep of 1 µs to 1 ms")

    @property
    def reach_hz(self) -> float:
        """Largest distance of the sweep from the carrier in Hz."""
        return self.bandwidth_hz / 2

    def covariance(
        self, signal: SignalDefinition, lag_chips: Float[np.ndarray, " n"], noise_bandwidth_hz: float
    ) -> Complex128[np.ndarray, " n"]:
        """Return the covariance C(Δ) of correlators for J/N = 1, in units of N0/T."""
        passed = band_limited_autocorrelation(
            signal.pulse, lag_chips, chip_rate_hz=signal.chip_rate_hz, bandwidth_hz=self.bandwidth_hz
        )
        return noise_bandwidth_hz / self.bandwidth_hz * passed + 0j

    def add(
        self, x: Complex64[np.ndarray, " n"], power: float, sample_rate_hz: float, key: np.uint64, first: int = 0
    ) -> None:
        """Add the waveform to samples; `Wideband.add` explains the parameters."""
        n = max(2, round(self.sweep_s * sample_rate_hz))
        t = np.arange(n) / sample_rate_hz - self.sweep_s / 2
        sweep = np.exp(1j * pi * self.bandwidth_hz / self.sweep_s * t**2)
        turn = np.exp(2j * pi * _uniform(key))
        start = (int(_other_uniform(key) * n) + first) % n
        sweep = np.roll(np.sqrt(power) * turn * sweep, -start).astype(np.complex64)
        piece = np.tile(sweep, -(-_PIECE // n))
        for place in range(0, x.size, piece.size):
            x[place : place + piece.size] += piece[: x.size - place]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulsed(_White):
    """Wideband noise during the share `duty` of every `period_s`; J is the mean power over pulses and pauses."""

    duty: float = 0.1
    period_s: float = 1e-3
    kind: Literal["pulsed"] = "pulsed"

    def __post_init__(self) -> None:
        if not (0 < self.duty <= 1 and 1e-5 <= self.period_s <= 1e-2 and self.duty * self.period_s >= _SHORTEST_S):
            raise ValueError("pulses have a duty in (0, 1], a period of 10 µs to 10 ms, and last 1 µs or longer")

    def add(
        self, x: Complex64[np.ndarray, " n"], power: float, sample_rate_hz: float, key: np.uint64, first: int = 0
    ) -> None:
        """Add the waveform to samples; `Wideband.add` explains the parameters."""
        period = self.period_s * sample_rate_hz
        edge = -_uniform(key) * period  # position of the first edge of a pulse, in samples
        for k in range(int((first - edge) / period), int((first + x.size - edge) / period) + 1):
            begin, end = round(edge + k * period), round(edge + (k + self.duty) * period)
            begin, end = max(begin, first), min(end, first + x.size)
            if begin < end:
                _add_noise(x[begin - first : end - first], power / self.duty, key, begin)


WIDEBAND = Wideband()
ALL_JAMMERS = (Wideband, ContinuousWave, Chirp, Pulsed)
AnyJammer = Wideband | ContinuousWave | Chirp | Pulsed
Jammer = Annotated[AnyJammer, Field(discriminator="kind")]


def rise(jammer: AnyJammer, signal: SignalDefinition, noise_bandwidth_hz: float) -> float:
    """Return C(0) for J/N = 1, which is the rise of the noise density after a correlator in units of N0."""
    return float(jammer.covariance(signal, np.zeros(1), noise_bandwidth_hz)[0].real)


def power_in_samples(jammer: AnyJammer, j_over_n: float, noise_bandwidth_hz: float, sample_rate_hz: float) -> float:
    """Return the mean power of a jammer in samples whose noise has variance 1.

    White noise adds only its power within the bandwidth f_s of the samples, which is J/N. Every other waveform adds its
    whole power, which is (J/N) B/f_s.
    """
    return j_over_n if jammer.white else j_over_n * noise_bandwidth_hz / sample_rate_hz


def _uniform(key: np.uint64) -> float:
    """Return a uniformly distributed number in [0, 1) that follows from the key, which is a hash."""
    return int(key) / 2.0**64


def _other_uniform(key: np.uint64) -> float:
    """Return a second uniformly distributed number in [0, 1), which follows from the lower 32 bits of the key."""
    return (int(key) & 0xFFFFFFFF) / 2.0**32


def _add_noise(x: Complex64[np.ndarray, " n"], power: float, key: np.uint64, first: int) -> None:
    noise = np.empty(2 * x.size, np.float32)
    fill_normals(key, np.int64(first), np.float32(np.sqrt(power / 2)), noise)
    x += noise.view(np.complex64)
