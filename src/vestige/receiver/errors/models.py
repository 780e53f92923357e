"""All error models of the receiver, as a table; tests hold the same laws for each of them.

| model | of | error |
|---|---|---|
| `TwoStateClock` | the receiver | clock bias and drift |
| `HeavyTailedIonosphere`, `EmpiricalIonosphere` | a satellite | differential ionosphere E6 − E1 |
| `LmsLiteMultipath` | a satellite | rays on E6 and E1; range error on E1: `e1_multipath.py` |
| `BetzTrackingNoise` | a satellite | noise of pseudorange, carrier phase and Doppler on E1 |
| `BiasResiduals` | both | group delay of the satellite, hardware of the receiver |

Left out, with the reason: troposphere, orbit, satellite clock (common to E1 and E6, they cancel).
"""

from __future__ import annotations

from vestige.receiver.errors.bias import BiasResiduals
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.empirical_ionosphere import EmpiricalIonosphere
from vestige.receiver.errors.ionosphere import HeavyTailedIonosphere
from vestige.receiver.errors.multipath import LmsLiteMultipath
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise

ALL_MODELS = (
    TwoStateClock,
    HeavyTailedIonosphere,
    EmpiricalIonosphere,
    LmsLiteMultipath,
    BetzTrackingNoise,
    BiasResiduals,
)
