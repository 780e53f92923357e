"""Decide whether samples were provably received before the key of their RECS was on air [WFO, Sec. III-D].

From the first bit of a key on, anybody can make the chips of its RECS. So a correlation is a proof only if the
correlated samples end before the disclosure by more than the possible error of the receiver's clock. Only
`provably_before_disclosure` makes this decision, for one snapshot and for arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np
from jaxtyping import Bool, Float

from vestige.time import GalileoTime
from vestige.valid_numbers import require_time_uncertainty


@overload
def provably_before_disclosure(lead_s: float, time_uncertainty_s: float) -> bool: ...
@overload
def provably_before_disclosure(
    lead_s: Float[np.ndarray, "*n"], time_uncertainty_s: float | Float[np.ndarray, "*#n"]
) -> Bool[np.ndarray, "*n"]: ...
def provably_before_disclosure(
    lead_s: float | Float[np.ndarray, "*n"], time_uncertainty_s: float | Float[np.ndarray, "*#n"]
) -> bool | Bool[np.ndarray, "*n"]:
    """Return whether samples were provably received before their key was on air.

    Raises `VestigeError` if the upper limit is negative or NaN.

    Parameters
    ----------
    lead_s
        Time from the end of the correlated samples to the disclosure of the key, on the receiver's clock, in s.
    time_uncertainty_s
        Upper limit of the error of that clock in s, 0 or more; infinite if unknown, so that no reception is provable.
    """
    if isinstance(time_uncertainty_s, np.ndarray):
        require_time_uncertainty(float(np.min(time_uncertainty_s, initial=np.inf)))
    else:
        require_time_uncertainty(time_uncertainty_s)
    return lead_s > time_uncertainty_s


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceptionProof:
    """Proof for a RECS: which of its arrivals happened before the disclosure of its key."""

    disclosed_at: GalileoTime  # time at which the first bit of the key was on air
    duration_s: float  # length of the RECS in s
    time_uncertainty_s: float  # upper limit of the error of the receiver's clock in s; infinite if unknown
    # delay of the samples' time tags behind that clock in s, 0 or more
    labels_behind_s: float = 0.0

    def holds(self, start: GalileoTime) -> bool:
        """Return whether a RECS with its first chip at a time tag was completely received before the disclosure."""
        end = start + (self.duration_s + self.labels_behind_s)
        return provably_before_disclosure(self.disclosed_at - end, self.time_uncertainty_s)
