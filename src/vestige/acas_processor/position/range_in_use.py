"""Choose the range in use of each satellite, and compute the position from these ranges [WFO, Sec. III-D, IV].

A satellite can have a range in use only in epochs with RECS. The range in use is

1. the range of the earliest signal, if a search found several signals. This rule is valid for any verdict, because
   nobody can send chips before they are broadcast. If both searches found this signal within one chip, the exhaustive
   search gives its range;
2. if the correlators of the RECS contain two signals: the range of E1 if the earlier signal agrees with the E1
   prediction, or the range of the earlier signal if this signal comes before the E1 prediction by more than the limit
   of the range check;
3. the range of E6, if the detected signal comes before the E1 prediction and the range check fails. As in rule 1,
   nobody can send chips before they are broadcast;
4. the range of E1, if both the verdict and the state are AUTHENTIC.

Otherwise no range is in use. If a search found several signals and no search can decide which signal is true, no range
is in use either. In this case the true signal may arrive before the first correlator of the RECS, so the earliest
signal in the correlators proves nothing. Impossible ranges are not used (`possible_range.py`).

The position is the fix from all ranges in use, of at least four satellites. If the snapshots say which navigation data
OSNMA authenticates (`data_authenticated`), only satellites with authenticated data are used. The fix uses uncorrected
pseudoranges and broadcast orbits. Delays of ionosphere and troposphere therefore remain, mostly in height and clock.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.checks.second_signal import SecondSignalMonitor, two_signals
from vestige.acas_processor.levels import POSITION
from vestige.acas_processor.position.fix_measurement import fix_quantities
from vestige.acas_processor.position.possible_range import (
    BY_POSITION,
    KnownPositions,
    too_far_away,
    why_impossible,
)
from vestige.acas_processor.verdict_block import PositionBlock, VerdictBlock
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.osnma.disclosure import tags_prove_data
from vestige.navigation.position_fix import UNKNOWNS, position_fix
from vestige.records import Status
from vestige.records.checks import CheckName
from vestige.signals.definitions import E6C

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor


def ranges_in_use(
    block: VerdictBlock, processor: AcasProcessor, clock_limit_s: Float[np.ndarray, " n"]
) -> VerdictBlock:
    """Return the verdicts of a block with the ranges in use and the positions added.

    `clock_limit_s` is the upper limit of the error of the receiver's clock at each epoch.
    """
    snapshots = block.measured.snapshots
    authentic = POSITION[Status.AUTHENTIC]
    e1_in_use = (block.status == authentic) & (block.state == authentic)
    offset_m = _earliest_m(block.e1_search.earliest_m, block.exhaustive_search.earliest_m)
    undecided = np.isnan(offset_m) & (block.e1_search.twice | block.exhaustive_search.twice)
    in_bank_m = np.where(undecided, np.nan, _earlier_in_bank_m(block, processor))
    limit_m = processor.range_limit_m
    e1_in_use |= np.abs(in_bank_m) <= limit_m
    offset_m = np.where(np.isnan(offset_m) & (in_bank_m < -limit_m), in_bank_m, offset_m)
    earlier = np.isfinite(offset_m) & snapshots.recs[:, None]
    used = (e1_in_use | earlier) & snapshots.recs[:, None]
    range_m = np.where(used, snapshots.e1.pseudorange_m + np.where(earlier, offset_m, 0.0), np.nan)
    impossible = why_impossible(range_m, clock_limit_s)
    range_m = np.where(impossible > 0, np.nan, range_m)
    block = replace(
        block,
        impossible=impossible,
        true_offset_m=np.where(impossible > 0, np.nan, offset_m),
        range_in_use_m=range_m,
        earlier=earlier & np.isfinite(range_m),
    )
    return replace(block, position=_positions(block, processor, range_m))


def ranges_near(
    block: VerdictBlock, processor: AcasProcessor, clock_limit_s: Float[np.ndarray, " n"], known: KnownPositions
) -> VerdictBlock:
    """Remove the ranges of earlier signals that `known` excludes, and return the verdicts with new positions."""
    rows = np.flatnonzero(block.earlier.any(axis=1) & np.isfinite(known.reach_m))
    if not rows.size or block.position is None:
        return block
    snapshots, range_m = block.measured.snapshots, block.range_in_use_m
    sent = processor.monitoring.fix.transmission(snapshots.time[rows], snapshots.svids, range_m[rows])
    near = KnownPositions(position_m=known.position_m[rows], reach_m=known.reach_m[rows])
    far = np.zeros(range_m.shape, np.bool_)
    far[rows] = too_far_away(range_m[rows], sent, block.earlier[rows], clock_limit_s[rows], near)
    if not far.any():
        return block
    range_m = np.where(far, np.nan, range_m)
    return replace(
        block,
        impossible=np.where(far, BY_POSITION, block.impossible).astype(np.int8),
        true_offset_m=np.where(far, np.nan, block.true_offset_m),
        range_in_use_m=range_m,
        earlier=block.earlier & ~far,
        position=_positions(block, processor, range_m),
    )


def _earlier_in_bank_m(block: VerdictBlock, processor: AcasProcessor) -> Float[np.ndarray, "n m"]:
    """Return the offset of the earlier of two signals in the correlators from the E1 prediction, in m; otherwise NaN.

    The signal that the detector found also counts if this signal comes before the E1 prediction and the range check
    failed.
    """
    offset_m = np.where(block.failed[CheckName.E1_E6_RANGE], block.measured.detected.range_offset_m, np.nan)
    offset_m[~(offset_m < 0)] = np.nan
    if CheckName.E6_SECOND_SIGNAL not in block.failed:
        return offset_m
    two = two_signals(SecondSignalMonitor(reach_m=processor.late_reach_m), block.measured).earlier_m
    return np.fmin(offset_m, np.where(block.failed[CheckName.E6_SECOND_SIGNAL], two, np.nan))


def _earliest_m(
    handed_over_m: Float[np.ndarray, "n m"], exhaustive_m: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, "n m"]:
    """Return the offset of the earliest signal of both searches from the E1 prediction, in m.

    The result is NaN if neither search gives an offset. Nobody can send the chips before the satellite, so the earlier
    of two signals counts. Two offsets within a chip belong to the same signal. In this case the offset of the
    exhaustive search counts, because this search covers all offsets.
    """
    same_or_later = ~(handed_over_m < exhaustive_m - SPEED_OF_LIGHT_MPS / E6C.chip_rate_hz)
    return np.where(np.isfinite(exhaustive_m) & same_or_later, exhaustive_m, handed_over_m)


def _positions(
    block: VerdictBlock, processor: AcasProcessor, range_m: Float[np.ndarray, "n m"]
) -> PositionBlock | None:
    """Return the position of each epoch from the ranges in use; None if no orbits are known."""
    measured, settings = block.measured, processor.monitoring.fix
    if measured.fix is None:
        return None
    snapshots = measured.snapshots
    if snapshots.data_authenticated is not None:
        range_m = np.where(snapshots.data_authenticated, range_m, np.nan)
    rows = np.flatnonzero(np.count_nonzero(np.isfinite(range_m), axis=1) >= UNKNOWNS)
    fixes = measured.fix.rows(rows)  # if all E1 ranges are in use, the fix of step 5 is the position
    other = np.flatnonzero(~np.all(_equal(range_m[rows], snapshots.e1.pseudorange_m[rows]), axis=1))
    if other.size:
        sent = settings.transmission(snapshots.time[rows[other]], snapshots.svids, range_m[rows[other]])
        left = fixes.rows(other)
        fix = position_fix(sent, range_m[rows[other]], left.sigma_m, common_m=left.common_m)
        quantities = fix_quantities(sent, fix, rate_mps=left.range_rate_mps, sigma_rate_mps=left.sigma_rate_mps)
        fixes.put(other, replace(left, **quantities))
    used = np.zeros(range_m.shape, np.bool_)
    used[rows] = np.isfinite(range_m[rows]) & fixes.fix.valid[:, None]
    trusted = snapshots.svids if settings.authenticated is None else tuple(settings.authenticated)
    authenticated = np.all(~used | np.isin(snapshots.svids, trusted), axis=1)
    if settings.authenticated is not None or snapshots.data_authenticated is not None:
        authenticated &= tags_prove_data(snapshots.time_uncertainty_s)
    return PositionBlock(rows=rows, fixes=fixes, used=used, orbits_authenticated=np.asarray(authenticated))


def _equal(one: Float[np.ndarray, "n m"], other: Float[np.ndarray, "n m"]) -> Bool[np.ndarray, "n m"]:
    """Return True where two ranges are equal or both ranges are missing."""
    return (one == other) | (np.isnan(one) & np.isnan(other))
