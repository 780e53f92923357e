"""Read counts of detections against C/N0 from several campaigns, or from a table."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import numpy as np
import xarray

from vestige.crypto.file_bytes import read_text
from vestige.errors import InputFileError, VestigeError
from vestige.plots.curves.sweep_curves import KEY
from vestige.plots.epochs import attribute, is_detected, is_missed, select

_MAX_FILE_BYTES = 1 << 26
_CONSTANT = ("integration_s", "p_fa")  # attributes of a sweep; in a table, columns with the same value in all rows
_COUNTS = ("trials", "detections", "false_alarm_trials", "false_alarms")


def sweep_of(
    campaigns: Sequence[xarray.Dataset], *, detector: str = "early", svid: int | None = None
) -> xarray.Dataset:
    """Return the numbers of trials and detections of several campaigns, with a row for each campaign.

    The campaigns differ in C/N0, which is their attribute `cn0_dbhz`.

    The function raises `VestigeError` if a campaign has no C/N0 or no correlation, or if the campaigns differ in
    integration time or P_fa. The error is also raised if a campaign lacks a variable, the detector or the satellite, or
    if `svid` is None for several satellites.
    """
    rows = []
    for results in campaigns:
        shown = select(results, detector=detector, svid=svid)
        cn0_dbhz, hits = attribute(shown, "cn0_dbhz"), int(is_detected(shown).sum())
        trials = hits + int(is_missed(shown).sum())
        if cn0_dbhz is None or not trials:
            raise VestigeError("results of a campaign: found no C/N0 or no correlation, expected both")
        rows.append((cn0_dbhz, trials, hits))
    constants = {name: {attribute(results, name) for results in campaigns} for name in _CONSTANT}
    for name, values in constants.items():
        if len(values) > 1:
            raise VestigeError(f"campaigns of one sweep: found {name} {sorted(map(str, values))}, expected one value")
    columns = dict(zip(("cn0_dbhz", "trials", "detections"), zip(*rows, strict=True), strict=True))
    attrs = {name: value for name, values in constants.items() for value in values if value is not None}
    return _dataset({name: np.array(values) for name, values in columns.items()}, attrs)


def read_sweep(path: Path | str, *, detector: str = "early") -> xarray.Dataset:
    """Read a sweep from a CSV table with a header, such as `sweep.csv` of `vestige run --sweep`.

    The table has the column `cn0_dbhz`. The table also has the columns `trials` and `detections`, or
    `false_alarm_trials` and `false_alarms`, or all these columns. Theory needs the columns `integration_s` and `p_fa`,
    each with the same value in all rows. In place of `detections` the table may have a column for each detector, such
    as `detections_early`. Columns before `cn0_dbhz` contain the values of the scenario's keys that the sweep varies.
    The values are kept as text in the variables `key NAME`. Other columns are ignored.

    The function raises `InputFileError` if the file is no CSV table, lacks the column `cn0_dbhz` or has no row. The
    error is also raised if a count, C/N0, `integration_s` or `p_fa` is not a valid number, or if `integration_s` or
    `p_fa` differs between rows.
    """
    path = Path(path)
    text = read_text(path, at_most=_MAX_FILE_BYTES, expected="a CSV file")
    try:
        table = list(csv.DictReader(StringIO(text, newline=""), strict=True))
    except csv.Error as error:
        raise InputFileError(path, "table", str(error), "comma-separated text in UTF-8") from error
    if not table or "cn0_dbhz" not in table[0]:
        raise InputFileError(
            path, "table", "no column cn0_dbhz, or no row", "columns cn0_dbhz, trials, detections, and at least one row"
        )
    wanted = {name: name for name in ("cn0_dbhz", *_COUNTS, *_CONSTANT)}
    if (own := f"detections_{detector}") in table[0]:
        wanted["detections"] = own
    columns = {name: _column(path, table, heading) for name, heading in wanted.items() if heading in table[0]}
    attrs = {}
    for name in _CONSTANT:
        values = set(columns.pop(name, np.zeros(0)).tolist())
        if len(values) > 1:
            raise InputFileError(path, name, f"{len(values)} values", "one value in all rows")
        if values:
            attrs[name] = values.pop()
    if not 0 < attrs.get("p_fa", 0.5) < 1 or not attrs.get("integration_s", 1.0) > 0:
        raise InputFileError(path, "integration_s, p_fa", str(attrs), "a time above 0 and a probability")
    keys = list(table[0])[: list(table[0]).index("cn0_dbhz")]
    texts = {KEY + name: np.array([row[name] or "" for row in table]) for name in keys if name not in wanted.values()}
    return _dataset(columns | texts, attrs)


def _column(path: Path, table: list[dict[str, str]], name: str) -> np.ndarray:
    convert = int if name.startswith(_COUNTS) else float
    values = []
    for line, row in enumerate(table, start=2):
        try:
            value = convert(row[name] or "")
            if not np.isfinite(value) or abs(value) > 1e15:
                raise ValueError(value)
        except (ValueError, TypeError) as error:
            expected = "a whole number" if convert is int else "a number"
            raise InputFileError(path, f"line {line}, {name}", row[name], expected) from error
        values.append(value)
    return np.array(values)


def _dataset(columns: dict[str, np.ndarray], attrs: dict[str, float]) -> xarray.Dataset:
    return xarray.Dataset({name: ("row", values) for name, values in columns.items()}, attrs=attrs)
