"""The reference of the Python interface: a page for each public name, and for each that a guide or example imports."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import staging

import vestige
from vestige import plots, threats

PACKAGE = Path(vestige.__file__).parent
_PYTHON = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
# Commands have a reference of their own.
_WITHOUT = ("cli", "__main__")

INTERFACE = """\
Python interface
================

Use these names in scripts and notebooks. Each name has a page with its parameters, units and errors.

vestige
-------

``import vestige as vs``, then ``vs.open_recording`` and so on. These names are the public interface.

{vestige}
vestige.plots
-------------

Each function draws one figure of the results of a campaign: ``vs.plots``.

{plots}
vestige.threats
---------------

These names measure the threat table, or an attack of your own: ``vs.threats``.

{threats}
Names that the guides and the gallery import
--------------------------------------------

They serve to write parts of your own, and to look into single steps of the processing. They may move to another module
between releases.

{others}
"""
MODULES = """\
Modules
=======

Look here for the module that has a part of vestige which you want to read or import. The first sentence of each module
says what it is for. ``python -m pydoc MODULE`` prints its names, parameters and errors.

"""


def public_names() -> dict[str, list[str]]:
    """Return the full names of the public interface, by the section that lists them."""
    modules = {"plots": plots, "threats": threats}
    found = {"vestige": [f"vestige.{name}" for name in vestige.__all__ if name not in modules]}
    return found | {name: [f"vestige.{name}.{one}" for one in module.__all__] for name, module in modules.items()}


def places() -> set[Path]:
    """Return where Sphinx writes the page of each name."""
    names = [*imported_names(), *(name for names in public_names().values() for name in names)]
    return {Path("reference/python") / f"{name}.rst" for name in names}


def imported_names() -> list[str]:
    """Return the full names of everything that guides, gallery and examples import from modules of vestige."""
    texts = [block for path in staging.documents() for block in _PYTHON.findall(path.read_text(encoding="utf-8"))]
    scripts = (*(staging.ROOT / "docs" / "gallery").rglob("*.py"), *(staging.ROOT / "examples").glob("*.py"))
    texts += [path.read_text(encoding="utf-8") for path in scripts]
    found = set()
    for text in texts:
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("vestige."):
                found |= {f"{node.module}.{one.name}" for one in node.names}
    public = {id(_value(name)) for names in public_names().values() for name in names}
    return sorted(name for name in found if id(_value(name)) not in public and _is_documented(_value(name)))


def _value(name: str) -> object:
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def _is_documented(value: object) -> bool:
    """Return whether a value has a docstring of its own: a class or a function, not a number or a table."""
    return inspect.isclass(value) or inspect.isfunction(value)


def modules() -> Iterator[tuple[str, str]]:
    """Yield the name of every module that defines something public, and the first sentence of its docstring."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        if parts[0] in _WITHOUT or parts[-1].startswith("_"):
            continue
        first = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0]
        yield ".".join(("vestige", *parts)), " ".join(first.split()).rstrip(":").replace("*", r"\*").replace("|", r"\|")


def _summary(names: list[str]) -> str:
    return ".. autosummary::\n   :toctree: python\n\n" + "".join(f"   {name}\n" for name in names)


def pages() -> dict[str, str]:
    """Return the pages of the Python reference by their place in the staged tree."""
    text, room = MODULES, ""
    for name, sentence in modules():
        if (now := name.split(".")[1]) != room:
            room = now
            text += f"{room}\n{'-' * len(room)}\n\n"
        text += f"``{name}``\n    {sentence}\n\n"
    interface = INTERFACE.format(
        **{section: _summary(names) for section, names in public_names().items()}, others=_summary(imported_names())
    )
    return {"reference/interface.rst": interface, "reference/modules.rst": text}
