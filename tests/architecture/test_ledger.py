"""The validation ledger of the site (docs/site/ledger.py) says what the tests say."""

from __future__ import annotations

from dataclasses import replace

import pytest

from conftest import SLOW
from script_loader import REPOSITORY, script

ledger = script(REPOSITORY / "docs" / "site" / "ledger.py", "site_ledger")
FOUND = ledger.judgements()


@pytest.mark.parametrize("one", FOUND, ids=lambda one: one.test.partition("/")[2])
def test_every_number_of_a_figure_is_in_the_test(one: object) -> None:
    assert ledger.unknown_numbers(one) == []


def test_another_number_would_be_seen() -> None:
    one = next(one for one in FOUND if one.figure == "positions within 0.01 m")
    assert ledger.unknown_numbers(replace(one, figure="positions within 0.02 m, 30 %")) == ["0.02", "30 %"]


def test_every_file_with_an_independent_judge_names_it() -> None:
    named = {one.test.partition("::")[0] for one in FOUND}
    asked = [folder for folder in SLOW if folder.name in ("agreement", "golden", "paper")]
    files = {path.relative_to(REPOSITORY).as_posix() for folder in asked for path in folder.glob("test_*.py")}
    assert files - named == set()
    assert {one.by for one in FOUND} == set(ledger.JUDGES)
