"""Rules of plain English that a program can check; CONTRIBUTING.md has the others. `make lint` runs this file.

That a function's docstring begins with a verb is checked by ruff (D401).

A text that explains a parameter, an attribute or an option names a thing: it does not begin with a word that only makes
sense together with the name before it.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
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


def test_no_sentence_begins_with_of_or_whose() -> None:
    begin = re.compile(r"(?:^|[.!?:] |^[-*] )((?:Of|Whose) [a-z0-9][^.]*)", re.MULTILINE)
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *SOURCE.rglob("*.py")]
    found = {
        str(path.relative_to(ROOT)): begin.findall(path.read_text()) for path in pages if path.name != "CHANGELOG.md"
    }
    assert {path: lines for path, lines in found.items() if lines} == {}
