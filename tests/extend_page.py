"""docs/extend.md in parts: the scenario, and each part with its file, its tables and its commands."""

from __future__ import annotations

import atexit
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

from vestige import own_parts
from vestige.own_parts import own_parts_from, part
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.stored import stored_scenario

PAGE = Path(__file__).resolve().parents[1] / "docs" / "extend.md"
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"\*\*(\w+)\.py\*\*:\n\n```python")


@dataclass(frozen=True)
class Section:
    """A section of the page: the module with its source, the tables for the scenario, and what is typed."""

    title: str
    module: str
    source: str
    tables: str
    commands: tuple[str, ...]


def scenario() -> str:
    """Return the scenario at the top of the page."""
    return next(text for language, text in _BLOCK.findall(PAGE.read_text(encoding="utf-8")) if language == "toml")


def sections() -> dict[str, Section]:
    """Return the sections that have a file, by module."""
    found = {}
    for text in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        if (name := _FILE.search(text)) is None:
            continue
        blocks = dict(_BLOCK.findall(text))
        typed = [block for language, block in _BLOCK.findall(text) if language == "sh"]
        commands = tuple(line for block in typed for line in block.splitlines() if line)
        found[name[1]] = Section(text.partition("\n")[0], name[1], blocks["python"], blocks["toml"], commands)
    return found


def write_page(folder: Path) -> None:
    """Write the files of all parts into a folder, and for each a scenario `<module>.toml` that names it."""
    for section in sections().values():
        (folder / f"{section.module}.py").write_text(section.source, encoding="utf-8")
        (folder / f"{section.module}.toml").write_text(f"{scenario()}\n{section.tables}", encoding="utf-8")


@contextmanager
def no_parts() -> Iterator[None]:
    """Forget all parts for a while, and those that come meanwhile at the end."""
    folders, digests, path = [*own_parts._folders], {**own_parts._digests}, [*sys.path]
    known = _modules_of_parts()
    for name in known:
        del sys.modules[name]
    own_parts._folders.clear()
    own_parts._digests.clear()
    stored_scenario.cache_clear()  # it holds classes
    sys.path[:] = [one for one in path if Path(one) not in folders]
    try:
        yield
    finally:
        stored_scenario.cache_clear()
        for name in _modules_of_parts():
            del sys.modules[name]
        own_parts._folders[:], sys.path[:] = folders, path
        own_parts._digests.clear()
        own_parts._digests.update(digests)
        sys.modules.update(known)


def _modules_of_parts() -> dict[str, ModuleType]:
    folders = set(map(str, own_parts._folders))
    if not folders:
        return {}
    return {
        name: module
        for name, module in sys.modules.items()
        if os.path.dirname(str(getattr(module, "__file__", ""))) in folders  # noqa: PTH120  # of thousands of modules
    }


@cache
def _folder() -> Path:
    """Return a folder with the files of the page, from which parts may come until the tests end."""
    kept = TemporaryDirectory(prefix="extend-")
    atexit.register(kept.cleanup)
    write_page(Path(kept.name))
    own_parts_from(kept.name)
    return Path(kept.name)


def page_part(kind: str) -> Any:
    """Return a class of the page, `my_attack:Swing`."""
    own_parts_from(_folder())  # again, where a test has forgotten all parts
    return part(kind, object)


def page_scenario(module: str, *settings: str) -> CampaignScenario:
    """Return the scenario of the page that names the part of a module."""
    own_parts_from(_folder())
    scenario = load_scenario(_folder() / f"{module}.toml", settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario
