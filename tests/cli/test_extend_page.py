"""docs/extend.md does what it says: every file is complete and short, and every command of the page runs."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from extend_page import Section, sections, write_page
from vestige.campaign.results import open_dataset

LONGEST = 40  # lines of a file
SECTIONS = sections()
ADDS = {
    "my_detector": ("detector", "my_detector:RelativePeak"),
    "my_check": ("check", "early power"),
}


def typed(folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    """Run a command of the page in a process of its own, in a folder."""
    words = shlex.split(line)
    assert words[0] == "vestige"
    program = [sys.executable, "-m", "vestige", *words[1:]]
    return subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False, env=dict(os.environ))  # noqa: S603


def test_there_is_one_part_of_each_kind() -> None:
    titles = [section.title for section in SECTIONS.values()]
    assert titles == ["A detector", "An attack", "An error model", "A check"]


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_a_file_is_complete_and_short(section: Section) -> None:
    assert len(section.source.splitlines()) <= LONGEST
    compile(section.source, section.module, "exec")


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_the_commands_run(section: Section, tmp_path: Path) -> None:
    write_page(tmp_path)
    (tmp_path / f"{section.module}.toml").rename(tmp_path / "own.toml")
    for line in section.commands:
        result = typed(tmp_path, line)
        assert result.returncode == 0, result.stderr
    name = section.module.removeprefix("my_")
    results = open_dataset(tmp_path / f"{name}.zarr")
    assert results.attrs["own_parts"].startswith(f"{section.module}:")
    if section.module in ADDS:
        axis, last = ADDS[section.module]
        assert str(results[axis].values[-1]) == last
