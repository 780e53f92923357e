"""Compute the error budget of the range check: the errors of E6 range and E1 prediction without an attack.

The range offset of a true signal is the sum of independent errors. The range check passes if the magnitude of the
range offset is at most κ times the standard deviation of this sum [TAES2023, Eq. 21-24]:

    authentic if  |τ_E6 − τ_E6,predicted| ≤ κ σ_auth
    σ_auth² = σ_HWB² + σ_BGD² + (γ−1)² σ_I,E1² + σ_MP,E1² + σ_MP,E6² + σ_n,E1² + σ_n,E6²,    γ = (f1/f6)²

The module `thermal_noise` computes σ_n,E1 and σ_n,E6 for a given C/N0 and front end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from vestige.constants import GAMMA_E1_E6


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorBudget:
    """Standard deviations of the errors between the E6 range and its prediction, all in m.

    Attributes
    ----------
    hardware_m
        σ_HWB: error of the receiver's delay between E1 and E6 after calibration.
    group_delay_m
        σ_BGD: error of the broadcast group delay after correction.
    ionosphere_e1_m
        σ_I,E1: error of the ionospheric delay *on E1* after correction. The difference between the delays on E6 and E1
        has an error of γ−1 = 0.518 times the error on E1.
    multipath_e1_m, multipath_e6_m
        σ_MP,E1 and σ_MP,E6: error by code multipath.
    noise_e1_m, noise_e6_m
        σ_n,E1 and σ_n,E6: thermal noise of the E1 pseudorange and of the E6 snapshot.

    Examples
    --------
    >>> import vestige as vs
    >>> budget = vs.ErrorBudget.uncorrected()
    >>> round(budget.sigma_m, 2), round(budget.limit_m(kappa=3.0), 1)
    (8.85, 26.6)
    """

    hardware_m: float
    group_delay_m: float
    ionosphere_e1_m: float
    multipath_e1_m: float
    multipath_e6_m: float
    noise_e1_m: float
    noise_e6_m: float

    @classmethod
    def uncorrected(cls) -> ErrorBudget:
        """Return the budget without ionosphere model and without group delay file [SASLIB]; σ_auth is 8.85 m."""
        return cls(
            hardware_m=0.0,
            group_delay_m=1.5,
            ionosphere_e1_m=15.0,
            multipath_e1_m=3.0,
            multipath_e6_m=0.6,
            noise_e1_m=0.4,  # noise of tracking at 37 dBHz; 3 to 5 m if E1 is measured in a snapshot too
            noise_e6_m=2.5,
        )

    @classmethod
    def corrected(cls) -> ErrorBudget:
        """Return the budget with ionosphere model (NeQuick-G) and group delay file [SASLIB]; σ_auth is 4.37 m."""
        return replace(cls.uncorrected(), group_delay_m=0.0, ionosphere_e1_m=3.5)

    @property
    def sigma_m(self) -> float:
        """σ_auth, standard deviation of the range offset without an attack, in m."""
        return math.hypot(
            self.hardware_m,
            self.group_delay_m,
            (GAMMA_E1_E6 - 1) * self.ionosphere_e1_m,
            self.multipath_e1_m,
            self.multipath_e6_m,
            self.noise_e1_m,
            self.noise_e6_m,
        )

    def limit_m(self, kappa: float = 3.0) -> float:
        """Return κ σ_auth, the largest range offset in m that passes."""
        return kappa * self.sigma_m
