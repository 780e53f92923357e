"""Read the table that `vestige threats -o` writes, by the names of the columns.

The name of a column gives the meaning of the column, so this module accepts further levels and columns.
`expected_level_2` is the expected outcome of level 2, and `level_2` tells whether the measurement agrees.
`detected_level_2` is the number of runs in which level 2 detected the attack. A table with a column `level` has a row
for each level. In a table with a column `level`, names of columns without a level refer to the level of the row. If
only one level is measured, names without a level refer to the measured level. Tables of release 0.2.0 and earlier have
`worst_accepted_m` in place of `worst_range_m`.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from vestige.crypto.file_bytes import read_text
from vestige.errors import InputFileError

_MAX_FILE_BYTES = 1 << 26
KEYS = ("threat", "scene")
EXPECTED_TABLE = "a table of threats, as `vestige threats -o` writes it"
_LEVEL = re.compile(r"(?:expected_)?level_(\d+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class TableCell:
    """Outcome of one scene at one mitigation level, from the columns of the table."""

    values: Mapping[str, str]
    level: int
    only: bool  # whether names of columns without a level refer to this level

    def text(self, name: str) -> str:
        """Return the text of a column for this level; empty if the column is missing."""
        names = (f"{name}_level_{self.level}", f"level_{self.level}_{name}", name if self.only else "")
        return next((self.values[one] for one in names if one in self.values), "")

    def value(self, name: str) -> float:
        """Return the number in a column; NaN if there is no number."""
        return float(self.text(name) or "nan")

    @property
    def expected(self) -> tuple[str, str]:
        """Expected outcome and the reason for this outcome; a missing text is empty."""
        word, _, reason = (self.values.get(f"expected_level_{self.level}") or self.text("expected")).partition(": ")
        return word, reason

    @property
    def agreement(self) -> str:
        """Agreement of the measurement with the expectation; empty if this level is not measured."""
        return self.values.get(f"level_{self.level}") or self.text("agreement")

    @property
    def measured(self) -> bool:
        """Whether the table has the results of runs of this scene at this level."""
        return self.value("detected_of") > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreatTable:
    """Content of a threat table."""

    columns: tuple[str, ...]
    rows: tuple[Mapping[str, str], ...]  # text of every cell by the name of the column
    levels: tuple[int, ...]  # mitigation levels that have results or expected outcomes in the table

    def scenes(self) -> list[tuple[Mapping[str, str], list[TableCell]]]:
        """Return the first row of each scene, and the cells of the scene at all levels."""
        scenes: dict[tuple[str, str], list[Mapping[str, str]]] = {}
        for row in self.rows:
            scenes.setdefault((row["threat"], row["scene"]), []).append(row)
        return [(rows[0], [self._cell(rows, level) for level in self.levels]) for rows in scenes.values()]

    def _cell(self, rows: list[Mapping[str, str]], level: int) -> TableCell:
        if "level" in self.columns:
            own = [row for row in rows if row["level"] == str(level)]
            return TableCell(values=own[0] if own else rows[0], level=level, only=bool(own))
        measured = [name for name in self.columns if re.fullmatch(r"level_\d+", name)]
        return TableCell(values=rows[0], level=level, only=measured == [f"level_{level}"])


def read_threat_table(path: Path) -> ThreatTable:
    """Return the threat table in a file.

    The function raises `InputFileError` if the file is no threat table.
    """
    text = read_text(path, at_most=_MAX_FILE_BYTES, expected=EXPECTED_TABLE)
    try:
        lines = list(csv.reader(StringIO(text, newline=""), strict=True))
    except csv.Error as error:
        raise InputFileError(path, "file", error, EXPECTED_TABLE) from error
    columns = tuple(name.replace("worst_accepted_m", "worst_range_m") for name in lines[0]) if lines else ()
    for key in KEYS:
        if key not in columns:
            raise InputFileError(path, "line 1", f"no column {key}", EXPECTED_TABLE)
    rows = []
    for number, cells in enumerate(lines[1:], start=2):
        if len(cells) != len(columns):
            raise InputFileError(path, f"row {number}", f"{len(cells)} cells", f"{len(columns)}, as in line 1")
        row = dict(zip(columns, cells, strict=True))
        _check_numbers(path, number, row)
        rows.append(row)
    if not rows:
        raise InputFileError(path, "rows", "none", EXPECTED_TABLE)
    of_names = {int(match[1]) for name in columns if (match := _LEVEL.fullmatch(name))}
    of_rows = {int(row["level"]) for row in rows if "level" in columns}
    return ThreatTable(columns=columns, rows=tuple(rows), levels=tuple(sorted(of_names | of_rows)))


_COUNTS = re.compile(r"(?:level_\d+_)?(?:(?:detected|mitigated|missed|denied|by_chance)(?:_of)?|alarms)(?:_level_\d+)?")
_LARGEST_COUNT = 1e15
_NUMBERS = re.compile(
    r"(?:level_\d+_)?(?:detected|mitigated|missed|denied|by_chance|alarms|alarms_a_day|budget_alarms_a_day|days|"
    r"time_to_detect|worst_range)"
    r"(?:_of|_low|_high|_s|_m)?(?:_level_\d+)?"
)


def _check_numbers(path: Path, number: int, row: Mapping[str, str]) -> None:
    """Raise `InputFileError` if the cell of a level, a count or another number contains an invalid value."""
    for name, text in row.items():
        if name == "level" and not re.fullmatch(r"[1-9]\d?", text):
            raise InputFileError(path, f"row {number}, {name}", text, "a mitigation level")
        if text and _NUMBERS.fullmatch(name):
            try:
                value = float(text)
            except ValueError as error:
                raise InputFileError(path, f"row {number}, {name}", text, "a number") from error
            if _COUNTS.fullmatch(name):
                if not (0 <= value <= _LARGEST_COUNT and value.is_integer()):
                    raise InputFileError(path, f"row {number}, {name}", text, "a count")
            elif math.isinf(value):
                raise InputFileError(path, f"row {number}, {name}", text, "a finite number")
