"""What the documents say is true: source keys, paths, names, commands, the Python of README.md."""

from __future__ import annotations

import ast
import importlib
import io
import re
import runpy
import shlex
import tokenize
from collections.abc import Iterator
from decimal import Decimal
from functools import cache
from pathlib import Path

import click
import pytest

import vestige
from vestige.cli.main import VERBS

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "vestige"
README = ROOT / "README.md"
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
SOURCES = sorted(PACKAGE.rglob("*.py"))
TESTS = sorted(path for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__))

# [KEY] or [KEY, place]: an upper-case first letter, then letters, digits, hyphens, words; no subscript, no link
_KEY = re.compile(r"(?<![\w\])])\[([A-Z][A-Za-z0-9]+(?:[ -][A-Za-z0-9-]+)*)(?:,\s[^\[\]]*)?\](?!\()")
_SPAN = re.compile(r"`([^`]+)`")
_LINK = re.compile(r"\]\(([^)#\s]+)\)")
_FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _prose(path: Path) -> str:
    """Return a document without its fenced blocks."""
    return _FENCE.sub("", path.read_text())


def _spans(path: Path) -> list[str]:
    return _SPAN.findall(_prose(path))


def _rows(path: Path, header: str) -> Iterator[list[str]]:
    """Yield the cells of every row below each header line of a document that begins with `header`."""
    inside = False
    for line in path.read_text().splitlines():
        inside = line.startswith("|") and (inside or line.startswith(f"| {header} |"))
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if inside and cells[0] != header and set(cells[0]) != {"-"}:
            yield cells


# --- source keys


def _comments_and_docstrings(path: Path) -> str:
    text = path.read_text()
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    parts = [ast.get_docstring(node) or "" for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return "\n".join(parts + [token.string for token in tokens if token.type == tokenize.COMMENT])


@cache
def _keys_of(path: Path) -> set[str]:
    if not _KEY.search(path.read_text()):
        return set()
    text = _comments_and_docstrings(path) if path.suffix == ".py" else _SPAN.sub("", _prose(path))
    return set(_KEY.findall(text))


@pytest.fixture(scope="module")
def references() -> list[str]:
    """The keys of docs/references.md, in its order."""
    return [cells[0].strip("[]") for cells in _rows(ROOT / "docs" / "references.md", "key")]


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("of [WFO, Sec. III-B], [OS-ICD]", ["WFO", "OS-ICD"]),
        ("wrapped [OSNMA-ICD,\n6.2]", ["OSNMA-ICD"]),
        ("[FIPS 186-4, D.1.2.3] [IERS Bulletin C] [Kaplan2006]", ["FIPS 186-4", "IERS Bulletin C", "Kaplan2006"]),
        ("complex128[N], x[Key], [T] [n_taps] [PRN_D 8, not in tag0] [tag | PRN_D 8] [A](b.md) [0, B/2]", []),
    ],
)
def test_what_counts_as_a_source_key(text: str, keys: list[str]) -> None:
    assert _KEY.findall(text) == keys


def test_every_source_key_resolves(references: list[str]) -> None:
    unknown = {_name(path): _keys_of(path) - set(references) for path in (*SOURCES, *TESTS, *DOCUMENTS)}
    assert {name: keys for name, keys in unknown.items() if keys} == {}


def test_every_reference_is_used(references: list[str]) -> None:
    used = set().union(*(_keys_of(path) for path in SOURCES))
    assert set(references) - used == set()


def test_references_are_in_order_and_complete(references: list[str]) -> None:
    assert references == sorted(set(references), key=str.casefold)
    for cells in _rows(ROOT / "docs" / "references.md", "key"):
        assert len(cells) == 5, cells[0]
        assert all(cells), cells[0]


# --- paths and names


def _find(path: str) -> Path | None:
    """Return the file or folder that a path means, from the root of the repository or from the package."""
    return next((found for base in (ROOT, PACKAGE) if (found := base / path).exists()), None)


@cache
def _defined_in(path: Path) -> set[str]:
    """Return the names of the classes, functions and variables at the top of a Python file."""
    names: set[str] = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        for target in getattr(node, "targets", [getattr(node, "target", None)]):
            if isinstance(target, ast.Name):
                names.add(target.id)
    return names


def _missing(span: str) -> str:
    """Return what does not exist of a code span that looks like a path, `""` if all is there or it is none."""
    match = re.fullmatch(r"([\w.-]*[\w.-]/[\w./-]*|[\w-]+\.py)(?:::(\w+))?", span)
    if match is None:
        return ""
    found = _find(match[1])
    if found is None:
        return span
    return span if match[2] and match[2] not in _defined_in(found) else ""


@pytest.mark.parametrize(
    ("span", "there"),
    [
        ("tests/architecture/test_docs.py::test_missing_is_seen", True),
        ("crypto/recs/recs_segment.py::LENGTHS", True),
        (".ci/run", True),
        ("docs/", True),
        ("P_fa", True),
        ("make demo", True),
        ("recording.toml", True),
        ("records/checks.py::CheckSeries", True),
        ("tests/architecture/test_docs.py::test_of_nothing", False),
        ("tests/unit/x.py", False),
        ("crypto/aes.py", False),
        ("nothing.py", False),
    ],
)
def test_missing_is_seen(span: str, there: bool) -> None:
    assert (_missing(span) == "") is there


def test_every_path_in_a_document_exists() -> None:
    spans = [(_name(path), span) for path in DOCUMENTS for span in _spans(path) if _missing(span)]
    links = [(path, target) for path in DOCUMENTS for target in _LINK.findall(_prose(path))]
    assert spans == []
    assert [(_name(path), target) for path, target in links if not (path.parent / target).exists()] == []


def test_every_page_that_the_program_names_exists() -> None:
    named = {(_name(path), page) for path in SOURCES for page in re.findall(r"docs/[\w/.]+\.md", path.read_text())}
    assert {page for _, page in named} >= {"docs/vestigial_search.md", "docs/scenarios.md"}
    assert {(path, page) for path, page in named if not (ROOT / page).exists()} == set()


# --- the paper map


STATUSES = {"done", "deviation", "open"}
PAPER_MAP = list(_rows(ROOT / "docs" / "paper_map.md", "the paper"))


def test_a_row_of_the_paper_map_says_what_is_true_of_it() -> None:
    assert PAPER_MAP
    for cells in PAPER_MAP:
        assert len(cells) == 5, cells
        _, module, test, _, status = cells
        word = status.split(":")[0]
        assert word in STATUSES, cells
        if word != "open":
            assert _SPAN.findall(module), f"what is done is done somewhere: {cells}"
            assert _SPAN.findall(test), f"what is done is tested: {cells}"
        assert all(span.startswith("tests/") for span in _SPAN.findall(test)), cells
        assert ("DESIGN.md" in status) is (word == "deviation"), cells


def test_the_paper_map_is_complete() -> None:
    """Sections I to VII, 3 equations, 15 figures, the steps of both detectors and of the levels, 17 errata."""
    points = [cells[0] for cells in PAPER_MAP]
    wanted = [
        *(f"II, assumption {i}" for i in range(3)),
        *(f"II-A, {i}" for i in ("1", "2", "3a and 3b", "3c", "3d")),
        *(f"III-A, step {i}" for i in range(1, 7)),
        *(f"III-B, step {i}" for i in range(1, 6)),
        *("IV-A, step 1", "IV-A, step 2"),
        *(f"IV-B, step {i}" for i in range(3, 6)),
        *(f"IV-C, step {i}" for i in range(4, 8)),
        *(f"Fig. {i}" for i in range(1, 16)),
        *(f"Eq. {i}" for i in range(1, 4)),
        *("I:", "II-B:", "III-D:", "III-E:", "VI-A:", "VI-B:", "VII:"),
    ]
    for want in wanted:
        assert any(re.search(rf"(?<!\w){re.escape(want)}(?!\w)", point) for point in points), want
    assert len(points) == len(set(points))
    errata = [cells[0] for cells in _rows(ROOT / "docs" / "paper_map.md", "no.")]
    assert errata == [f"E{i}" for i in range(1, 18)]


# --- commands


def _commands(program: str) -> list[tuple[str, str]]:
    """Return the documents and the commands of a program in them."""
    found = []
    for path in DOCUMENTS:
        lines = [line for _, block in _FENCE.findall(path.read_text()) for line in block.splitlines()]
        found += [(_name(path), " ".join(line.split())) for line in lines + _spans(path)]
    return [(document, line) for document, line in found if line.startswith(f"{program} ")]


VESTIGE = _commands("vestige")


def test_every_command_in_a_document_can_be_typed() -> None:
    for document, line in VESTIGE:
        words = shlex.split(line, comments=True)[1:]
        assert words[0] in VERBS, (document, line)
        command = importlib.import_module(f"vestige.cli.{VERBS[words[0]][0]}").command
        words = words[1:]
        if isinstance(command, click.Group) and words:  # a group alone lists its commands
            command, words = command.get_command(click.Context(command), words[0]), words[1:]
        assert command is not None, f"no such verb in the group: {document}: {line}"
        options = {name for option in command.params for name in (*option.opts, *option.secondary_opts)} | {"--help"}
        given = {word.split("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert given - options == set(), (document, line)


def test_the_readme_shows_commands() -> None:
    verbs = {line.split()[1] for document, line in VESTIGE if document == "README.md"}
    assert {"process", "inspect", "osnma", "recs", "theory"} <= verbs


def test_every_make_target_in_a_document_exists() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    given = {word for _, line in _commands("make") for word in shlex.split(line, comments=True)[1:]}
    assert {"demo", "test"} <= given
    assert given - targets == set()


# --- Python and TOML of README.md


def _block(language: str) -> str:
    (block,) = [block for found, block in _FENCE.findall(README.read_text()) if found == language]
    return block


def _attributes_of(name: str) -> set[str]:
    """Return every X of `name.X` in the Python of README.md."""
    return {
        node.attr
        for node in ast.walk(ast.parse(_block("python")))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == name
    }


def test_the_python_of_the_readme_uses_what_there_is() -> None:
    assert _attributes_of("vs")
    assert _attributes_of("vs") <= set(vestige.__all__)
    assert _attributes_of("verdict") <= set(vestige.Verdict.__dataclass_fields__)


def test_toml_and_python_of_the_readme_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On two nearly empty sample files: no verdict, and the two numbers at the end as the comments have them."""
    (tmp_path / "night" / "assistance").mkdir(parents=True)
    (tmp_path / "night" / "recording.toml").write_text(_block("toml"))
    for name in ("L1.bin", "L6.bin"):
        (tmp_path / "night" / name).write_bytes(bytes(240))
    (tmp_path / "ten_lines.py").write_text(_block("python"))
    monkeypatch.chdir(tmp_path)
    names = runpy.run_path("ten_lines.py")

    description = names["source"].recording.description
    assert {band.value for band in description.bands} == {"E1", "E6"}
    assert description.time_uncertainty_s == 1.0
    comments = re.findall(r"^print\(vs\..*  # ([\d.]+)", _block("python"), re.MULTILINE)
    assert comments == ["0.99999565", "37.654"]
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == len(comments)
    for value, comment in zip(printed, comments, strict=True):
        assert str(Decimal(value).quantize(Decimal(comment))) == comment


def lost_text(page: str) -> list[str]:
    """Return the lines of a page that Markdown shows in another way than they are meant.

    A line that begins with % is a comment. A table needs a second line of dashes, the same number of cells in each row,
    and no text directly before it. A line break in the description of a picture joins two words.
    """
    lines = re.sub(r"^```.*?^```", lambda code: "\n" * code[0].count("\n"), page, flags=re.M | re.S).split("\n")
    found = [line for line in lines if re.match(r" *%", line) or re.search(r"!\[[^\]]*$", line)]
    for before, line, after in zip(["", *lines], lines, [*lines[1:], ""], strict=False):
        if not line.startswith("|"):
            continue
        cells = len(re.findall(r"(?<!\\)\|", line))
        if not before.startswith("|"):
            whole = not before.strip() and re.fullmatch(r"\|[-:| ]+\|", after)
        else:
            whole = cells == len(re.findall(r"(?<!\\)\|", before))
        if not (whole and line.rstrip().endswith("|")):
            found.append(line)
    return found


@pytest.mark.parametrize(
    "page",
    [
        "at least 95\n% of the runs",
        "![two\nwords](a.png)",
        "| a | b |\n\n|---|---|\n| 1 | 2 |",
        "| a | b |\n|---|---|\n| 1 | 2 |\n\n| 3 | 4 |",
        "| a | b |\n|---|---|\n| 1 |",
        "Text:\n| a |\n|---|\n| 1 |",
    ],
)
def test_lost_text_is_seen(page: str) -> None:
    assert lost_text(page)
    assert not lost_text("Text, 95 %\n\n| a \\| b | c |\n|---|---|\n| 1 | 2 |\n\n```text\n| no table\n```\n")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda one: str(one.relative_to(ROOT)))
def test_no_text_of_a_page_is_lost(document: Path) -> None:
    assert lost_text(document.read_text(encoding="utf-8")) == []
