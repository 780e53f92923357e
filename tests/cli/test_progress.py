from __future__ import annotations

import io
import sys

import pytest

from vestige.cli.progress import progress


def test_without_a_terminal_each_step_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with progress() as report:
        for step in ("first", "second"):
            for done in range(3):
                report(step, done, 3)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == ["first", "second"]


def test_on_a_terminal_there_is_a_bar(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    terminal = io.StringIO()
    terminal.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress() as report:
        report("E1 search", 3, 36)
    assert capsys.readouterr().out == ""
    assert "E1 search" in terminal.getvalue()
    assert "3/36" in terminal.getvalue()
