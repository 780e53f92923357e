"""The gallery: every script of examples/ runs, and says what it should."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest
from PIL import Image

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_every_example_is_run_here() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == {"lift_off.py", "multipath_calibration.py"}


def test_lift_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["lift_off.py", str(tmp_path)])
    runpy.run_path(str(EXAMPLES / "lift_off.py"), run_name="__main__")
    text = capsys.readouterr().out
    assert text.count("The attacker") == 6
    offsets_m = {
        detector: [float(value) for value in re.findall(rf"{detector} +range +([+-][\d.]+) m", text)]
        for detector in ("early", "maximum")
    }
    assert max(map(abs, (offsets_m["early"][0], offsets_m["early"][-1]))) < 2.0
    assert min(offsets_m["early"][3], offsets_m["maximum"][3]) > 4.0
    assert offsets_m["early"][4] < 15.0
    assert offsets_m["maximum"][4] > 30.0
    assert offsets_m["maximum"][-1] > 60.0
    assert re.search(r"early +detector: it returned to the true signal \d+ s after the attack began, and stayed", text)
    assert re.search(r"maximum +detector: it did not return to the true signal for the rest of the attack", text)
    with Image.open(tmp_path / "lift_off.png") as image:
        assert image.size[0] > 1000


@pytest.mark.slow
def test_multipath_calibration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Many channels miss 52 of 100,000: powers that differ by more than 2 dB, with 5000 RECS each."""
    monkeypatch.setattr(sys, "argv", ["multipath_calibration.py", str(tmp_path), "--epochs", "5000"])
    runpy.run_path(str(EXAMPLES / "multipath_calibration.py"), run_name="__main__")
    text = capsys.readouterr().out
    powers_db = [float(value) for value in re.findall(r"^ +[13] +\d+ +(-[\d.]+) ", text, re.MULTILINE)]
    assert len(powers_db) >= 6
    assert max(powers_db) - min(powers_db) > 2
    assert len((tmp_path / "calibration.csv").read_text().splitlines()) == 1 + 2 * 4 * 8
    with Image.open(tmp_path / "calibration.png") as image:
        assert image.size[0] > 1000
