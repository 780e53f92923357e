"""Decide whether samples were provably received before the key of their RECS was on air [WFO, Sec. III-D].

After the disclosure of a key, anybody can make the chips of the RECS of this key. So a correlation with these chips is
evidence of the true signal only if the correlated samples end early enough. The time from the last correlated sample to
the disclosure must be longer than the possible error of the receiver's clock. Only `provably_before_disclosure` makes
this decision, for one snapshot and for arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np
from jaxtyping import Bool, Float

from vestige.constants import SUBFRAME_S
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
    """Return whether samples were provably received before the key of their RECS was on air.

    The function raises `VestigeError` if `time_uncertainty_s` is negative or NaN.

    Parameters
    ----------
    lead_s
        Time from the end of the correlated samples to the disclosure of the key, on the receiver's clock, in s.
    time_uncertainty_s
        Upper limit of the error of the receiver's clock in s, 0 or more. If the limit is unknown, the value is infinite
        and no reception is provable.
    """
    if isinstance(time_uncertainty_s, np.ndarray):
        require_time_uncertainty(float(np.min(time_uncertainty_s, initial=np.inf)))
    else:
        require_time_uncertainty(time_uncertainty_s)
    return lead_s > time_uncertainty_s


def tags_prove_data(time_uncertainty_s: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return whether verified tags prove navigation data, for each upper limit of the receiver clock's error in s.

    A tag is sent at least a subframe before the key of the tag. If the receiver clock may be wrong by a subframe or
    more, somebody may have made a tag of ADKD 0 or 4 after the disclosure of its key [OSNMA-RG].
    """
    return provably_before_disclosure(np.full(time_uncertainty_s.shape, float(SUBFRAME_S)), time_uncertainty_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceptionProof:
    """Times of a RECS and its key, which decide whether an arrival of the RECS was before the disclosure of the key."""

    disclosed_at: GalileoTime  # time at which the first bit of the key was on air
    duration_s: float  # length of the RECS in s
    time_uncertainty_s: float  # upper limit of the error of the receiver's clock in s; infinite if unknown
    # time in s by which the time tags of the samples are behind the receiver's clock, 0 or more
    labels_behind_s: float = 0.0

    def holds(self, start: GalileoTime) -> bool:
        """Return whether a RECS was provably received before the disclosure of its key.

        `start` is the time tag of the first chip of the RECS.
        """
        end = start + (self.duration_s + self.labels_behind_s)
        return provably_before_disclosure(self.disclosed_at - end, self.time_uncertainty_s)
