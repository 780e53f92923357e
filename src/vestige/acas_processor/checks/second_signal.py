"""A second signal in the correlators of one RECS, against what rays of multipath may leave there [WFO, Sec. III-B].

Theory of operation
-------------------
One signal is a triangle r(τ) of unknown amplitude and place. With C the correlation of the noise in the taps,
⟨a, b⟩ = aᴴC⁻¹b, taps c in standard deviations of the noise per dimension and τ₁ where |⟨r, c⟩|²/⟨r, r⟩ is largest,

    r₂⊥ = r(τ) − r(τ₁) ⟨r(τ₁), r(τ)⟩/⟨r(τ₁), r(τ₁)⟩        G = max over |τ − τ₁| ≥ ½ chip of |⟨r₂⊥, c⟩|²/⟨r₂⊥, r₂⊥⟩

is how much better two signals explain the taps than one. Noise alone makes every |·|²/2 exponential. A ray of Rayleigh
amplitude and mean power P over a direct signal of amplitude s adds at most s²P/2 to the variance in each dimension, and
looks like a spoofer: nobody can tell the two apart by one RECS. So

    fail where √G > √(−2 (1 + s²P/2) ln(p_fa/N))        N = places that are tried

a bound, because neighbouring places share noise and a ray rarely lies in the worst one. Where P is −15.8 dB (harsh
conditions) nothing below −4 dB of the direct signal is seen at p_fa = 10⁻⁶, be C/N0 as large as it likes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Complex128, Float

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
_BLOCK = 20_000  # epochs at once, so that memory does not grow


class TwoSignals(NamedTuple):
    """What two signals explain: √G, amplitude s of the stronger (σ per dimension), place of the earlier one in m."""

    statistic: Float[np.ndarray, "*n"]
    amplitude: Float[np.ndarray, "*n"]
    earlier_m: Float[np.ndarray, "*n"]


class _Places(NamedTuple):
    """What does not depend on the taps: places, r(τ) over √⟨r, r⟩, and that of r₂⊥ for each pair (0 if too near)."""

    at_m: Float[np.ndarray, " places"]
    whitened: Float[np.ndarray, "places n_taps"]
    beside: Float[np.ndarray, "places places n_taps"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondSignalMonitor(Monitor):
    """Whether the correlators of one RECS hold more than one signal and its rays."""

    name: ClassVar = CheckName.E6_SECOND_SIGNAL
    unit: ClassVar = "sigma"
    # P, mean power of all rays over the direct signal
    ray_power_db: float = -15.8  # of the harsh conditions [WFO, Sec. VI-A]
    p_fa: float = 1e-6  # false-alarm probability of one test of one satellite, a bound

    def statistic(
        self,
        taps: Complex128[np.ndarray, "n n_taps"],
        noise_power: Float[np.ndarray, " n"],
        offsets_m: Float[np.ndarray, " n_taps"],
    ) -> TwoSignals:
        """Return what two signals explain.

        `noise_power` is the mean squared magnitude of noise in one correlator.
        """
        places = _places(tuple(np.round(offsets_m, 6).tolist()))
        scaled = taps / np.sqrt(noise_power / 2)[:, None]
        found = np.empty((3, noise_power.size))
        for low in range(0, noise_power.size, _BLOCK):
            part = slice(low, low + _BLOCK)
            alone = np.abs(
                np.einsum("nt,pt->np", scaled[part], places.whitened)
            )  # no BLAS: same bits for any number of rows
            first = np.argmax(alone, axis=1)
            further = np.abs(np.einsum("npt,nt->np", places.beside[first], scaled[part]))
            second, row = np.argmax(further, axis=1), np.arange(first.size)
            found[:, part] = further[row, second], alone[row, first], places.at_m[np.minimum(first, second)]
        return TwoSignals(*found)

    def threshold(
        self, amplitude: Float[np.ndarray, "*n"], offsets_m: Float[np.ndarray, " n_taps"]
    ) -> Float[np.ndarray, "*n"]:
        """Return the largest √G that passes beside a signal of an amplitude s."""
        tried = _places(tuple(np.round(offsets_m, 6).tolist())).whitened.shape[0]
        variance = 1 + amplitude**2 * 10 ** (self.ray_power_db / 10) / 2
        return np.sqrt(-2 * variance * np.log(self.p_fa / tried))

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the check over a block; low satellites have stronger multipath, high ones weaker."""
        measured = evidence.measured
        found = two_signals(self, measured)
        relative = relative_ray_amplitude(evidence.elevation_rad)
        threshold = self.threshold(found.amplitude * relative, measured.banks.offsets_m)

        def explain(epoch: int, satellite: int) -> str:
            if np.isnan(found.statistic[epoch, satellite]):
                return "nothing was correlated on E6"
            return "there is a second signal beside the one that E1 predicts"

        return series_of(self, found.statistic, threshold, explain)


def two_signals(monitor: SecondSignalMonitor, measured: MeasurementBlock) -> TwoSignals:
    """Return what two signals explain in every bank of a block; NaN where nothing was correlated."""
    correlated = measured.availability == Availability.CORRELATED
    banks = measured.banks
    found = monitor.statistic(banks.taps[correlated], banks.noise_power[correlated], banks.offsets_m)
    return TwoSignals(*(spread_over_block(values, correlated, correlated.shape) for values in found))


@cache
def _places(offsets_m: tuple[float, ...]) -> _Places:
    """Return the places of a bank of taps, which end where its taps do."""
    chips = np.array(offsets_m) * _CHIPS_A_METRE
    at = np.arange(chips[0], chips[-1] + _STEP_CHIPS / 2, _STEP_CHIPS)
    shape = autocorrelation(BPSK, np.subtract.outer(at, chips).ravel()).reshape(at.size, chips.size)
    lags = np.subtract.outer(chips, chips)
    noise = autocorrelation(BPSK, lags.ravel()).reshape(lags.shape)
    weighted = np.linalg.solve(noise, shape.T).T  # C⁻¹ r
    own = np.einsum("pt,pt->p", shape, weighted)
    share = (weighted @ shape.T) / own[:, None]  # ⟨r₁, r⟩/⟨r₁, r₁⟩, first place by second
    left = own[None, :] - share**2 * own[:, None]
    apart = (np.abs(at[:, None] - at) >= _APART_CHIPS) & (left > 1e-6)
    beside = np.where(
        apart[..., None],
        (weighted[None] - share[..., None] * weighted[:, None]) / np.sqrt(np.where(apart, left, 1.0))[..., None],
        0.0,
    )
    return _Places(at_m=at / _CHIPS_A_METRE, whitened=weighted / np.sqrt(own)[:, None], beside=beside)
