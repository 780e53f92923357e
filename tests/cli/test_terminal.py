"""What files and their names hold cannot move the cursor of a terminal, nor change what a line says."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest

import vestige
from vestige.campaign.run import RunProgress
from vestige.cli.main import main
from vestige.cli.progress import campaign_progress
from vestige.cli.terminal import echo
from vestige.errors import InputFileError, printable

QUICK = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
# a colour, CSI and next line of C1, delete, right-to-left override, isolate, marks, line breaks, a byte that is no text
EVIL = "\x1b[31m\x9b2J\x85\x7f\u202e\u2066\u200f\u061c\n\r\x07\u2028\udcff"
SHOWN = r"\x1b[31m\x9b2J\x85\x7f\u202e\u2066\u200f\u061c\n\r\x07\u2028\udcff"


def _ended(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[list[str], list[str]]:
    with pytest.raises(SystemExit):
        main([str(one) for one in arguments])
    out, err = capsys.readouterr()
    return out.split("\n")[:-1], err.split("\n")[:-1]


def test_what_a_terminal_would_obey_is_escaped_and_nothing_else() -> None:
    assert printable(EVIL) == SHOWN
    assert printable(SHOWN) == SHOWN
    text = "E11  12.5 °, 3 σ, ±0.2 µs, Δτ ≤ 4 … Ω 漢字 é \\n"
    assert printable(text) == text
    assert all(printable(chr(code)) != chr(code) for code in (*range(32), *range(127, 160), *range(0x202A, 0x202F)))


def test_each_line_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    echo("first\nAUTHENTIC", "second")
    echo()
    echo("third", err=True)
    assert capsys.readouterr() == ("first\\nAUTHENTIC\nsecond\n\n", "third\n")


def test_names_of_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = f"{EVIL}.toml"
    (tmp_path / name).write_text(QUICK.read_text())
    out, err = _ended(capsys, "check", tmp_path / name)
    assert out[0].startswith(f"{tmp_path}/{SHOWN}.toml: campaign")
    assert err == []
    (tmp_path / EVIL).mkdir()
    out, err = _ended(capsys, "inspect", tmp_path / EVIL)
    assert f"{tmp_path}/{SHOWN}: no samples" in [*out, *err]
    for arguments in (
        ("check", tmp_path / f"none{EVIL}"),  # an error of a file
        ("osnma", "verify", tmp_path / name, "--public-key", tmp_path / f"none{EVIL}"),
        ("report", tmp_path, "-o", f"{EVIL}.pdf"),  # a usage error
        ("check", f"--{EVIL}"),
        (EVIL,),
    ):
        out, err = _ended(capsys, *arguments)
        assert out == []
        assert any(r"\x9b2J\x85\x7f\u202e" in line for line in err), arguments
        assert all(line.isprintable() for line in err)


def test_what_a_file_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(QUICK.read_text().replace('kind = "campaign"', f"kind = {json.dumps(EVIL[:6])}"))
    out, (err,) = _ended(capsys, "check", path)
    assert out == []
    assert r"\x1b[31" in err
    xml = tmp_path / "tree.xml"
    xml.write_text("<a>&#x9b;2J&#x202e;</a>", encoding="utf-8")
    out, err = _ended(capsys, "osnma", "verify", xml, "--merkle-tree", xml)
    assert all(line.isprintable() for line in (*out, *err))
    assert str(InputFileError(f"a{EVIL}", "line 1", EVIL, "text")).count(r"\x1b[31m\x9b2J\x85") == 2


def test_the_name_of_a_campaign_in_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names are no markup: `[/]` would end in a traceback."""
    terminal = io.StringIO()
    terminal.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "200")
    with campaign_progress() as report:
        report("[/]\x9b2J\u202e", RunProgress(epochs_done=1, epochs_total=2, epochs_resumed=0, elapsed_s=1.0))
    assert r"[/]\x9b2J\u202e" in terminal.getvalue()
    assert "\u202e" not in terminal.getvalue()


def test_there_is_one_way_to_the_terminal() -> None:
    source = Path(vestige.__file__).parent
    others = [path for path in source.rglob("*.py") if path != source / "cli" / "terminal.py"]
    assert [path.name for path in others if "click.echo(" in path.read_text(encoding="utf-8")] == []
