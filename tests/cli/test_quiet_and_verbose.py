"""`--quiet` and `-v` change what is printed on standard error, and nothing else."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from vestige.cli.main import VERBS, main, vestige
from vestige.cli.progress import progress
from vestige.cli.terminal import Amount, _choose, note, usual_amount, warn

QUICK = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
ATTACK = '[[attack]]\nkind = "meaconing"\nstart_s = {:.1f}\ndelay_s = 1e-5\npower_db = 3.0\n'
TWO_WARNINGS = ATTACK.format(1e7) + ATTACK.format(1e8)


def _ended(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, list[str]]:
    with pytest.raises(SystemExit) as stop:
        main([str(one) for one in arguments])
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, err.splitlines()


def _commands(command: click.Command, *names: str) -> Iterator[tuple[str, click.Command]]:
    if not isinstance(command, click.Group):
        yield " ".join(names), command
        return
    for name in command.list_commands(click.Context(command)):
        below = command.get_command(click.Context(command), name)
        assert below is not None
        yield from _commands(below, *names, name)


def test_every_command_has_both_options_once() -> None:
    found = dict(_commands(vestige))
    assert {"process", "search e1", "osnma verify"} <= found.keys()
    assert {name.split()[0] for name in found} == set(VERBS)
    for name, command in found.items():
        options = [option for one in command.params for option in one.opts]
        assert [options.count(one) for one in ("--quiet", "-v", "--verbose")] == [1, 1, 1], name


def test_warnings_become_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    late = tmp_path / "late.toml"
    late.write_text(QUICK.read_text() + TWO_WARNINGS)
    code, out, err = _ended(capsys, "check", late)
    assert (code, len(err), {line.split(":")[0] for line in err}) == (0, 2, {"warning"})
    assert _ended(capsys, "check", late, "--quiet") == (code, out, ["2 warnings; without --quiet they are printed"])
    late.write_text(QUICK.read_text() + TWO_WARNINGS[: TWO_WARNINGS.rindex("[[")])
    _, _, (only,) = _ended(capsys, "check", late)
    assert _ended(capsys, "check", late, "--quiet")[2] == [only]
    assert _ended(capsys, "check", late)[2] == [only], "the option is for one command"


def test_errors_and_the_exit_status_stay(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    missing = tmp_path / "none.toml"
    expected = _ended(capsys, "check", missing)
    assert expected[0] == 1
    assert _ended(capsys, "check", missing, "--quiet") == expected
    assert _ended(capsys, "check", missing, "-v") == expected
    code, out, err = _ended(capsys, "check", missing, "-v", "--quiet")
    assert (code, out) == (2, "")
    assert "--quiet and -v" in err[-1]


def test_details_name_files_thresholds_workers_and_times(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = ("run", QUICK, "-o", tmp_path / "a", "--set", "epochs=20", "--json")
    usual = _ended(capsys, *command)
    assert usual[2] == []
    assert _ended(capsys, *command, "--quiet") == usual
    code, out, err = _ended(capsys, *command, "-v")
    assert (code, out) == usual[:2]
    assert all(re.match(r" *\d+\.\d\d s  ", line) for line in err)
    for said in (
        f"read {QUICK}: {QUICK.stat().st_size} bytes",
        "number of threads: 1",
        "E6 is detected above 5.678 σ (P_fa 1e-07)",
        "quick: took ",
    ):
        assert sum(said in line for line in err) == 1, said
    assert not logging.getLogger("vestige").handlers


def test_progress_and_notes_are_for_those_who_wait(capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> list[str]:
        note("8 s of samples")
        with progress() as report:
            for step in ("first", "second"):
                report(step, 0, 1)
        return [re.sub(r"\d+\.\d\d s", "T", line).strip() for line in capsys.readouterr().err.splitlines()]

    with usual_amount():
        assert work() == ["8 s of samples", "first", "second"]
        _choose(Amount.DETAILED)
        assert work() == ["8 s of samples", "first", "T  first: took T", "second", "T  second: took T"]
        _choose(Amount.QUIET)
        assert work() == []
        warn("the clock")
    assert capsys.readouterr().err == "warning: the clock\n"
