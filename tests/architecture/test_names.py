"""One public name means one thing in the whole of vestige (DESIGN.md, Names)."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src" / "vestige"
# A contract of many modules: each command line verb has its `command`.
CONTRACTS = {"command"}


def public_names(path: Path) -> set[str]:
    """Return the public names that a module defines at its top level; those that it imports are not its own."""
    found: set[str] = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        found |= {one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)}
    return {name for name in found if not name.startswith("_")}


def test_no_public_name_means_two_things() -> None:
    homes: dict[str, list[str]] = defaultdict(list)
    for path in sorted(SOURCE.rglob("*.py")):
        for name in public_names(path):
            homes[name].append(path.relative_to(SOURCE).as_posix())
    twice = {name: where for name, where in homes.items() if len(where) > 1 and name not in CONTRACTS}
    assert twice == {}
