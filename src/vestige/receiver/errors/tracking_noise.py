"""Simulate the thermal noise of code, carrier phase and Doppler in a receiver's E1 observations.

Theory of operation
-------------------
The table gives the standard deviations. B is the one-sided noise bandwidth of the loop, T is the integration time, and
C is C/N0.

    code      non-coherent delay lock loop [BETZ09], see `theory.thermal_noise`
    carrier   phase lock loop        σ_φ = √(B/C · (1 + 1/(2TC))) rad                 [KAPLAN06, 5.6.1]
    Doppler   frequency lock loop    σ_f = 1/(2πT) √(4FB/C · (1 + 1/(TC))) Hz, F = 1   [KAPLAN06, 5.6.2]

The error of a loop is correlated in time. A first-order loop of noise bandwidth B has the impulse response 4B e^{−4Bt},
so its error is a Gauss-Markov process with τ = 1/(4B). With B = 1 Hz, the correlation is 1.8 % for observations 1 s
apart, and 92 % for observations 20 ms apart. The model treats loops of higher order as first-order loops.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt
from types import MappingProxyType
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.errors.error_process import Streams, TrackingModel
from vestige.receiver.errors.gauss_markov import GaussMarkovProcess
from vestige.signals.definitions import E1C
from vestige.signals.pulse import BOC11, BPSK, Pulse
from vestige.theory.thermal_noise import MBOC, dll_noise_m, pll_variance_rad2

PulseName = Literal["BOC(1,1)", "MBOC", "BPSK"]
SHARES: Mapping[PulseName, Mapping[Pulse, float]] = MappingProxyType(
    {"BOC(1,1)": {BOC11: 1.0}, "MBOC": MBOC, "BPSK": {BPSK: 1.0}}
)
# ranges of values that a real receiver could have
_RANGES = {
    "chip_rate_hz": (1e5, 1e8),
    "carrier_hz": (1e8, 1e11),
    "bandwidth_hz": (1e5, 1e9),
    "spacing_chips": (1e-3, 1.0),
    "loop_bandwidth_hz": (1e-12, 1e3),
    "pll_bandwidth_hz": (1e-12, 1e3),
    "fll_bandwidth_hz": (1e-12, 1e3),
    "integration_s": (1e-4, 100.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class BetzTrackingNoise:
    """Noise of a delay lock loop, a phase lock loop and a frequency lock loop.

    The code noise of the default loop is 0.56 m at 35 dBHz, and 0.79 m with a loop bandwidth of 2 Hz. [WFO, Sec. II-B]
    gives a code noise of 0.5 to 1 m. For MBOC at 35 dBHz the code noise is 0.40 m with an early-late spacing of
    0.1 chip. With 0.2 chip the code noise is 2.3 m, because the discriminator has little slope.

    Attributes
    ----------
    pulse
        Pulse of signal and replica.
    chip_rate_hz, carrier_hz
        Chip rate and carrier frequency of the tracked signal in Hz.
    bandwidth_hz
        Two-sided bandwidth of the front end in Hz.
    spacing_chips
        Distance between the early and the late correlator in chips.
    loop_bandwidth_hz, pll_bandwidth_hz, fll_bandwidth_hz
        Noise bandwidths B of the delay, phase and frequency lock loops in Hz.
    integration_s
        T, integration time in s.
    """

    pulse: PulseName = "BOC(1,1)"
    chip_rate_hz: float = E1C.chip_rate_hz
    carrier_hz: float = E1_CARRIER_HZ
    bandwidth_hz: float = 24.552e6
    spacing_chips: float = 0.1
    loop_bandwidth_hz: float = 1.0
    pll_bandwidth_hz: float = 18.0
    fll_bandwidth_hz: float = 5.0
    integration_s: float = 20e-3
    kind: Literal["betz"] = "betz"

    def __post_init__(self) -> None:
        bandwidths = (self.loop_bandwidth_hz, self.pll_bandwidth_hz, self.fll_bandwidth_hz)
        if not (self.integration_s > 0 and all(0 < b * self.integration_s < 2 for b in bandwidths)):
            raise ValueError("a loop of bandwidth B that is updated every T needs 0 < BT < 2")
        for name, (low, high) in _RANGES.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} lies between {low:g} and {high:g}")

    def code_sigma_m(self, cn0_dbhz: float) -> float:
        """Return the standard deviation of the pseudorange in m at the C/N0 `cn0_dbhz`; 0 if the C/N0 is +inf."""
        return dll_noise_m(
            cn0_dbhz,
            bandwidth_hz=self.bandwidth_hz,
            spacing_chips=self.spacing_chips,
            shares=SHARES[self.pulse],
            loop_bandwidth_hz=self.loop_bandwidth_hz,
            integration_s=self.integration_s,
            chip_rate_hz=self.chip_rate_hz,
        )

    def carrier_sigma_m(self, cn0_dbhz: float) -> float:
        """Return the standard deviation of the carrier phase in m at the C/N0 `cn0_dbhz`."""
        phase_rad = sqrt(self.phase_variance_rad2(np.array([10 ** (cn0_dbhz / 10)]))[0])
        return phase_rad / (2 * pi) * SPEED_OF_LIGHT_MPS / self.carrier_hz

    def phase_variance_rad2(self, cn0_hz: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the variance of the carrier phase in rad² at the C/N0 `cn0_hz`."""
        return pll_variance_rad2(cn0_hz, bandwidth_hz=self.pll_bandwidth_hz, integration_s=self.integration_s)

    def doppler_sigma_hz(self, cn0_dbhz: float) -> float:
        """Return the standard deviation of the Doppler in Hz at the C/N0 `cn0_dbhz`."""
        c = 10 ** (cn0_dbhz / 10)
        spread = sqrt(4 * self.fll_bandwidth_hz / c * (1 + 1 / (self.integration_s * c)))
        return spread / (2 * pi * self.integration_s)

    def process(self, streams: Streams, *, cn0_dbhz: float) -> TrackingNoiseProcess:
        """Return a realisation for one satellite from its streams, at the C/N0 of the tracked signal in dBHz."""
        return TrackingNoiseProcess(self, streams, cn0_dbhz)


class TrackingNoiseProcess:
    """One realisation of a `BetzTrackingNoise`, with independent noise of code, carrier and Doppler."""

    def __init__(self, model: BetzTrackingNoise, streams: Streams, cn0_dbhz: float) -> None:
        self._sigmas = (
            model.code_sigma_m(cn0_dbhz),
            model.carrier_sigma_m(cn0_dbhz),
            model.doppler_sigma_hz(cn0_dbhz),
        )
        bandwidths = (model.loop_bandwidth_hz, model.pll_bandwidth_hz, model.fll_bandwidth_hz)
        self._noises = tuple(
            GaussMarkovProcess(streams(f"tracking.{name}"), 1 / (4 * bandwidth))
            for name, bandwidth in zip(("code", "carrier", "doppler"), bandwidths, strict=True)
        )

    def advance(
        self, times_s: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return errors of pseudorange in m, carrier phase in m and Doppler in Hz at later times."""
        code, carrier, doppler = (
            sigma * noise.advance(times_s) for sigma, noise in zip(self._sigmas, self._noises, strict=True)
        )
        return code, carrier, doppler


def noise_growth(
    model: TrackingModel, nominal_dbhz: float, gain_db: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the factors by which code and Doppler noise change if the C/N0 is `gain_db` above the nominal C/N0.

    Between whole dB the logarithms of the factors are interpolated, with a relative error of the factors below 1e-3.
    """
    low, high = math.floor(np.min(gain_db, initial=0.0)), math.ceil(np.max(gain_db, initial=0.0))
    grid_db = np.arange(low, high + 1)
    at_grid = np.log([_sigmas(model, nominal_dbhz + gain) for gain in range(low, high + 1)])
    growth = at_grid - np.log(_sigmas(model, nominal_dbhz))
    return np.exp(np.interp(gain_db, grid_db, growth[:, 0])), np.exp(np.interp(gain_db, grid_db, growth[:, 1]))


@lru_cache(maxsize=10_000)
def _sigmas(model: TrackingModel, cn0_dbhz: float) -> tuple[float, float]:
    """Return the standard deviations of the pseudorange in m and of the Doppler in Hz."""
    return model.code_sigma_m(cn0_dbhz), model.doppler_sigma_hz(cn0_dbhz)
