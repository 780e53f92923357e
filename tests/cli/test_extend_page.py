"""docs/extend.md does what it says: every file is complete and short, and every command of the page runs."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from extend_page import Section, no_parts, sections, write_page
from vestige.campaign.store.results import open_dataset
from vestige.cli.main import main, vestige

LONGEST = 40  # lines of a file
SECTIONS = sections()
ADDS = {
    "my_detector": ("detector", "my_detector:RelativePeak"),
    "my_check": ("check", "early power"),
    "my_memory_check": ("check", "early power of 10 RECS"),
}


def test_there_is_one_part_of_each_kind() -> None:
    titles = [section.title for section in SECTIONS.values()]
    assert titles == ["A detector", "An attack", "An error model", "A check", "A check with memory"]


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_a_file_is_complete_and_short(section: Section) -> None:
    assert len(section.source.splitlines()) <= LONGEST
    compile(section.source, section.module, "exec")


@pytest.mark.parametrize(
    "section",
    # the commands of the detector measure a table of threats
    [pytest.param(one, marks=[pytest.mark.slow] if name == "my_detector" else []) for name, one in SECTIONS.items()],
    ids=SECTIONS,
)
def test_the_commands_run(section: Section, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_page(tmp_path)
    (tmp_path / f"{section.module}.toml").rename(tmp_path / "own.toml")
    monkeypatch.chdir(tmp_path)
    said, name = "", ADDS.get(section.module, ("", ""))[1]
    for line in section.commands:
        program, *words = shlex.split(line)
        assert program == "vestige"
        with no_parts():
            result = CliRunner().invoke(vestige, words, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        said += result.stdout
    results = open_dataset(Path(f"{section.module.removeprefix('my_')}.zarr"))
    assert results.attrs["own_parts"].startswith(f"{section.module}:")
    if section.module in ADDS:
        assert str(results[ADDS[section.module][0]].values[-1]) == name
        assert name in said
    for page in Path().glob("*.html"):
        assert page.read_text(encoding="utf-8").count(name) > 1


def test_a_part_that_fails_is_one_line_of_the_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Whatever an attack or an error model raises, in the line of the user's file."""
    write_page(tmp_path)
    path = tmp_path / "my_error.py"
    path.write_text(path.read_text().replace("model = self.model", "model = self.modell"))
    line = path.read_text().splitlines().index("        model = self.modell") + 1
    words = ["run", str(tmp_path / "my_error.toml"), "--parts", str(tmp_path), "-o", str(tmp_path / "a.zarr")]
    with no_parts(), pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 1
    said = capfd.readouterr().err
    what = (
        f"my_error: found line {line} of {path} raises AttributeError: 'GustsProcess' object has no attribute 'modell'"
    )
    assert f"vestige: {what}, expected no error" in said
