"""Write the threat table to files: `threats.csv` with a row for each scene, and `threats.zarr` over scene and level.

In the CSV file, the name of a column that depends on the level ends with the level, such as `detected_level_2`. The
column `expected_level_2` has the expected outcome with its reason. The column `level_2` says whether the measured
outcome agrees with the expected outcome. In the store `threats.zarr`, the statistics of the CSV file are variables over
`scene` and `level`. The variable `check_failed` is the number of runs in which a check failed. The variable
`check_time_s` is the median time of the check's first failure in the runs in which the check failed.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
import xarray

from vestige.acas_processor.levels import LEVELS as ROWS
from vestige.constants import DAY_S
from vestige.output import replacement
from vestige.source_version import vestige_version
from vestige.threats.matrix import SceneCell
from vestige.threats.scenes import LEVEL_NUMBERS

TABLE, STORE = "threats.csv", "threats.zarr"
SETTINGS = "settings"  # name of the column and attribute with the values of `--set`
VERSION = "vestige_version"  # name of the column and attribute with the version of vestige that measured all runs
_BUDGETS = ("budget_alarms", "budget_range_alarms", "budget_failures", "budget_exact_failures", "budget_range_failures")
_SHARES = ("detected", "mitigated", "protected", "missed", "denied", "by_chance")


def table_rows(cells: Sequence[SceneCell]) -> list[dict[str, object]]:
    """Return the rows of `threats.csv`: for each scene, a dictionary with the names of the columns as keys."""
    rows = []
    for _, of_scene in groupby(cells, key=lambda cell: (cell.case.threat, cell.case.scene)):
        levels = list(of_scene)
        row, case = levels[0].case.row, levels[0].case
        rows.append(
            {
                "threat": case.threat,
                "attack": row.name if row else "",
                "scene": case.scene,
                "e1": row.e1 if row else "",
                "e6": row.e6 if row else "",
                "source": row.source if row else "",
                SETTINGS: " ".join(case.settings),
                **{f"expected_level_{level}": row.expected[str(level)] if row else "" for level in LEVEL_NUMBERS},  # type: ignore[index]
                **{f"level_{cell.level}": cell.agreement.value for cell in levels},
                **{
                    f"{name}_level_{cell.level}": value
                    for cell in levels
                    for name, value in statistics_of(cell).items()
                },
                VERSION: vestige_version(),
            }
        )
    return rows


def statistics_of(cell: SceneCell) -> dict[str, object]:
    """Return the statistics of a cell by name, including failed checks and the reason for an unexpected outcome."""
    found = cell.found
    shares = {
        f"{name}{part}": value
        for name in _SHARES
        for part, value in zip(("", "_of", "_low", "_high"), _parts(getattr(found, name)), strict=True)
    }
    a_day = {
        f"{name}_a_day{part}": value
        for name in ("alarms", "failures", "exact_failures", "range_failures")
        for part, value in zip(("", "_low", "_high"), found.a_day(name), strict=True)
    }
    days = found.duration_s / DAY_S
    return {
        "word": found.word if cell.attacked else "",
        **shares,
        "alarms": found.alarms,
        **a_day,
        **{f"{name}_a_day": getattr(found, name) / days if days else math.nan for name in _BUDGETS},
        "days": days,
        "time_to_detect_s": found.time_to_detect_s,
        "worst_range_m": found.worst_range_m,
        "worst_position_m": found.worst_position_m,
        "checks": "; ".join(
            f"{one.name} {one.failed.successes}/{one.failed.trials} after {one.time_s:g} s" for one in found.checks
        ),
        "budgets": "; ".join(f"{one.name} {one.failures} of {one.budget:.3g}" for one in found.budgets),
        "exceeded": "; ".join(one.name for one in found.exceeded),
        "note": cell.note,
    }


def _parts(found: object) -> tuple[object, ...]:
    return tuple(getattr(found, name) for name in ("successes", "trials", "low", "high"))


def write_table(folder: Path, cells: Sequence[SceneCell]) -> None:
    """Write the threat table as CSV and as a store; if writing fails, no incomplete file or store remains."""
    rows = table_rows(cells)
    with replacement(folder / TABLE) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else ["threat"])
        writer.writeheader()
        writer.writerows(rows)
    with replacement(folder / STORE) as store:
        threat_dataset(cells).to_zarr(store, mode="w", consolidated=False)


def read_threat_dataset(folder: Path) -> xarray.Dataset:
    """Return the threat table from a folder that `vestige threats` wrote.

    The function raises `InputFileError` if the folder has no threat table, or a damaged threat table.
    """
    from vestige.campaign.store.results import load_small  # noqa: PLC0415  (zarr loads slowly, and no worker needs it)

    return load_small(folder / STORE, "the table that `vestige threats -o` writes; the same command repairs it")


def threat_dataset(cells: Sequence[SceneCell]) -> xarray.Dataset:
    """Return the threat table as a dataset over scene and level."""
    scenes = list(dict.fromkeys((cell.case.threat, cell.case.scene) for cell in cells))
    shape = (len(scenes), len(LEVEL_NUMBERS))
    place = {scene: number for number, scene in enumerate(scenes)}
    names = statistics_of(cells[0]) if cells else {}
    columns: dict[str, np.ndarray] = {
        name: np.full(shape, "", dtype=object) if isinstance(value, str) else np.full(shape, np.nan)
        for name, value in (names | {"expected": "", "agreement": ""}).items()
    }
    for cell in cells:
        at = place[cell.case.threat, cell.case.scene], LEVEL_NUMBERS.index(cell.level)
        for name, value in (
            statistics_of(cell) | {"expected": cell.expected, "agreement": cell.agreement.value}
        ).items():
            columns[name][at] = value
    attack = [
        next(c.case.row.name if c.case.row else "" for c in cells if (c.case.threat, c.case.scene) == one)
        for one in scenes
    ]
    ours = [str(row.name) for level in LEVEL_NUMBERS for row in ROWS[level]]
    checks = list(dict.fromkeys([*ours, *(one.name for cell in cells for one in cell.found.checks)]))
    failed, time_s = np.zeros((*shape, len(checks))), np.full((*shape, len(checks)), np.nan)
    for cell in cells:
        at = place[cell.case.threat, cell.case.scene], LEVEL_NUMBERS.index(cell.level)
        for one in cell.found.checks:
            failed[(*at, checks.index(one.name))] = one.failed.successes
            time_s[(*at, checks.index(one.name))] = one.time_s
    over = ("scene", "level", "check")
    return xarray.Dataset(
        {
            name: (("scene", "level"), values.astype(np.dtypes.StringDType()) if values.dtype == object else values)
            for name, values in columns.items()
        }
        | {
            "check_failed": (over, failed, {"long_name": "runs in which the check failed"}),
            "check_time_s": (
                over,
                time_s,
                {"long_name": "median time of the first failure, in runs in which the check failed", "units": "s"},
            ),
        },
        coords={
            "check": ("check", _text(checks)),
            "scene": ("scene", _text([name for _, name in scenes])),
            "threat": ("scene", _text([name for name, _ in scenes])),
            "attack": ("scene", _text(attack)),
            "level": list(LEVEL_NUMBERS),
        },
        attrs={VERSION: vestige_version(), SETTINGS: " ".join(cells[0].case.settings) if cells else ""},
    )


def _text(words: Sequence[str]) -> np.ndarray:
    """Return words as an array of strings of variable length, which can be stored."""
    return np.array(words, dtype=np.dtypes.StringDType())
