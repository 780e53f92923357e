"""Make the page of a threat table: measured and expected outcome of each attack at each mitigation level."""

from __future__ import annotations

import hashlib
from pathlib import Path

from vestige.report.markup import Html, card, element, joined, markup, number, section, table
from vestige.report.page import Page
from vestige.report.threat_table import TableCell, ThreatTable, read_threat_table
from vestige.threats.scenes import read_threats

OWN_SCENARIO = "–"  # text in the column `threat` for a user's own scenario
QUESTION = "Which attack does each mitigation level detect, mitigate or miss, and is that what was expected?"
AGREES, DIFFERS, UNDECIDED = "as expected", "differs", "undecided"
_MARKS = {AGREES: ("agrees", "✓"), DIFFERS: ("differs", "✗"), UNDECIDED: ("undecided", "?")}
_UNMEASURED = ("unmeasured", "○")
_COUNTS = {"detected": "detected", "mitigated": "mitigated", "missed": "missed", "denied": "no verdict"}
_SECTIONS = {
    "matrix": "Attack against level",
    "numbers": "Measured outcomes",
    "checks": "Which check failed, and when",
    "false-alarms": "False alarms",
    "reasons": "Reasons for differences, and limits of the scenes",
    "reproduce": "How to reproduce the table",
    "everything": "The whole table",
}


def threat_page(path: Path, name: str, *, question: str = "") -> Page:
    """Return the page of a threat table.

    `name` is the name of the folder that contains the table. `question` replaces `QUESTION`.

    The function raises `InputFileError` if the file is no threat table.
    """
    found = read_threat_table(path)
    cells = [cell for _, of_scene in found.scenes() for cell in of_scene if cell.measured]
    runs = int(max((cell.value("detected_of") for cell in cells), default=0))
    contents = {
        "matrix": _matrix(found),
        "numbers": _numbers(found),
        "checks": _checks(found),
        "false-alarms": _false_alarms(found),
        "reasons": _reasons(found),
        "reproduce": _reproduce(found, path, name, runs),
        "everything": _everything(found),
    }
    links = [element("li", element("a", _SECTIONS[key], href=f"#{key}")) for key, parts in contents.items() if parts]
    return Page(
        title=f"{name}: attack against mitigation level",
        question=question or QUESTION,
        body=(
            element("nav", element("ul", *links), aria_label="Sections"),
            _answer(found, runs),
            *(section(key, _SECTIONS[key], *parts) for key, parts in contents.items() if parts),
        ),
        version=found.rows[0].get("vestige_version") or "of unknown version",
    )


def _answer(found: ThreatTable, runs: int) -> Html:
    """Return cards with the number of scenes that have the expected outcome at each level."""
    scenes = found.scenes()
    cards = []
    for place, level in enumerate(found.levels):
        measured = [cells[place] for _, cells in scenes if cells[place].measured]
        words = [cell.agreement.lower() for cell in measured]
        judged = sum(word in _MARKS for word in words)
        small = f"scenes as expected; {words.count(DIFFERS)} differ, {words.count(UNDECIDED)} undecided"
        if not judged:
            small = "measured; the table expects no outcome" if measured else "expected, not measured"
        cards.append((f"level {level}", f"{words.count(AGREES)} of {judged}" if judged else "–", small))
    threats = len({row["threat"] for row, _ in scenes})
    cards.append(("attacks", str(threats), f"in {len(scenes)} scenes, up to {runs} runs of each"))
    return element("dl", *(card(*one) for one in cards), class_="cards")


def _matrix(found: ThreatTable) -> list[Html]:
    """Return the main table of the page, with a row for each scene and a column for each level."""
    signs = {**_MARKS, "expected, not measured": _UNMEASURED}
    legend = [
        element("li", element("span", text, class_=f"mark {kind}", data_sign=sign))
        for text, (kind, sign) in signs.items()
    ]
    words = (
        "pass: no alarm without an attack. detect: an alarm while the attack acts. mitigate: in the end no wrong range "
        "is in use, and most right ranges are in use. miss: a wrong range is in use or no verdict is possible, and "
        "there is no alarm. deny: no verdict is possible. partial: detected in about half of the runs. An outcome "
        "counts if the 95 % interval of its share of the runs lies above one half."
    )
    head = ("scene", *(f"level {level}" for level in found.levels))
    rows: list[tuple[object, ...]] = []
    shown = ""
    for row, cells in found.scenes():
        if row.get("attack") and row["threat"] != shown:
            shown = row["threat"]
            rows.append((f"{shown} {row['attack']}",))
        rows.append((row["scene"] or row["threat"], *(_tile(cell) for cell in cells)))
    caption = "The expected outcome, whether the measurement agrees, and the share of runs"
    return [element("ul", *legend, class_="key"), table(caption, head, rows, numbers_from=99), element("p", words)]


def _tile(cell: TableCell) -> Html:
    word, _ = cell.expected
    if not cell.measured:
        kind, sign = _UNMEASURED
        return element(
            "div", element("span", word or "no expected outcome", class_="mark", data_sign=sign), class_=f"tile {kind}"
        )
    kind, sign = _MARKS.get(cell.agreement.lower(), ("unmeasured", "●"))
    shares = [
        f"{text} {100 * cell.value(name) / cell.value(f'{name}_of'):.0f}\N{NO-BREAK SPACE}%"
        for name, text in _COUNTS.items()
        if cell.value(name) > 0
    ]
    if _without_attack(cell):
        shares = [f"{number(cell.value('alarms_a_day'), 2)} alarms a day"]
    return element(
        "div",
        element("span", word or "measured", class_="mark", data_sign=sign),
        element("span", ", ".join(shares), class_="detail"),
        class_=f"tile {kind}",
    )


def _without_attack(cell: TableCell) -> bool:
    """Return whether a scene has no attack; only scenes with an attack also have runs without the attack."""
    return cell.value("by_chance_of") == 0


def _numbers(found: ThreatTable) -> list[Html]:
    head = ("attack", "scene", *_COUNTS.values(), "by chance", "alarm after", "largest range error")
    parts = []
    for place, level in enumerate(found.levels):
        rows = []
        for row, cells in found.scenes():
            cell = cells[place]
            if not cell.measured or _without_attack(cell):
                continue
            rows.append(
                (
                    row["threat"],
                    row["scene"],
                    *(_share(cell, name) for name in _COUNTS),
                    number(cell.value("by_chance"), 1),
                    number(cell.value("time_to_detect_s"), 4, "s"),
                    number(cell.value("worst_range_m"), 4, "m"),
                )
            )
        if rows:
            parts.append(
                table(f"Level {level}: runs, and the exact 95 % interval of their share", head, rows, numbers_from=2)
            )
    if parts:
        words = (
            "By chance: runs with an alarm in the same epochs without the attack. Alarm after: the median. "
            "Largest range error: of all ranges in use under attack, in all runs."
        )
        parts.append(element("p", words))
    return parts


def _checks(found: ThreatTable) -> list[Html]:
    """Return a table of the checks that failed at the highest measured level, which has all checks of lower levels."""
    scenes = found.scenes()
    measured = [place for place in range(len(found.levels)) if any(cells[place].measured for _, cells in scenes)]
    if not measured or not any("checks" in name for name in found.columns):
        return []
    place, level = measured[-1], found.levels[measured[-1]]
    rows = [
        (f"{row['threat']} {row['scene']}", cells[place].text("checks") or "none")
        for row, cells in scenes
        if cells[place].measured and not _without_attack(cells[place])
    ]
    caption = f"Level {level}: checks that failed, in how many runs, and the median time of their first failure"
    return [table(caption, ("scene", "checks"), rows, numbers_from=99)] if rows else []


def _share(cell: TableCell, name: str) -> Html:
    count, of, low, high = (cell.value(f"{name}{part}") for part in ("", "_of", "_low", "_high"))
    if not of > 0:
        return markup("–")
    interval = element("span", f"{100 * low:.0f}–{100 * high:.0f} %", class_="detail")
    return joined([f"{number(count)} of {number(of)}", interval])


def _false_alarms(found: ThreatTable) -> list[Html]:
    head = ("scene without an attack", *(f"level {level}: alarms a day" for level in found.levels))
    rows = []
    for row, cells in found.scenes():
        texts = [_a_day(cell) if cell.measured and _without_attack(cell) else markup("") for cell in cells]
        if any(texts):
            rows.append((row["scene"], *(text or "–" for text in texts)))
    return [table("False alarms that a user sees in a day, and the exact 95 % interval", head, rows)] if rows else []


def _a_day(cell: TableCell) -> Html:
    rate, low, high = (number(cell.value(f"alarms_a_day{part}"), 3) for part in ("", "_low", "_high"))
    counted = f"{number(cell.value('alarms'))} in {number(cell.value('days'), 3)} days"
    budget = cell.value("budget_alarms_a_day")
    allowed = f", at most {number(budget, 3)} a day" if budget >= 0 else ""
    return joined([f"{rate} ({low} to {high})", element("span", counted + allowed, class_="detail")])


def _reasons(found: ThreatTable) -> list[Html]:
    """Return the table's reasons for outcomes that differ or are undecided, and the texts of the column `shows`."""
    terms: dict[str, list[str]] = {}
    for row, cells in found.scenes():
        for cell in cells:
            word = cell.agreement.lower()
            if word in (DIFFERS, UNDECIDED):
                why = cell.text("note") or row.get("note", "") or "no reason is known"
                terms.setdefault(f"{row['threat']} {row['scene']}", []).append(f"Level {cell.level} {word}: {why}.")
        if (shows := row.get("shows", "")) and row["threat"] not in terms:
            terms[row["threat"]] = [f"Shown by {shows}."]
    if not terms:
        return []
    return [
        element(
            "dl",
            *(
                part
                for term, lines in terms.items()
                for part in (element("dt", term), *(element("dd", line) for line in lines))
            ),
        )
    ]


def _reproduce(found: ThreatTable, path: Path, name: str, runs: int) -> list[Html]:
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    seeds = f" --seeds {runs}" if runs else ""
    rows = [row for row, _ in found.scenes()]
    own = [row["scene"] for row in rows if row["threat"] == OWN_SCENARIO]
    chosen = "".join(f" --attack {one}.toml" for one in own)
    threats = dict.fromkeys(row["threat"] for row in rows)
    if not own and set(threats) != {threat.id for threat in read_threats()}:
        chosen = "".join(f" --only {one}" for one in threats)
    commands = f"vestige threats{chosen}{seeds} -o {name}\nvestige report {name} -o report.html"
    note = "The seeds are 0, 1, 2 and so on, the same for every scene."
    return [
        element("p", note),
        element("pre", element("code", commands), tabindex=0, role="region", aria_label="Commands"),
        table(
            "Origin of the results",
            ("", "value"),
            [("folder", name), ("SHA-256 of the table", element("code", digest))],
            numbers_from=99,
        ),
    ]


def _everything(found: ThreatTable) -> list[Html]:
    rows = [[row[name] for name in found.columns] for row in found.rows]
    whole = table("Every column, as in the file", found.columns, rows, numbers_from=99)
    return [element("details", element("summary", f"{len(rows)} rows, {len(found.columns)} columns"), whole)]
