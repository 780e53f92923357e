from __future__ import annotations

import importlib
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from vestige.cli.main import VERBS, main, vestige


def _exit(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, err


def process_context(group: click.Context, arguments: list[str]) -> click.Context:
    command = importlib.import_module(f"vestige.cli.{VERBS['process'][0]}").command
    return command.make_context("process", list(arguments), parent=group)


def test_help_lists_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = _exit(capsys, "--help")
    assert code == 0
    assert all(verb in out for verb in VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(capsys: pytest.CaptureFixture[str], verb: str) -> None:
    code, out, _ = _exit(capsys, verb, "--help")
    assert code == 0
    assert "Usage: vestige " + verb in out


@pytest.mark.parametrize("verb", ["process", "live"])
def test_every_option_of_a_long_list_is_shown_once_in_a_group(capsys: pytest.CaptureFixture[str], verb: str) -> None:
    """`GroupedCommand` leaves no option out, and only the options of every command have no group."""
    _, out, _ = _exit(capsys, verb, "--help")
    command = importlib.import_module(f"vestige.cli.{VERBS[verb][0]}").command
    shown = re.findall(r"^  (?:-\w, )?(--[a-z0-9-]+)", out, re.MULTILINE)
    options = [one for one in command.params if isinstance(one, click.Option)]
    names = [next(name for name in one.opts if name.startswith("--")) for one in options]
    assert len(options) > 30
    assert sorted(shown) == sorted([*names, "--help"])
    rest = re.findall(r"^  (?:-\w, )?(--[a-z-]+)", out.split("\nOther options:\n")[1], re.MULTILINE)
    assert rest == ["--quiet", "--verbose", "--help"]


def test_the_former_option_follow_is_the_verb_live(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = _exit(capsys, "process", "night", "--follow", "--calibrate")
    assert code == 2
    assert "vestige live" in err
    assert "--calibrate" in err


@pytest.mark.parametrize("arguments", [["-"], ["-", "--idle-s", "1"], ["night", "--follow", "--json"]])
def test_standard_input_is_for_the_verb_live(arguments: list[str]) -> None:
    with vestige.make_context("vestige", ["process", *arguments]) as group:
        assert process_context(group, arguments).info_name == "live"


@pytest.mark.parametrize("option", ["--positions", "-o"])
def test_a_dash_as_the_value_of_an_option_is_not_the_recording(tmp_path: Path, option: str) -> None:
    """`--positions -` prints NMEA; it waited for ever for samples that came from standard input."""
    with vestige.make_context("vestige", ["process"]) as group:
        assert process_context(group, [str(tmp_path), option, "-"]).info_name == "process"


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


@pytest.fixture
def not_killed() -> Iterator[None]:
    """SIGTERM that no command catches is an error of the test, not its end."""

    def uncaught(_number: int, _frame: object) -> None:
        raise AssertionError("SIGTERM was not caught")

    before = signal.signal(signal.SIGTERM, uncaught)
    yield
    assert signal.signal(signal.SIGTERM, before) is uncaught  # and is given back


@pytest.mark.usefixtures("not_killed")
@pytest.mark.parametrize("verb", VERBS)
def test_sigterm_is_ctrl_c_for_every_verb(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, verb: str
) -> None:
    @click.command()
    def stopped() -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt as stop:
            stop.add_note("3 of 5 are kept")
            raise

    monkeypatch.setattr(importlib.import_module(f"vestige.cli.{VERBS[verb][0]}"), "command", stopped)
    code, _, err = _exit(capsys, verb)
    assert code == 130
    assert err.splitlines()[-1] == "interrupted; 3 of 5 are kept"


@pytest.mark.usefixtures("not_killed")
def test_sigterm_says_what_a_run_keeps(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from vestige.campaign.store.store import Store

    write = Store.write

    def written(self: Store, chunk: int, results: object) -> None:
        write(self, chunk, results)  # type: ignore[arg-type]
        if chunk == 1:
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(Store, "write", written)
    quick = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
    arguments = ("run", str(quick), "-o", str(tmp_path / "a.zarr"), "--set", "epochs=50", "--chunk", "10")
    code, _, err = _exit(capsys, *arguments)
    assert code == 130
    assert err.splitlines()[-1].startswith("interrupted; ")
    assert f"of 50 epochs are stored in {tmp_path / 'a.zarr'}; the same command continues there" in err
