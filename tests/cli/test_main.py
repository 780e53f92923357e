from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from vestige.cli.main import VERBS, main


def _exit(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, err


def test_help_lists_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = _exit(capsys, "--help")
    assert code == 0
    assert all(verb in out for verb in VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(capsys: pytest.CaptureFixture[str], verb: str) -> None:
    code, out, _ = _exit(capsys, verb, "--help")
    assert code == 0
    assert "Usage: vestige " + verb in out


@pytest.mark.parametrize("arguments", [["nonsense"], ["theory", "--cn0", "many"], ["process"], ["check"]])
def test_usage_errors_exit_with_2(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    code, out, err = _exit(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert "Usage" in err


def test_bad_input_exits_with_1_and_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("seed = 'one'")
    for arguments in (["check", str(bad)], ["check", str(tmp_path / "none.toml")], ["process", str(tmp_path / "none")]):
        code, out, err = _exit(capsys, *arguments)
        assert code == 1
        assert out == ""
        assert len(err.strip().splitlines()) == 1
        assert err.startswith("vestige: ")
        assert str(tmp_path) in err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = _exit(capsys, "--version")
    assert code == 0
    assert out.startswith("vestige 0.")


def test_the_package_can_be_run_as_a_module() -> None:
    done = subprocess.run([sys.executable, "-m", "vestige", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("vestige ")
