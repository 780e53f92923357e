"""The validation ledger, out of the tests: what each of them says with `@pytest.mark.judged`.

A test that compares vestige with something independent says with what, which capability it judges, and its figure:

    @pytest.mark.judged(by="RTKLIB", what="satellite orbits and clocks", figure="positions within 0.01 m")

Nothing is imported or run: the marks are read from the source. Every number of a figure must be a number of the test,
so a tolerance that changes in the test has to change in the ledger.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("agreement", "golden", "paper", "statistical")
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:,\d{3})*(?:\.\d+)?(?:e-?\d+)?(?: %)?")

FIRST_OF_ITS_OWN = "reference model"  # from this judge on vestige is compared with itself

# Judges, the most independent first. A test that names another judge is an error.
JUDGES = {
    "gnss-sdr": "an independent receiver, which processes the samples that vestige simulates",
    "RTKLIB": "an independent program for positions, orbits and navigation messages",
    "cssrlib": "an independent program for I/NAV and OSNMA",
    "OpenSSL": "vectors that OpenSSL made",
    "independent program": "values that a separate program found in the same files; it has no name and is not public",
    "official test vectors": "the OSNMA test vectors of the operator",
    "published code tables": "the codes of the interface control documents, as text",
    "real recording": "samples of E1 and E6, or navigation messages, that were received on air",
    "real ephemerides": "orbits that were received on air",
    "ICD": "rules of an interface control document",
    "the paper": "numbers, figures and statements of the paper [WFO]",
    "theory": "closed formulas and exact statistical tests, two-sided with a stated error",
    FIRST_OF_ITS_OWN: "a second, straightforward implementation of the equations",
    "tracking loops on samples": "the sample processor, which shares no code with the model that it judges",
    "search of samples": "the searches in samples, which share no code with the model",
    "threat table on samples": "the same scene as samples, through the processor of `vestige process`",
    "truth of the simulation": "what the simulated world knows and the receiver does not",
    "vestige at the other fidelity": "correlators against samples: a check of consistency, by vestige itself",
}

_INTRODUCTION = (
    "Look here before you trust a result: the ledger names each capability, who judges it, its figure, and the "
    "test. It is generated from the marks of the tests. `make test-all` runs all of them. A test whose judge is not "
    "installed is skipped, and the end of `.ci/run` says so.\n\n"
    f"**The sections from *{FIRST_OF_ITS_OWN}* on are not independent**: they compare two parts of vestige, so an "
    "error of both is not seen. PocketSDR, GalileoSASlib and `.sdrx` files of other recorders were "
    "[not tried](../test_cases.md#exports).\n\n"
    "**What was never tested**: RECS of the service, and encrypted E6-C that was received on air. Nothing of both is "
    "public ([what is on air](../idea.md#what-is-on-air-and-where-the-files-come-from)). The real recording has open "
    "E6-C, with RECS that were made for it.\n\n"
    "**Calibrated** figures say so: the scenario was fitted to the number, so the agreement proves little "
    "([the paper map](../paper_map.md#the-harsh-scenario-beside-the-papers-text) has the details).\n\n"
    "To run one test of the ledger, give pytest the file and the name of the test with underscores. The row "
    "`paper/test_numbers.py`, required cn0, is\n\n"
    "```text\n.venv/bin/python -m pytest tests/paper/test_numbers.py -k test_required_cn0\n```"
)
_E6 = re.compile(r"E6|RECS")  # rows that the page gathers at its top


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """One line of the ledger."""

    by: str
    what: str
    figure: str
    test: str  # path and name of the test
    numbers: frozenset[float]  # every number in the test and in what its file shares, without the sign


def _numbers(nodes: Iterator[ast.AST]) -> frozenset[float]:
    values = (one.value for node in nodes for one in ast.walk(node) if isinstance(one, ast.Constant))
    return frozenset(abs(float(value)) for value in values if type(value) in (int, float))


def judgements_in(path: Path) -> Iterator[Judgement]:
    """Yield what the tests of a file say with `judged`.

    Raises `ValueError` if a mark is not complete or names a judge that `JUDGES` lacks.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    tests = [one for one in tree.body if isinstance(one, ast.FunctionDef) and one.name.startswith("test_")]
    shared = [one for one in tree.body if one not in tests]
    for test in tests:
        for mark in test.decorator_list:
            if not (isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.judged"):
                continue
            said = {str(one.arg): ast.literal_eval(one.value) for one in mark.keywords}
            place = f"{path.relative_to(ROOT).as_posix()}::{test.name}"
            if set(said) != {"by", "what", "figure"} or mark.args or said["by"] not in JUDGES:
                raise ValueError(f"{place}: judged({ast.unparse(mark)}): expected by (of JUDGES), what and figure")
            others = [one for one in test.decorator_list if one is not mark]
            numbers = _numbers(iter([*shared, *test.body, *others]))
            yield Judgement(**said, test=place, numbers=numbers)


def judgements() -> tuple[Judgement, ...]:
    """Return every line of the ledger, in the order of the judges."""
    files = (path for folder in FOLDERS for path in sorted((ROOT / "tests" / folder).glob("test_*.py")))
    found = [one for path in files for one in judgements_in(path)]
    return tuple(sorted(found, key=lambda one: list(JUDGES).index(one.by)))


def unknown_numbers(one: Judgement) -> list[str]:
    """Return the numbers of a figure that the test does not hold; a percentage may stand there as a share."""
    missing = []
    for text in _NUMBER.findall(one.figure):
        value = abs(float(text.replace(",", "").removesuffix(" %")))
        allowed = {value} | ({value / 100, 1 - value / 100} if text.endswith("%") else set())
        if not any(abs(number - given) <= 1e-12 * max(1.0, given) for number in one.numbers for given in allowed):
            missing.append(text)
    return missing


def pages() -> dict[str, str]:
    """Return the page of the ledger by its place in the staged tree."""
    found = judgements()
    of_e6 = [one for one in found if _E6.search(f"{one.what} {one.figure}")]
    lines = ["(ledger)=", "# Validation ledger", "", _INTRODUCTION, "", "## Who judged E6 and RECS?", ""]
    lines += ["Rows of the tables below, gathered here:", "", "| judge | capability | figure |", "|---|---|---|"]
    lines += [f"| {one.by} | {one.what} | {one.figure} |" for one in of_e6]
    for judge, who in JUDGES.items():
        rows = [one for one in found if one.by == judge]
        if not rows:
            continue
        lines += [
            "",
            f"## Judged by: {judge}",
            "",
            f"Judge: {who}.",
            "",
            "| capability | figure | test |",
            "|---|---|---|",
        ]
        for one in rows:
            folder, _, name = one.test.removeprefix("tests/").partition("::")
            lines.append(f"| {one.what} | {one.figure} | `{folder}`, {name.removeprefix('test_').replace('_', ' ')} |")
    return {"reference/ledger.md": "\n".join(lines) + "\n"}
