"""Simulate the residual of a receiver's ionosphere model in E6 − E1 by a Gaussian core with exponential tails.

Theory of operation
-------------------
The residual e has a mixture of three distributions. With probability 1 − p the residual e comes from N(0, σ). With
probability p s the residual e comes from the late tail u + Exp(β), where E6 arrives later than the model predicts. With
probability p (1 − s) the residual e comes from the early tail −(u + Exp(β)). For large x, e exceeds x with the
probability

    P(e > x) = ps · e^{−(x−u)/β}

The tail is a straight line in a logarithmic histogram, like the right flank in [WFO, Sec. VI-A]. One Gaussian z per
epoch gives the value through the inverse distribution function, e = F⁻¹(Φ(z)). So e has the distribution F for any
correlation of z in time.

* `iid`: all epochs are independent, which suits histograms.
* `gauss-markov`: z is a Gauss-Markov process with τ = 2 h, the decorrelation time along a Galileo pass. A campaign of
  100,000 s has only about 14 independent values. In a second z changes by 1.7 % of its standard deviation. For
  σ = 1.24 m the residual changes by 2 cm in a second, about half a radian of the E6 carrier. So carrier phases need
  `smooth`.
* `smooth`: z is a Gauss-Markov process of second order with τ = 2 h, so z has a rate. In a second z changes by 0.03 %
  of its standard deviation. For σ = 1.24 m the residual changes by 0.4 mm in a second, so E6 carrier phases can be
  compared with E1 carrier phases.

A broadcast model corrects about 70 % of the delay [ROVIRA16]. The presets are fitted to the difference between two
broadcast models, NeQuick-G and NTCM-G, over latitudes within ±70°, times of day and seasons. Each tail of the
difference has a probability of 5 %. In a strong ionosphere a broadcast model usually underestimates the delay, as the
paper's histogram shows. So the preset 2014-late keeps the late tail and gives the 5 % of the early tail to the core. 1
TECU is 0.0841 m of E6 − E1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr, ndtri

from vestige.receiver.errors.error_process import Streams
from vestige.receiver.errors.gauss_markov import GaussMarkovProcess, SmoothGaussMarkovProcess

Correlation = Literal["iid", "gauss-markov", "smooth"]
PASS_TAU_S = 7200.0  # the correlation of NeQuick-G minus NTCM-G falls to 1/e in 110 min along Galileo passes

_HALVINGS = 52  # number of halvings of an interval, down to the last bit of a float64


@dataclass(frozen=True, slots=True, kw_only=True)
class HeavyTailedIonosphere:
    """Ionosphere residual with a Gaussian core and two exponential tails.

    Attributes
    ----------
    core_sigma_m
        σ, standard deviation of the core in m.
    tail_start_m, tail_scale_m
        u and β, start and scale of the tails in m.
    tail_probability
        p, probability of both tails together.
    late_tail_share
        s, share of p in the late tail, 0 to 1. With 0.5 the tails are symmetric, and with 1 there is no early tail.
    truncated
        Whether the core is cut at ±u, so that P(|e| > u) is exactly p. A core that is not cut also reaches beyond u.
    correlation
        Correlation of z in time: `iid`, `gauss-markov` or `smooth`.
    tau_s
        Correlation time τ of z in s.
    code_only
        Whether the residual delays the codes and has no effect on the carriers. A real ionosphere advances the
        carriers. With `iid`, however, the draws are independent, so the carriers would jump by several cycles from
        epoch to epoch.
    """

    core_sigma_m: float
    tail_start_m: float
    tail_scale_m: float
    tail_probability: float = 0.1
    late_tail_share: float = 0.5
    truncated: bool = False
    correlation: Correlation = "iid"
    tau_s: float = PASS_TAU_S
    code_only: bool = False
    kind: Literal["heavy-tailed"] = "heavy-tailed"

    def __post_init__(self) -> None:
        if not (self.core_sigma_m >= 0 and self.tail_start_m >= 0 and self.tail_scale_m >= 0):
            raise ValueError("widths of the core and of the tails that are not negative")
        if not 0 <= self.tail_probability <= 1:
            raise ValueError(f"the probability of the tails is not in [0, 1]: {self.tail_probability}")
        if not 0 <= self.late_tail_share <= 1:
            raise ValueError(f"the share of the late tail is not in [0, 1]: {self.late_tail_share}")

    @classmethod
    def solar_maximum_2014(cls) -> HeavyTailedIonosphere:
        """Return the model for 2014 and elevations of 5 to 30°: rms 1.73 m, P(e > 10 m) = P(e < −10 m) ≈ 1e-4."""
        return cls(core_sigma_m=1.24, tail_start_m=2.65, tail_scale_m=1.17)

    @classmethod
    def solar_maximum_2014_late(cls) -> HeavyTailedIonosphere:
        """Return the model for 2014 without the early tail, because the paper's histogram has a higher right flank."""
        both = cls.solar_maximum_2014()
        return replace(both, tail_probability=both.tail_probability / 2, late_tail_share=1.0)

    @classmethod
    def average_2017(cls) -> HeavyTailedIonosphere:
        """Return the model for 2017 and elevations of 5 to 30°: rms 1.06 m."""
        return cls(core_sigma_m=0.76, tail_start_m=1.55, tail_scale_m=0.78)

    @classmethod
    def solar_maximum_2014_high(cls) -> HeavyTailedIonosphere:
        """Return the model for 2014 and elevations of 30 to 90°: rms 1.0 m."""
        return cls(core_sigma_m=0.72, tail_start_m=1.51, tail_scale_m=0.70)

    @classmethod
    def average_2017_high(cls) -> HeavyTailedIonosphere:
        """Return the model for 2017 and elevations of 30 to 90°: rms 0.63 m."""
        return cls(core_sigma_m=0.44, tail_start_m=0.95, tail_scale_m=0.46)

    def exceedance(self, x_m: Float[np.ndarray, " n"], *, late: bool = True) -> Float[np.ndarray, " n"]:
        """Return P(e > x), or on the early side P(e < −x), for each x ≥ 0 in m."""
        u, beta = self.tail_start_m, self.tail_scale_m
        beyond = np.maximum(x_m - u, 0.0)
        falling = np.exp(-beyond / beta) if beta > 0 else (beyond == 0) * 1.0
        return (1 - self.tail_probability) * self._core_exceedance(x_m) + self._tail(late=late) * falling

    def quantile(self, z: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return F⁻¹(Φ(z)) in m for each Gaussian z.

        Each side is inverted from its own small probability, Φ(−z) or Φ(z), so the far tails keep their precision.
        """
        late, early = ndtr(-z), ndtr(z)
        on_late_side = late <= 0.5 * (1 - self.tail_probability) + self._tail(late=True)
        found = np.zeros_like(late)
        found[on_late_side] = self._side(late[on_late_side], late=True)
        found[~on_late_side] = -self._side(early[~on_late_side], late=False)
        return found

    def _tail(self, *, late: bool) -> float:
        """Return the probability of the late or of the early tail."""
        return self.tail_probability * (self.late_tail_share if late else 1 - self.late_tail_share)

    def _side(self, upper: Float[np.ndarray, " n"], *, late: bool) -> Float[np.ndarray, " n"]:
        """Return the x ≥ 0 that the residual exceeds on one side with the probability `upper`."""
        p, u, tail = self.tail_probability, self.tail_start_m, self._tail(late=late)
        core_end = (1 - p) * float(self._core_exceedance(np.array([u]))[0]) + tail
        size = np.zeros_like(upper)
        inner = upper > core_end
        size[inner] = self._core_quantile((upper[inner] - tail) / (1 - p)) if p < 1 else 0.0
        size[~inner] = self._tail_quantile(upper[~inner], late=late)
        return size

    def process(self, streams: Streams) -> IonosphereProcess:
        """Return a realisation for one satellite from its streams."""
        return IonosphereProcess(self.quantile, self.correlation, self.tau_s, streams)

    def _core_exceedance(self, x_m: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return P(core > x) for x ≥ 0."""
        sigma = self.core_sigma_m
        if sigma == 0:
            return np.where(x_m == 0, 0.5, 0.0)
        if not self.truncated:
            return ndtr(-x_m / sigma)
        cut = float(ndtr(-self.tail_start_m / sigma))
        return np.maximum(ndtr(-x_m / sigma) - cut, 0.0) / (1 - 2 * cut) if cut < 0.5 else np.zeros_like(x_m)

    def _core_quantile(self, upper: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return x with P(core > x) = `upper` ≤ 1/2."""
        if self.core_sigma_m == 0:
            return np.zeros_like(upper)
        if self.truncated:
            cut = float(ndtr(-self.tail_start_m / self.core_sigma_m))
            upper = cut + upper * (1 - 2 * cut)
        return np.maximum(-self.core_sigma_m * ndtri(np.minimum(upper, 0.5)), 0.0)

    def _tail_quantile(self, upper: Float[np.ndarray, " n"], *, late: bool) -> Float[np.ndarray, " n"]:
        """Return the x ≥ u that the residual exceeds with the probability `upper`.

        The value of x is found by bisection if the core reaches beyond u.
        """
        tail = self._tail(late=late)
        p, u, beta, sigma = self.tail_probability, self.tail_start_m, self.tail_scale_m, self.core_sigma_m
        if self.truncated or sigma == 0 or p == 1:
            return u + beta * np.log(np.maximum(tail / upper, 1.0))
        # Above `high` each of the two terms of `exceedance` is at most half of `upper`.
        low = np.full_like(upper, u)
        high = np.maximum(
            u + beta * np.log(np.maximum(2 * tail / upper, 1.0)), -sigma * ndtri(np.minimum(upper / (2 * (1 - p)), 0.5))
        )
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            further = self.exceedance(middle, late=late) > upper
            low, high = np.where(further, middle, low), np.where(further, high, middle)
        return 0.5 * (low + high)


# ionosphere presets by their names in a scenario file
IONOSPHERE_PRESETS: Mapping[str, Callable[[], HeavyTailedIonosphere]] = MappingProxyType(
    {
        "2014": HeavyTailedIonosphere.solar_maximum_2014,
        "2014-late": HeavyTailedIonosphere.solar_maximum_2014_late,
        "2017": HeavyTailedIonosphere.average_2017,
        "2014-high": HeavyTailedIonosphere.solar_maximum_2014_high,
        "2017-high": HeavyTailedIonosphere.average_2017_high,
    }
)


class IonosphereProcess:
    """One realisation of the ionosphere residual of one satellite."""

    def __init__(
        self,
        quantile: Callable[[Float[np.ndarray, " n"]], Float[np.ndarray, " n"]],
        correlation: Correlation,
        tau_s: float,
        streams: Streams,
    ) -> None:
        self._quantile = quantile
        self._tau_s = 0.0 if correlation == "iid" else tau_s
        smooth = correlation == "smooth" and tau_s > 0
        self._kind = SmoothGaussMarkovProcess if smooth else GaussMarkovProcess
        self._z = self._kind(streams("ionosphere"), self._tau_s)
        self._common: GaussMarkovProcess | SmoothGaussMarkovProcess | None = None
        self._share = 0.0

    def shared(self, receiver: Streams, share: float) -> IonosphereProcess:
        """Take a share of the variance of z from the receiver's streams, and return the realisation."""
        self._common, self._share = self._kind(receiver("ionosphere"), self._tau_s), share
        return self

    def advance(self, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the differential residual E6 − E1 in m at later times."""
        z = self._z.advance(times_s)
        if self._common is not None:
            z = np.sqrt(self._share) * self._common.advance(times_s) + np.sqrt(1 - self._share) * z
        return self._quantile(z)
