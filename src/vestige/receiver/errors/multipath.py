"""Simulate multipath by a few reflections with delay, strength, phase and lifetime [WFO, Sec. V].

Theory of operation
-------------------
    y(t) = x(t) + Σ_i a_i e^{jφ_i(t)} x(t − τ_i)

* The excess delay τ has an exponential distribution of mean μ, cut at a largest delay (by default 500 ns).
* The strength has a Rayleigh distribution with the mean square 10^(G/10)/N, where G = G0 − s τ in dB. N is the number
  of reflections, or the mean of the Poisson distribution. So for s = 0, G0 is the mean power of all reflections
  together relative to the line of sight. The mean power is lower if a maximum cuts the Poisson distribution.
* The phase is uniform at first, and then changes with the Doppler f_i = (v/λ) cos ψ_i. The angle ψ_i is uniform, and v
  is the receiver's speed.
* The lifetime is exponential, so a reflection ends in a step dt with probability 1 − e^{−r dt}, whatever its age. The
  rate is r = v/L + 1/T for a mean lifetime of L metres of travel or T seconds. When a reflection ends, a new,
  independent reflection begins.
* The number of reflections is fixed, or has a Poisson distribution with a maximum. A new number of reflections is drawn
  at the rate r.

A reflection has the same strength on E1 and E6, but different phases. At first the phases differ by (f1 − f6) τ cycles,
which is about one cycle for each metre of excess delay. So the multipath errors of E1 and E6 are practically
independent.

The distributions above are the marginal distributions of the measured land-mobile channel [STEINGASS04] [ITU-P681]. The
houses and trees of the channel's model are left out. The power of the preset `elevation-5-30` is calibrated to the 52
misses in 100,000 epochs of [WFO, Sec. VI-A].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf
from types import MappingProxyType
from typing import Literal

import numpy as np
from jaxtyping import Complex128, Float

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.elevation_model import (
    HIGH_DEG,
    OPEN_SKY_DB,
    REFERENCE_MULTIPATH_DB,
    multipath_power_db,
)
from vestige.receiver.errors.error_process import Streams, steps_s

MAX_EXCESS_M = SPEED_OF_LIGHT_MPS * 500e-9  # largest excess delay of the measured channel [STEINGASS04]
MAX_RAYS, MAX_POWER_DB = 10_000, 60.0


@dataclass(frozen=True, kw_only=True)
class RayBlock:
    """The reflections of a block of epochs, all relative to the line of sight.

    Attributes
    ----------
    delay_m
        Excess delay in m, at least 0.
    amplitude, amplitude_e1
        Complex amplitude on E6 and on E1, relative to the line of sight; 0 if there is no reflection.
    doppler_hz
        Doppler on E6 in Hz; the Doppler on E1 is f1/f6 times as large.
    """

    delay_m: Float[np.ndarray, "n n_rays"]
    amplitude: Complex128[np.ndarray, "n n_rays"]
    amplitude_e1: Complex128[np.ndarray, "n n_rays"]
    doppler_hz: Float[np.ndarray, "n n_rays"]

    @cached_property
    def with_line_of_sight(self) -> RayBlock:
        """Block with the line of sight as path 0, and the reflections as the other paths."""
        zero = np.zeros((self.delay_m.shape[0], 1))
        return RayBlock(
            delay_m=np.concatenate([zero, self.delay_m], axis=1),
            amplitude=np.concatenate([zero + 1.0, self.amplitude], axis=1),
            amplitude_e1=np.concatenate([zero + 1.0, self.amplitude_e1], axis=1),
            doppler_hz=np.concatenate([zero, self.doppler_hz], axis=1),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LmsLiteMultipath:
    """Multipath model of reflections that begin and end.

    A lifetime of 0 makes every epoch independent. A reflection whose phase changes by f T cycles in the integration
    time T is weaker by the factor sinc(f T). So at 10 m/s a correlation over 16 ms of E6 contains on average half of
    the multipath power, and at 20 m/s a quarter.

    Attributes
    ----------
    power_db
        G0, mean power of all reflections together for s = 0, in dB relative to the line of sight; −inf for no
        multipath.
    mean_excess_m
        μ, mean excess delay in m before the cut at `max_excess_m`.
    n_rays
        Number of reflections, or the largest number if `mean_rays` is given.
    mean_rays
        Mean of the Poisson number of reflections; None for the fixed number `n_rays`.
    slope_db_per_us
        s, loss with delay in dB/µs.
    max_excess_m
        Largest excess delay in m.
    speed_mps
        v, speed of the receiver in m/s.
    mean_life_m, mean_life_s
        L and T, mean lifetime of a reflection in m of travel and in s.
    """

    power_db: float
    mean_excess_m: float
    n_rays: int = 1
    mean_rays: float | None = None
    slope_db_per_us: float = 0.0
    max_excess_m: float = MAX_EXCESS_M
    speed_mps: float = 1.0
    mean_life_m: float = 3.0
    mean_life_s: float = inf
    kind: Literal["lms-lite"] = "lms-lite"

    def __post_init__(self) -> None:
        if self.n_rays > MAX_RAYS or (self.mean_rays or 0.0) > MAX_RAYS or self.power_db > MAX_POWER_DB:
            raise ValueError(f"at most {MAX_RAYS} reflections and {MAX_POWER_DB:g} dB")
        if self.n_rays < 1 or (self.mean_rays is not None and not self.mean_rays > 0):
            raise ValueError("there must be at least one reflection; for no multipath the power is -inf dB")
        if not self.slope_db_per_us >= 0:
            raise ValueError("a loss with delay that is not negative, because later reflections are not stronger")
        if not (self.mean_excess_m > 0 and self.max_excess_m > 0):
            raise ValueError("a positive mean and a positive largest excess delay")
        if not (self.speed_mps >= 0 and self.mean_life_m >= 0 and self.mean_life_s >= 0):
            raise ValueError("a speed and a life that are not negative")
        if self.mean_life_m == 0 and 0 < self.mean_life_s < inf:
            raise ValueError("with mean_life_m = 0 every epoch has its own reflections, so mean_life_s has no effect")

    @classmethod
    def elevation_5_30(cls) -> LmsLiteMultipath:
        """Return the multipath of low satellites as in [WFO, Sec. VI-A], with a new reflection in each epoch."""
        return cls(power_db=REFERENCE_MULTIPATH_DB, mean_excess_m=40.0, mean_life_m=0.0)

    @classmethod
    def open_sky(cls) -> LmsLiteMultipath:
        """Return the multipath of a satellite above 30°, whose reflections are weaker and less delayed."""
        return cls(power_db=OPEN_SKY_DB, mean_excess_m=20.0, mean_life_m=0.0)

    @classmethod
    def at_elevation(cls, elevation_deg: float) -> LmsLiteMultipath:
        """Return multipath whose power falls linearly from −14 dB at 5° to −18 dB at 30°; `open_sky` above 30°."""
        if elevation_deg > HIGH_DEG:
            return cls.open_sky()
        power_db = float(multipath_power_db(np.array([elevation_deg], np.float64))[0])
        return cls(power_db=power_db, mean_excess_m=40.0, mean_life_m=0.0)

    @property
    def death_rate_hz(self) -> float:
        """Rate r at which a reflection ends, in 1/s; infinite if each epoch has its own reflections."""
        if self.mean_life_m == 0 or self.mean_life_s == 0:
            return inf
        return self.speed_mps / self.mean_life_m + 1 / self.mean_life_s

    def process(self, streams: Streams) -> MultipathProcess:
        """Return a realisation for one satellite from its streams."""
        return MultipathProcess(self, streams)


# multipath presets by their names in a scenario file
MULTIPATH_PRESETS: Mapping[str, Callable[[], LmsLiteMultipath]] = MappingProxyType(
    {"elevation-5-30": LmsLiteMultipath.elevation_5_30, "open-sky": LmsLiteMultipath.open_sky}
)


class _Renewal:
    """Independent values, each of which is replaced by a new value after a random lifetime."""

    def __init__(self, rng: np.random.Generator, rate_hz: float) -> None:
        self._rng, self._rate_hz = rng, rate_hz
        self._held: Float[np.ndarray, "n_values width"] | None = None

    def advance(
        self, steps: Float[np.ndarray, " n"], candidates: Float[np.ndarray, "n_values n width"]
    ) -> Float[np.ndarray, "n_values n width"]:
        """Return the values at each epoch, which are the candidates of the last epoch at which the values changed.

        Parameters
        ----------
        steps
            Time since the previous epoch, in s.
        candidates
            New values at each epoch, used if the values change at this epoch. The values along the first axis change
            together.
        """
        n, width = candidates.shape[1:]
        lives = self._rng.standard_exponential((n, width))
        fresh = lives < self._rate_hz * steps[:, None] if np.isfinite(self._rate_hz) else np.ones((n, width), bool)
        if self._held is None:
            self._held = candidates[:, 0]
        known = np.concatenate((self._held[:, None], candidates), axis=1)
        last = np.maximum.accumulate(np.where(fresh, np.arange(1, n + 1)[:, None], 0), axis=0)
        values = known[:, last, np.arange(width)]
        self._held = values[:, -1]
        return values


class MultipathProcess:
    """One realisation of an `LmsLiteMultipath`."""

    def __init__(self, model: LmsLiteMultipath, streams: Streams) -> None:
        self._model = model
        names = ("delay", "power", "phase", "direction", "count")
        self._rng = {name: streams(f"multipath.{name}") for name in names}
        self._rays = _Renewal(streams("multipath.life"), model.death_rate_hz)
        self._count = _Renewal(streams("multipath.count_life"), model.death_rate_hz)
        self._last_s: float | None = None

    def advance(self, times_s: Float[np.ndarray, " n"]) -> RayBlock:
        """Return the reflections at later times.

        Parameters
        ----------
        times_s
            Times in s after the scenario's start, ascending.
        """
        model = self._model
        shape = (times_s.size, model.n_rays)
        if times_s.size == 0:
            nothing = np.zeros(shape)
            return RayBlock(delay_m=nothing, amplitude=nothing + 0j, amplitude_e1=nothing + 0j, doppler_hz=nothing)
        steps = steps_s(self._last_s, times_s)
        self._last_s = float(times_s[-1])
        kept = -np.expm1(-model.max_excess_m / model.mean_excess_m)
        candidates = np.stack(
            (
                -model.mean_excess_m * np.log1p(-kept * self._rng["delay"].random(shape)),
                self._rng["power"].standard_exponential(shape),
                self._rng["phase"].random(shape),
                self._rng["direction"].random(shape),
                np.broadcast_to(times_s[:, None], shape),
            )
        )
        delay_m, strength, cycles, direction, born_s = self._rays.advance(steps, candidates)
        doppler_hz = model.speed_mps * E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * np.cos(2 * np.pi * direction)
        mean = 10 ** ((model.power_db - model.slope_db_per_us * delay_m / (SPEED_OF_LIGHT_MPS * 1e-6)) / 10)
        magnitude = np.sqrt(strength * mean / (model.mean_rays or model.n_rays)) * self._present(steps)
        turned = doppler_hz * (times_s[:, None] - born_s)
        apart = (E1_CARRIER_HZ - E6_CARRIER_HZ) / SPEED_OF_LIGHT_MPS * delay_m
        return RayBlock(
            delay_m=delay_m,
            amplitude=magnitude * _phasor(cycles + turned),
            amplitude_e1=magnitude * _phasor(cycles - apart + turned * (E1_CARRIER_HZ / E6_CARRIER_HZ)),
            doppler_hz=doppler_hz,
        )

    def _present(self, steps: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n n_rays"]:
        """Return 1 for the reflections that are present at an epoch, and 0 for all other reflections."""
        model = self._model
        if model.mean_rays is None:
            return np.ones((steps.size, model.n_rays))
        numbers = self._rng["count"].poisson(model.mean_rays, (1, steps.size, 1)).astype(np.float64)
        return (np.arange(model.n_rays) < self._count.advance(steps, numbers)[0]).astype(np.float64)


def _phasor(cycles: Float[np.ndarray, "n n_rays"]) -> Complex128[np.ndarray, "n n_rays"]:
    """Return e^{j2πx}, where x is `cycles`."""
    return np.exp(2j * np.pi * (cycles - np.floor(cycles)))
