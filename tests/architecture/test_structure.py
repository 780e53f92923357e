"""Rules of the house that a reader could otherwise only hope for. The import layers themselves: `make arch`."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "src" / "vestige"
FILES = sorted(SOURCE.rglob("*.py"))

HEAVY = ("numpy", "scipy", "numba", "matplotlib", "pydantic", "xarray", "cryptography", "sigmf", "jaxtyping", "rich")


@pytest.mark.parametrize("arguments", [["--help"], ["--version"]])
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    program = (
        "import sys\nfrom vestige.cli.main import main\n"
        f"try:\n    main({arguments!r})\nexcept SystemExit as stop:\n    assert stop.code == 0, stop.code\n"
        f"print('LOADED', sorted(set({HEAVY!r}) & set(sys.modules)))"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)  # noqa: S603
    assert result.stdout.splitlines()[-1] == "LOADED []"


def test_importing_the_package_loads_nothing_heavy() -> None:
    program = f"import sys, vestige\nprint(sorted(set({HEAVY!r}) & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)  # noqa: S603
    assert result.stdout.strip() == "[]"


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


def test_public_names_exist() -> None:
    import vestige

    for name in vestige.__all__:
        assert getattr(vestige, name).__module__.startswith("vestige.")
    assert set(dir(vestige)) == set(vestige.__all__)
    with pytest.raises(AttributeError, match="nothing"):
        _ = vestige.nothing
