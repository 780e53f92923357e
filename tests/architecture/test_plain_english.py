"""Rules of plain English that a program can check; CONTRIBUTING.md has the others. `make lint` runs this file.

That a function's docstring begins with a verb is checked by ruff (D401).

A text that explains a parameter, an attribute or an option names a thing: it does not begin with a word that only makes
sense together with the name before it.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

import vestige
from vestige.cli.main import VERBS

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "vestige"
OPENERS = ("Of", "That", "Whose", "What", "As", "By", "In")
NO_SUBJECT = ("Of", "Whose", "That", "As", "What", "Where", "Why", "How", "Which")
# The field says reflection or path, step, spoofing signal, received and inverted
HOUSE_WORDS = ("rays?", "treads?", "counterfeits?", "hears?", "heard", "turned round")
STILL_OF = ("sample_processor/tracking/", "sample_processor/search/engines/", "theory/")
HOUSE_WORD = re.compile(rf"\b({'|'.join(HOUSE_WORDS)})\b", re.IGNORECASE)
_ENTRY = re.compile(r"^ {4}[a-z_][\w, ]*\n {8}(\w+) (.*)", re.MULTILINE)


def wrong_entries(text: str) -> list[str]:
    """Return the texts of docstring entries that begin with one of `OPENERS`."""
    return [f"{first} {rest}" for first, rest in _ENTRY.findall(text) if first in OPENERS]


def options_of(command: click.Command) -> Iterator[click.Option]:
    """Yield the options of a command and of the commands below it."""
    yield from (one for one in command.params if isinstance(one, click.Option))
    for below in getattr(command, "commands", {}).values():
        yield from options_of(below)


@pytest.mark.parametrize("line", ["Of E1-C.", "What the attacker does.", "As below."])
def test_such_an_entry_is_seen(line: str) -> None:
    docstring = f'    """Return it.\n\n    Parameters\n    ----------\n    power\n        {line}\n    """'
    assert wrong_entries(docstring) == [line]


def test_no_parameter_is_explained_by_half_a_sentence() -> None:
    found = {str(path.relative_to(SOURCE)): wrong_entries(path.read_text()) for path in SOURCE.rglob("*.py")}
    assert {path: lines for path, lines in found.items() if lines} == {}


@pytest.mark.parametrize("verb", VERBS)
def test_every_option_is_explained_in_a_sentence(verb: str) -> None:
    """It begins with a capital letter, and has a full stop before whatever stands in brackets."""
    command = importlib.import_module(f"vestige.cli.{VERBS[verb][0]}").command
    for option in options_of(command):
        assert option.help, (verb, option.name)
        first, text = option.help.split()[0], re.sub(r" *\[[^\]]*\]$", "", option.help)
        assert first[0].isupper(), (verb, option.name, option.help)
        assert first not in OPENERS, (verb, option.name, option.help)
        assert text.endswith("."), (verb, option.name, option.help)


def first_words(text: str) -> list[str]:
    """Return the first word of the docstring of each module, class and function of a Python file."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    return [words[0] for node in nodes if (words := (ast.get_docstring(node) or "").split())]


def test_docstrings_begin_with_their_subject() -> None:
    words = [word for path in SOURCE.rglob("*.py") for word in first_words(path.read_text(encoding="utf-8"))]
    assert {word for word in words if word in NO_SUBJECT} == set()
    assert first_words('"""What comes."""\nclass A:\n    """Of it."""') == ["What", "Of"]


@pytest.mark.parametrize("name", vestige.__all__)
def test_a_public_name_begins_with_its_subject(name: str) -> None:
    words = (inspect.getdoc(getattr(vestige, name)) or "").split()
    assert words[0] not in (*OPENERS, "Where", "Why", "How", "Which", "From"), name


def prose(text: str) -> Iterator[str]:
    """Yield docstrings and comments of a Python file, `code` emptied and without the lines of examples."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = (ast.get_docstring(node) for node in ast.walk(ast.parse(text)) if isinstance(node, documented))
    lines = [line for one in docstrings for line in (one or "").split("\n") if ">>>" not in line]
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    lines += [token.string for token in tokens if token.type == tokenize.COMMENT]
    yield from (re.sub(r"`[^`]*`", "``", line) for line in lines)


def house_words(text: str) -> list[str]:
    """Return the lines of prose with a word of `HOUSE_WORDS`; few files have one anywhere, and are taken apart."""
    if not HOUSE_WORD.search(text):
        return []
    return [line for line in prose(text) if HOUSE_WORD.search(line)]


def comments_without_subject(text: str) -> list[str]:
    """Return the comments that begin with "of": `x = 1  # of a satellite`."""
    if not re.search(r"# *of ", text):  # to split a file into tokens takes long
        return []
    return [line for line in prose(text) if re.match(r"#+ *of ", line)]


def test_prose_has_the_words_of_the_field() -> None:
    found = {
        str(path.relative_to(SOURCE)): house_words(path.read_text(encoding="utf-8")) for path in SOURCE.rglob("*.py")
    }
    assert {path: lines for path, lines in found.items() if lines} == {}
    assert house_words('"""Two rays, `rays`."""\nray_db = 1  # one path') == ["Two rays, ``."]


def test_comments_name_their_subject() -> None:
    """The comments of `STILL_OF` are not mended yet."""
    paths = [path for path in SOURCE.rglob("*.py") if not path.relative_to(SOURCE).as_posix().startswith(STILL_OF)]
    found = {
        str(path.relative_to(SOURCE)): comments_without_subject(path.read_text(encoding="utf-8")) for path in paths
    }
    assert {path: lines for path, lines in found.items() if lines} == {}
    assert comments_without_subject("x = 1  # of a satellite\ny = 2  # share of it") == ["# of a satellite"]


def test_no_sentence_begins_with_of_or_whose() -> None:
    begin = re.compile(r"(?:^|[.!?:] |^[-*] )((?:Of|Whose) [a-z0-9][^.]*)", re.MULTILINE)
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *SOURCE.rglob("*.py")]
    found = {
        str(path.relative_to(ROOT)): begin.findall(path.read_text()) for path in pages if path.name != "CHANGELOG.md"
    }
    assert {path: lines for path, lines in found.items() if lines} == {}
