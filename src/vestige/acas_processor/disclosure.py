"""The rule that makes delayed disclosure safe: samples must be provably older than the key that decrypts their RECS.

It stands here and nowhere else.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from vestige.records.times import GalileoTimes


def provably_secret(
    disclosed: GalileoTimes, received_at: GalileoTimes, time_uncertainty_s: Float[np.ndarray, "*#n"]
) -> Bool[np.ndarray, "*n"]:
    """Return whether samples were provably received before a key was on air.

    Parameters
    ----------
    disclosed
        When the first bit of the key is on air.
    received_at
        Receiver-clock time of the last sample.
    time_uncertainty_s
        Upper limit of the clock's error; an infinite one proves nothing.
    """
    return disclosed - received_at > time_uncertainty_s
