"""The tables of docs/threats.md out of a folder of `vestige threats -o`, as Markdown.

python benchmarks/threat_table.py threats
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Mapping
from pathlib import Path

LEVELS = (1, 2, 3)
Row = Mapping[str, str]
MARKS = {"DIFFERS": " **≠**", "UNDECIDED": " ?"}


def percent(row: Row, name: str, level: int) -> str:
    """Return the percentage of runs of which something is so."""
    return f"{100 * float(row[f'{name}_level_{level}']) / float(row[f'{name}_of_level_{level}']):.0f}"


def cell(row: Row, level: int) -> str:
    """Return the word, whether it differs from what was expected, three percentages and the time to the first alarm."""
    mark = MARKS.get(row[f"level_{level}"].upper(), "")
    shares = " · ".join(percent(row, name, level) for name in ("detected", "mitigated", "missed"))
    time_s = float(row[f"time_to_detect_s_level_{level}"])
    return f"{row[f'word_level_{level}']}{mark}: {shares}" + (f", {time_s:.0f} s" if math.isfinite(time_s) else "")


def attack_line(row: Row) -> str:
    """Return the line of an attack."""
    expected = " / ".join(row[f"expected_level_{level}"].split(":")[0].split(" ")[0] for level in LEVELS)
    cells = " | ".join(cell(row, level) for level in LEVELS)
    return f"| {row['threat']} {row['scene']} | {expected} | {row['detected_of_level_1']} | {cells} |"


def a_day(row: Row, name: str, level: int) -> str:
    """Return a rate a day with its interval."""
    value, low, high = (float(row[f"{name}_a_day{part}_level_{level}"]) for part in ("", "_low", "_high"))
    return f"{value:.2g} ({low:.2g} to {high:.2g})"


def quiet_line(row: Row, level: int) -> str:
    """Return the line of a nominal scene at a level: alarms and single failures a day, with what each may be."""
    pairs = [
        f"{a_day(row, name, level)}, {float(row[f'budget_{name}_a_day_level_{level}']):.3g}"
        for name in ("alarms", "failures")
    ]
    return f"| {row['scene']} | {level} | {' | '.join(pairs)} | {row[f'checks_level_{level}']} |"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    with (parser.parse_args().folder / "threats.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    print("| scene | expected | runs | level 1 | level 2 | level 3 |\n|---|---|---|---|---|---|")
    for row in rows:
        if row["word_level_1"]:
            print(attack_line(row))
    print("\n| scene | level | alarms a day, at most | single failures a day, budget | checks that failed |")
    print("|---|---|---|---|---|")
    for row in rows:
        if not row["word_level_1"]:
            print(*(quiet_line(row, level) for level in LEVELS), sep="\n")


if __name__ == "__main__":
    main()
