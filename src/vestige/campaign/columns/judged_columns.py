"""Compute the columns of the results that contain verdicts, states, checks, and ranges in use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vestige.acas_processor.levels import NO_CAUSE, OTHERS
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.campaign.plan import column_table
from vestige.records import Status

_EPOCH, _SATELLITE, _CHECKS = ("epoch",), ("epoch", "satellite"), ("check", "epoch", "satellite")
_STATUSES = {"flag_values": list(range(len(Status))), "flag_meanings": " ".join(one.name for one in Status)}
_FLAGS: Mapping[str, Mapping[str, Any]] = {
    "status": _STATUSES,
    "state": _STATUSES,
    "check_result": {"flag_values": [-1, 0, 1], "flag_meanings": "not_run passed failed"},
    "cause": {
        "comment": f"index on the axis `check`; {NO_CAUSE} for none, {OTHERS} if another satellite has two signals"
    },
}

JUDGED_COLUMNS = column_table(
    ("status", _SATELLITE, "int8", "1", "verdict at the level of the scenario"),
    ("state", _SATELLITE, "int8", "1", "state that the receiver shows its user"),
    ("cause", _SATELLITE, "int8", "1", "check that decided the verdict"),
    ("check_result", _CHECKS, "int8", "1", "outcome of a check, after confirmation"),
    ("check_statistic", _CHECKS, "float32", "1", "statistic of a check, in its own unit"),
    ("check_threshold", _CHECKS, "float32", "1", "limit of the magnitude of the statistic"),
    ("range_in_use_m", _SATELLITE, "float64", "m", "pseudorange that may be used; NaN if none"),
    ("range_is_earlier", _SATELLITE, "bool", "1", "whether the range belongs to the earliest of several signals"),
    ("searched", _EPOCH, "bool", "1", "whether the exhaustive search was made"),
    attrs=_FLAGS,
)


def judged_columns(block: VerdictBlock) -> dict[str, np.ndarray]:
    """Return the values of `JUDGED_COLUMNS`; results of checks of the whole receiver are repeated per satellite."""
    names = [spec.name for spec in block.specs]
    shape = (len(names), *block.status.shape)
    statistic, threshold = np.full((2, *shape), np.nan, np.float32)
    result = np.full(shape, -1, np.int8)
    for place, name in enumerate(names):
        if name not in block.checks:
            continue
        series, failed = block.checks[name], block.failed[name]
        axes = (slice(None), None) if series.of_receiver else ()
        statistic[place], threshold[place] = series.statistic[axes], series.threshold[axes]
        result[place] = np.where(failed, 1, np.where(series.run, 0, -1))[axes]
    for values in (statistic, threshold):  # the sign of a NaN may depend on its index in a vector
        values[np.isnan(values)] = np.nan
    return {
        "status": block.status,
        "state": block.state,
        "cause": block.cause,
        "check_result": result,
        "check_statistic": statistic,
        "check_threshold": threshold,
        "range_in_use_m": block.range_in_use_m,
        "range_is_earlier": block.earlier,
        "searched": block.searched,
    }
