"""Check for a second signal in the correlators of one RECS, beyond multipath reflections [WFO, Sec. III-B].

Theory of operation
-------------------
The correlation function of one signal is a triangle r(τ) of unknown amplitude and position. C is the correlation matrix
of the noise in the taps, and ⟨a, b⟩ = aᴴC⁻¹b. The taps c are in standard deviations of the noise per dimension. τ₁ is
the position at which |⟨r, c⟩|²/⟨r, r⟩ is largest. The statistic is √G with

    r₂⊥ = r(τ) − r(τ₁) ⟨r(τ₁), r(τ)⟩/⟨r(τ₁), r(τ₁)⟩        G = max over |τ − τ₁| ≥ ½ chip of |⟨r₂⊥, c⟩|²/⟨r₂⊥, r₂⊥⟩

√G measures how much better two signals explain the taps than one signal. With noise alone, half of each quotient in G
has an exponential distribution. Let a reflection have a Rayleigh amplitude and the mean power P over a direct signal of
amplitude s. The reflection adds at most s²P/2 to the variance in each dimension. In a single RECS such a reflection
looks like a spoofing signal. The check therefore fails where

    √G > √(−2 (1 + k s²P/2) ln(p_fa/N))        N = number of positions tried

If the weaker signal is the later signal, k is 1. The false-alarm probability is an upper limit, because neighbouring
positions share noise and a reflection rarely lies at the worst position. In harsh conditions P is −15.8 dB at 16° of
elevation. With this P and p_fa = 10⁻⁶, a later signal that is more than 4 dB weaker than the direct signal is not
detected at any C/N0.

A reflection never arrives before its direct signal. If the weaker signal is the earlier signal, this signal is no
reflection of the stronger signal, and k could be 0. Instead k is 0.06, which allows for two effects: a near reflection
distorts the triangle, and τ₁ is found only to 0.05 chip. With k = 0.06, the measured rate of false alarms stays below
p_fa up to 45 dBHz with an integration of 16 ms.

The check uses the correlators within `reach_m` of the prediction. More than `reach_m` before the prediction, only the
early detector separates two signals in the bank.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.acas_processor.checks.check import Monitor, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import Availability, MeasurementBlock, spread_over_block
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.elevation_model import relative_ray_amplitude
from vestige.records.checks import CheckName, CheckSeries
from vestige.signals.definitions import E6C
from vestige.signals.pulse import BPSK, autocorrelation

_CHIPS_A_METRE = E6C.chip_rate_hz / SPEED_OF_LIGHT_MPS
_STEP_CHIPS = 0.05
_APART_CHIPS = 0.5
_EARLY_SHARE = 0.06  # k where the weaker signal is the earlier signal
_BLOCK = 20_000  # number of epochs that are processed at once, which limits the memory


class TwoSignals(NamedTuple):
    """Best fit of two signals to the correlators of a RECS."""

    statistic: Float[np.ndarray, "*n"]  # √G, how much better two signals explain the taps than one signal
    # amplitude s of the stronger signal in standard deviations of the noise per dimension
    amplitude: Float[np.ndarray, "*n"]
    stronger_m: Float[np.ndarray, "*n"]  # offset of the stronger signal from the prediction in m
    weaker_m: Float[np.ndarray, "*n"]  # offset of the weaker signal from the prediction in m

    @property
    def earlier_m(self) -> Float[np.ndarray, "*n"]:
        """Offset of the earlier signal from the prediction in m."""
        return np.minimum(self.stronger_m, self.weaker_m)


class _Places(NamedTuple):
    """Positions of signals that are tried, with weights of the taps for each position and each pair of positions."""

    at_m: Float[np.ndarray, " places"]  # positions τ in m from the prediction
    whitened: Float[np.ndarray, "places n_taps"]  # C⁻¹ r(τ)/√⟨r, r⟩ of each position
    # C⁻¹ r₂⊥/√⟨r₂⊥, r₂⊥⟩ of each pair of positions; 0 for positions less than ½ chip apart
    beside: Float[np.ndarray, "places places n_taps"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondSignalMonitor(Monitor):
    """Monitor that detects a second signal, beyond reflections, in the correlators of one RECS."""

    name: ClassVar = CheckName.E6_SECOND_SIGNAL
    unit: ClassVar = "sigma"
    # P, mean power of all reflections over the direct signal in dB; the default is for harsh conditions [WFO, Sec.
    # VI-A]
    ray_power_db: float = -15.8
    p_fa: float = 1e-6  # false-alarm probability of one test of one satellite, an upper limit
    reach_m: float = np.inf  # largest distance of a used correlator from the prediction, in m

    def near(self, offsets_m: Float[np.ndarray, " n_taps"]) -> Bool[np.ndarray, " n_taps"]:
        """Return for each correlator whether the check uses the correlator."""
        return np.abs(offsets_m) <= self.reach_m * (1 + 1e-9)

    def statistic(
        self,
        taps: Complex128[np.ndarray, "n n_taps"],
        noise_power: Float[np.ndarray, " n"],
        offsets_m: Float[np.ndarray, " n_taps"],
    ) -> TwoSignals:
        """Return the best fit of two signals to the correlators of each RECS.

        `noise_power` is the mean squared magnitude of the noise in one correlator.
        """
        places = _places(tuple(np.round(offsets_m, 6).tolist()))
        scaled = taps / np.sqrt(noise_power / 2)[:, None]
        found = np.empty((4, noise_power.size))
        for low in range(0, noise_power.size, _BLOCK):
            part = slice(low, low + _BLOCK)
            alone = np.abs(
                np.einsum("nt,pt->np", scaled[part], places.whitened)
            )  # `einsum` uses no BLAS here, so the number of rows does not change a bit of the result
            first = np.argmax(alone, axis=1)
            further = np.abs(np.einsum("npt,nt->np", places.beside[first], scaled[part]))
            second, row = np.argmax(further, axis=1), np.arange(first.size)
            found[:, part] = further[row, second], alone[row, first], places.at_m[first], places.at_m[second]
        return TwoSignals(*found)

    def threshold(
        self, found: TwoSignals, offsets_m: Float[np.ndarray, " n_taps"], *, relative: float | np.ndarray = 1.0
    ) -> Float[np.ndarray, "*n"]:
        """Return the largest √G that passes; `relative` scales the amplitude of reflections (1 at 16° of elevation)."""
        tried = _places(tuple(np.round(offsets_m, 6).tolist())).whitened.shape[0]
        share = np.where(found.weaker_m < found.stronger_m, _EARLY_SHARE, 1.0)
        ray_amplitude = found.amplitude * relative
        variance = 1 + share * ray_amplitude**2 * 10 ** (self.ray_power_db / 10) / 2
        return np.sqrt(-2 * variance * np.log(self.p_fa / tried))

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results for a block; low satellites have stronger multipath and therefore a higher threshold."""
        measured = evidence.measured
        found = two_signals(self, measured)
        offsets_m = measured.banks.offsets_m
        relative = relative_ray_amplitude(evidence.elevation_rad)
        threshold = self.threshold(found, offsets_m[self.near(offsets_m)], relative=relative)

        def explain(epoch: int, satellite: int) -> str:
            if np.isnan(found.statistic[epoch, satellite]):
                return "nothing was correlated on E6"
            return "there is a second signal beside the one that E1 predicts"

        return series_of(self, found.statistic, threshold, explain)


def two_signals(monitor: SecondSignalMonitor, measured: MeasurementBlock) -> TwoSignals:
    """Return the best fit of two signals to every bank of a block; NaN where nothing was correlated."""
    correlated = measured.availability == Availability.CORRELATED
    banks = measured.banks
    near = monitor.near(banks.offsets_m)
    taps = banks.taps[correlated]
    found = monitor.statistic(
        taps if near.all() else taps[:, near], banks.noise_power[correlated], banks.offsets_m[near]
    )
    return TwoSignals(*(spread_over_block(values, correlated, correlated.shape) for values in found))


@cache
def _places(offsets_m: tuple[float, ...]) -> _Places:
    """Return positions from the first to the last tap of a bank, and the weights of the taps for these positions."""
    chips = np.array(offsets_m) * _CHIPS_A_METRE
    at = np.arange(chips[0], chips[-1] + _STEP_CHIPS / 2, _STEP_CHIPS)
    shape = autocorrelation(BPSK, np.subtract.outer(at, chips).ravel()).reshape(at.size, chips.size)
    lags = np.subtract.outer(chips, chips)
    noise = autocorrelation(BPSK, lags.ravel()).reshape(lags.shape)
    weighted = np.linalg.solve(noise, shape.T).T  # C⁻¹ r
    own = np.einsum("pt,pt->p", shape, weighted)
    share = (weighted @ shape.T) / own[:, None]  # ⟨r₁, r⟩/⟨r₁, r₁⟩, first position in rows, second position in columns
    left = own[None, :] - share**2 * own[:, None]
    apart = (np.abs(at[:, None] - at) >= _APART_CHIPS) & (left > 1e-6)
    beside = np.where(
        apart[..., None],
        (weighted[None] - share[..., None] * weighted[:, None]) / np.sqrt(np.where(apart, left, 1.0))[..., None],
        0.0,
    )
    return _Places(at_m=at / _CHIPS_A_METRE, whitened=weighted / np.sqrt(own)[:, None], beside=beside)
