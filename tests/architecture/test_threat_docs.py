"""What docs/threats.md says of the attacks: parameters are those of threats.toml, words those of its own table."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from vestige.threats.scenes import Threat, read_threats

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "threats.md").read_text(encoding="utf-8")
SECTIONS = {match[1]: match[2] for match in re.finditer(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", TEXT, re.M | re.S)}
WORDS = {  # words of the short table by the words of a cell
    "mitigated": "stops",
    "mitigated late": "stops late",
    "detected": "detects",
    "detected, missed": "misses, with an alarm",
    "missed": "misses",
    "no verdict": "no verdict",
    "no alarm, no harm": "no alarm, no harm",
}
WORSE = [("A8", "wideband", 1), ("A8", "chirp", 1)]  # measurements that are worse than expected
ATTACKS = [one for one in read_threats() if one.id != "A0"]
Cells = list[str]


def rows(section: str) -> list[Cells]:
    """Return the cells of the rows of attacks in a section."""
    lines = re.findall(r"^\| ((?:\*\*)?A\d.*) \|$", SECTIONS[section], re.MULTILINE)
    return [[cell.strip() for cell in re.split(r" +\| +", line)] for line in lines]


def attack_of(row: Cells) -> str:
    return re.sub(r"\W.*", "", row[0].strip("*"))


def word(cell: str) -> str:
    """Return the word of a cell of the table: `missed` of `missed ?: 50 · 38 · 70, 30 s`."""
    return re.sub(r" (\*\*≠\*\*|\?)$", "", cell.split(":", maxsplit=1)[0])


@pytest.mark.parametrize("threat", ATTACKS, ids=lambda one: one.id)
def test_the_short_table_says_what_the_attacker_does_and_what_the_levels_do(threat: Threat) -> None:
    (row,) = (one for one in rows("The attacks in short") if attack_of(one) == threat.id)
    scenes = [one for one in rows("The table") if attack_of(one) == threat.id]
    assert row[0] == f"**{threat.id}** {threat.name}"
    assert [one.replace("–20", "−20") for one in (threat.e1, threat.e6)] == row[1:3]
    assert len(scenes) == len(threat.scene)
    words = [[WORDS[word(scene[2 + level])] for scene in scenes] for level in (1, 2, 3)]
    assert [" · ".join(dict.fromkeys(of_level)) for of_level in words] == row[3:]


def test_no_other_attack_has_a_row() -> None:
    assert [attack_of(row) for row in rows("The attacks in short")] == [one.id for one in ATTACKS]


def test_every_difference_is_better_than_expected_but_for_those_that_the_page_names() -> None:
    """The order is from worst to best: a wrong range without an alarm first, true ranges in use last."""
    order = ["missed", "no verdict", "no alarm, no harm", "detected, missed", "detected", "mitigated late", "mitigated"]
    expected = {"miss": "missed", "deny": "no verdict", "partial": "detected, missed", "detect": "detected"}
    worse = []
    for row in rows("The table"):
        for level, (wanted, cell) in enumerate(zip(row[2].split(" / "), row[3:], strict=True), start=1):
            if "≠" in cell and order.index(word(cell)) <= order.index(expected[wanted]):
                worse.append((attack_of(row), row[1], level))
    assert worse == WORSE
    assert "except for A8 wideband and chirp at level 1" in " ".join(TEXT.split())
