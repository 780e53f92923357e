"""Rules of the house that a reader could otherwise only hope for. The import layers themselves: `make arch`."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "vestige"
FILES = sorted(SOURCE.rglob("*.py"))

HEAVY = ("numpy", "scipy", "numba", "matplotlib", "pydantic", "xarray", "cryptography", "sigmf", "jaxtyping", "rich")


# One process for all: the help of every verb and of the verbs of a group, the version, and the package alone.
HELP = f"""
import sys, contextlib, io
import vestige
print("package", sorted(set({HEAVY!r}) & set(sys.modules)))
import click
from vestige.cli.main import VERBS, main
import importlib
for verb, (module, _) in VERBS.items():
    command = importlib.import_module(f"vestige.cli.{{module}}").command
    groups = ([], *([name] for name in command.commands)) if isinstance(command, click.Group) else ([],)
    for words in ([verb, *group, "--help"] for group in groups):
        with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.suppress(SystemExit):
            main(words)
        assert "Usage:" in printed.getvalue(), words
        print(*words, sorted(set({HEAVY!r}) & set(sys.modules)))
for words in (["--help"], ["--version"]):
    try:
        main(words)
    except SystemExit as stop:
        assert stop.code == 0, stop.code
print("all", sorted(set({HEAVY!r}) & set(sys.modules)))
"""


def test_help_and_the_package_load_nothing_heavy() -> None:
    result = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, check=True)  # noqa: S603
    said = [line for line in result.stdout.splitlines() if line.endswith("]") and not line.startswith(" ")]
    assert [line for line in said if not line.endswith(" []")] == []
    assert said[0] == "package []"
    assert said[-1] == "all []"
    assert {"recs decrypt --help []", "theory --help []", "plot --help []"} <= set(said)


def test_only_tesla_makes_validated_keys() -> None:
    """The constructor refuses everybody but the one kind of tesla.py, which nobody else knows."""
    makers = {
        path.relative_to(SOURCE).as_posix()
        for path in FILES
        if re.search(r"_KeyOfChain|(?<!class )\bValidatedKey\(", path.read_text())
    }
    assert makers == {"crypto/osnma/messages/tesla.py"}


def test_a_file_is_read_in_one_sitting() -> None:
    for path in FILES:
        text = path.read_text()
        assert len(text.splitlines()) <= 400, path
        assert path.stem not in {"utils", "util", "helpers", "common", "misc", "manager", "base"}, path
        assert ast.get_docstring(ast.parse(text)), f"a module says what it is for: {path}"


MOST_MODULES = 12
# Folders with more modules: the number of modules, and the reason
LARGER_FOLDERS = {".": (14, "modules that all folders import (errors, time, streams): each is a layer of its own")}


def test_a_folder_has_at_most_a_dozen_modules() -> None:
    counts = Counter(path.parent.relative_to(SOURCE).as_posix() for path in FILES if path.name != "__init__.py")
    allowed = {folder: most for folder, (most, _) in LARGER_FOLDERS.items()}
    assert {folder: n for folder, n in counts.items() if n > allowed.get(folder, MOST_MODULES)} == {}
    assert all(counts[folder] > MOST_MODULES for folder in allowed), "an exception that is not needed"


def test_public_names_exist() -> None:
    import vestige

    for name in vestige.__all__:
        value = getattr(vestige, name)
        module = value.__name__ if isinstance(value, ModuleType) else value.__module__
        assert module.startswith("vestige.")
    assert set(dir(vestige)) == set(vestige.__all__)
    with pytest.raises(AttributeError, match="nothing"):
        _ = vestige.nothing


def test_the_folders_of_slow_tests_are_those_of_make() -> None:
    """`make test` leaves them out by their names, and `make test-slow` runs what is marked in them."""
    from conftest import SLOW

    (named,) = re.findall(r"^SLOW +:= \$\(addprefix tests/,([a-z ]+)\)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert named.split() == [folder.name for folder in SLOW]
    assert all(any(folder.glob("test_*.py")) for folder in SLOW)
