"""Simulate the delays between E1 and E6 that remain after calibration [WFO, Sec. II-B].

    b(t) = b_BGD + b_HW + r_HW t

b_BGD belongs to the satellite, and is constant over the campaign. b_BGD is γ − 1 times the residual of the broadcast
group delay, where γ = (f1/f6)². b_HW belongs to the receiver and is common to all satellites. The temperature of the
front ends causes the drift r_HW of b_HW. b_BGD, b_HW and r_HW are drawn once and are Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.receiver.errors.error_process import Streams


@dataclass(frozen=True, slots=True, kw_only=True)
class BiasResiduals:
    """Gaussian residuals of group delay and hardware delay; by default all are 0, as after calibration.

    Without calibration the standard deviation of the hardware delay is about 3 m [WFO, Sec. II-B]. Without a group
    delay file the standard deviation of BGD is 1.5 m [SASLIB].

    Attributes
    ----------
    bgd_sigma_m
        Standard deviation in m of the residual of a satellite's group delay in the range E6 − E1.
    hardware_sigma_m
        Standard deviation in m of the receiver's delay E6 − E1.
    hardware_drift_mps
        Standard deviation in m/s of the rate of the receiver's delay E6 − E1.
    """

    bgd_sigma_m: float = 0.0
    hardware_sigma_m: float = 0.0
    hardware_drift_mps: float = 0.0
    kind: Literal["bias"] = "bias"

    def __post_init__(self) -> None:
        if not (self.bgd_sigma_m >= 0 and self.hardware_sigma_m >= 0 and self.hardware_drift_mps >= 0):
            raise ValueError("standard deviations that are not negative")

    def process(self, streams: Streams, *, receiver: Streams) -> BiasProcess:
        """Return a realisation for one satellite, from the streams of the satellite and of the receiver."""
        return BiasProcess(
            satellite_m=self.bgd_sigma_m * streams("bias.group_delay").standard_normal(),
            hardware_m=self.hardware_sigma_m * receiver("bias.hardware").standard_normal(),
            drift_mps=self.hardware_drift_mps * receiver("bias.drift").standard_normal(),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BiasProcess:
    """One realisation of `BiasResiduals`."""

    satellite_m: float
    hardware_m: float
    drift_mps: float

    def advance(self, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return b(t) in m, a part of the delay E6 − E1."""
        return self.satellite_m + (self.hardware_m + self.drift_mps * times_s)
