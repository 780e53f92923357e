"""Compute the position of the signal between taps: the root of the s-curve by linear interpolation [WFO, Sec. III-C].

Theory of operation
-------------------
The early, punctual and late taps have the magnitudes c_e, c_p and c_l, and a distance Δ from tap to tap. The early and
the late tap are called outer taps. The punctual tap and the lower outer tap lie on the same flank of the correlation
and give the slope of this flank. Two lines meet at the peak: the line with this slope through c_p, and the line with
the opposite slope through the higher outer tap. With c_max the larger and c_min the smaller of c_e and c_l, the
position of the peak is

    τ = τ_p + sgn(c_l − c_e) · ½ · (c_max − c_min)/(c_p − c_min) · Δ

Let all three taps lie on a triangle with flanks of slope a per metre. Let the peak be later than the punctual tap by δ.
Then c_p = 1 − aδ, c_l = 1 − a(Δ−δ), and c_e = 1 − a(Δ+δ). So c_l − c_e is 2aδ, and c_p − c_e is aΔ. Therefore δ is
½ Δ (c_l − c_e)/(c_p − c_e), as in the formula for τ.

The formula is exact for an unfiltered signal without noise if |δ| ≤ Δ/2 and Δ + |δ| is at most one chip. So for Δ ≤ 2/3
chip the formula is exact for every |δ| ≤ Δ/2.

[WFO] prints the formula without the ½ and the sign, which gives |2δ|. The results of [WFO] were computed with the ½ and
the sign. The evidence is the cluster of early detections at −30 m + ½·15 m = −22.5 m.

The distance |τ − τ_p| never exceeds Δ/2. The outer taps are n taps from the punctual tap, so the first n and the last n
taps of the bank of correlators are never punctual. With the maximum detector, only an outer tap among the first n or
the last n taps can be higher than the punctual tap. If the higher outer tap is higher than the punctual tap, τ is the
middle between these two taps. If the outer taps are equal, τ is τ_p.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

_EQUIDISTANT = 1e-6  # relative tolerance of the distances between taps


def range_offset_m(
    magnitudes: Float[np.ndarray, "n_epochs n_taps"],
    tap: Int[np.ndarray, " n_epochs"],
    spacing: int,
    offsets_m: Float[np.ndarray, " n_taps"],
) -> Float[np.ndarray, " n_epochs"]:
    """Return measured minus predicted E6 range of each epoch in m, positive if later; NaN without a detection.

    `magnitudes` are in the order from the earliest to the latest tap. `spacing` is n, the number of taps from the
    punctual tap to an outer tap. `tap` is the index of the punctual tap that a detector returns: n to N−1−n for N taps,
    or −1 without a detection. `offsets_m` are the offsets of the taps from the predicted range, ascending and
    equidistant.

    The function raises `ValueError` if the offsets do not ascend in equal steps, if there are at most 2n taps, or if a
    punctual tap lacks an outer tap.
    """
    step_m = np.diff(offsets_m)
    if not (step_m.size and step_m[0] > 0 and np.allclose(step_m, step_m[0], rtol=_EQUIDISTANT, atol=0)):
        raise ValueError("the offsets of the correlators must ascend in equal steps")
    detected = tap >= 0
    outside = detected & ((tap < spacing) | (tap >= offsets_m.size - spacing))
    if offsets_m.size <= 2 * spacing or np.any(outside):
        raise ValueError(f"a punctual correlator must have neighbours {spacing} correlators away on both sides")

    punctual = np.where(detected, tap, spacing)
    columns = punctual[:, None] + np.array([-spacing, 0, spacing])
    outer = np.take_along_axis(magnitudes, columns, axis=1)
    early, late = outer[:, 0], outer[:, 2]
    # The highest of the three taps replaces c_p. At a peak the highest tap is c_p. If an outer tap is higher, the ratio
    # is ±1.
    height = outer.max(axis=1) - np.minimum(early, late)
    ratio = np.divide(late - early, height, out=np.zeros_like(height), where=height != 0)
    offset_m = offsets_m[punctual] + 0.5 * ratio * spacing * step_m[0]
    return np.where(detected, offset_m, np.nan)
