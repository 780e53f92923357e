from __future__ import annotations

import io
import sys

import pytest

from vestige.campaign.run import RunProgress
from vestige.cli.progress import campaign_progress, progress


def test_without_a_terminal_each_step_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with progress() as report:
        for step in ("first", "second"):
            for done in range(3):
                report(step, done, 3)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == ["first", "second"]


def test_without_a_terminal_a_long_step_says_each_half_minute_what_is_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = 100.0
    monkeypatch.setattr("vestige.cli.progress.time.monotonic", lambda: now_s)
    with progress() as report:
        for done in range(20, 101):  # 20 were done before
            report("attacked runs", done, 100)
            now_s += 1.0
    assert capsys.readouterr().err.splitlines() == [
        "attacked runs",
        "attacked runs: 50 of 100, 50 s left",
        "attacked runs: 80 of 100, 20 s left",
    ]


def test_on_a_terminal_there_is_a_bar(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    terminal = io.StringIO()
    terminal.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress() as report:
        report("E1 search", 3, 36)
    assert capsys.readouterr().out == ""
    assert "E1 search" in terminal.getvalue()
    assert "3/36" in terminal.getvalue()


def _campaign(done: int) -> RunProgress:
    return RunProgress(epochs_done=done, epochs_total=4000, epochs_resumed=1000, elapsed_s=2.0)


def test_a_campaign_without_a_terminal_is_a_line_each_half_minute(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = 100.0
    monkeypatch.setattr("vestige.cli.progress.time.monotonic", lambda: now_s)
    with campaign_progress() as report:
        for done in range(1000, 4000, 10):
            report("harsh", _campaign(done))
            now_s += 0.5
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "harsh: 1600 of 4000 epochs, 300 epochs/s, 8 s left",
        "harsh: 2200 of 4000 epochs, 600 epochs/s, 3 s left",
        "harsh: 2800 of 4000 epochs, 900 epochs/s, 1 s left",
        "harsh: 3400 of 4000 epochs, 1200 epochs/s, 0 s left",
    ]


def test_a_campaign_on_a_terminal_has_a_bar(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal = io.StringIO()
    terminal.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "120")
    with campaign_progress() as report:
        report("harsh", _campaign(1000))
        for done in range(1000, 3000):
            report("harsh", _campaign(done + 1))
    assert capsys.readouterr().out == ""
    shown = terminal.getvalue()
    assert "3000/4000" in shown
    assert "1000 epochs/s, 1 s left" in shown
    assert shown.count("harsh") < 20, "redrawn by time, not by chunk"
