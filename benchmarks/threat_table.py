"""Print the tables of docs/threats.md in Markdown from a folder of `vestige threats -o`.

python benchmarks/threat_table.py threats
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

LEVELS = (1, 2, 3)
Row = Mapping[str, str]
MARKS = {"DIFFERS": " **≠**", "UNDECIDED": " ?"}
ANSWERS = {  # words of a cell by the phrase of the reader's list
    "stops": ("mitigated", "mitigated late"),
    "detects only": ("detected",),
    "misses": ("missed", "detected, missed"),
    "gives no verdict on": ("no verdict",),
    "neither sees nor is harmed by": ("no alarm, no harm",),
    "has no outcome of most runs for": ("mixed",),
}


def percent(row: Row, name: str, level: int) -> str:
    """Return the percentage of runs with an outcome."""
    return f"{100 * float(row[f'{name}_level_{level}']) / float(row[f'{name}_of_level_{level}']):.0f}"


def cell(row: Row, level: int) -> str:
    """Return the word, the sign of a difference, three percentages and the time to the first alarm."""
    mark = MARKS.get(row[f"level_{level}"].upper(), "")
    shares = " · ".join(percent(row, name, level) for name in ("detected", "mitigated", "missed"))
    time_s = float(row[f"time_to_detect_s_level_{level}"])
    return f"{row[f'word_level_{level}']}{mark}: {shares}" + (f", {time_s:.0f} s" if math.isfinite(time_s) else "")


def attack_line(row: Row, first: bool) -> str:
    """Return the line of a scene; the first scene of an attack has the name of the attack."""
    expected = " / ".join(row[f"expected_level_{level}"].split(":")[0].split(" ")[0] for level in LEVELS)
    cells = " | ".join(cell(row, level) for level in LEVELS)
    name = f"**{row['threat']}** {row['attack']}" if first else row["threat"]
    return f"| {name} | {row['scene']} | {expected} | {cells} |"


def attacks_with(rows: Sequence[Row], level: int, words: Sequence[str]) -> str:
    """Return the attacks whose scenes have any of the words; scenes are named if only some scenes have a word."""
    found = []
    for threat, scenes in groupby(rows, key=lambda row: row["threat"]):
        by_word = {row["scene"]: row[f"word_level_{level}"] in words for row in scenes}
        if all(by_word.values()):
            found.append(threat)
        elif any(by_word.values()):
            found.append(f"{threat} ({'; '.join(scene for scene, so in by_word.items() if so)})")
    return ", ".join(found)


def a_day(row: Row, name: str, level: int) -> str:
    """Return a rate per day as text with its interval."""
    value, low, high = (float(row[f"{name}_a_day{part}_level_{level}"]) for part in ("", "_low", "_high"))
    return f"{value:.2g} ({low:.2g} to {high:.2g})"


def quiet_line(row: Row, level: int) -> str:
    """Return the line of a nominal scene at a level: alarms and single failures a day, each with its limit."""
    pairs = [
        f"{a_day(row, name, level)}, {float(row[f'budget_{name}_a_day_level_{level}']):.3g}"
        for name in ("alarms", "failures")
    ]
    return f"| {row['scene']} | {level} | {' | '.join(pairs)} | {row[f'checks_level_{level}']} |"


def main() -> None:
    """Print both tables and, between the tables, the attacks that each level stops, detects or misses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    with (parser.parse_args().folder / "threats.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    attacks = [row for row in rows if row["word_level_1"]]
    print("| attack | scene | expected | level 1 | level 2 | level 3 |\n|---|---|---|---|---|---|")
    for _, scenes in groupby(attacks, key=lambda row: row["threat"]):
        print(*(attack_line(row, place == 0) for place, row in enumerate(scenes)), sep="\n")
    for level in LEVELS:
        print(f"\n**Level {level}**\n")
        answers = {answer: attacks_with(attacks, level, words) for answer, words in ANSWERS.items()}
        print(*(f"* {answer}: {names}" for answer, names in answers.items() if names), sep="\n")
    print("\n| scene | level | alarms a day, at most | single failures a day, budget | checks that failed |")
    print("|---|---|---|---|---|")
    for row in rows:
        if not row["word_level_1"]:
            print(*(quiet_line(row, level) for level in LEVELS), sep="\n")


if __name__ == "__main__":
    main()
