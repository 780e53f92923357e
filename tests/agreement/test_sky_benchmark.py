"""`benchmarks/sky_gnss_sdr.py` at a small size, and what its figures and its exit status mean."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from gnss_sdr_judge import GST_MINUS_UTC_S, Fixes, ecef, fixes_of, needs_gnss_sdr
from script_loader import benchmark

HERE, HEIGHT_M = (48.1, 11.6), 500.0
LINE = (
    "Position at 2026-Nov-22 22:00:{second:09.6f} UTC using {used} observations is Lat = {latitude:.9f} [deg], "
    "Long = {longitude:.9f} [deg], Height = {height} [m]"
)


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return benchmark("sky_gnss_sdr")


def printed(*heights_m: float, used: int = 7, first_s: float = 40.0) -> str:
    """Return what gnss-sdr prints of fixes above the true place, one each second."""
    return "\n".join(
        LINE.format(
            second=first_s - GST_MINUS_UTC_S + number, used=used, latitude=HERE[0], longitude=HERE[1], height=height_m
        )
        for number, height_m in enumerate(heights_m)
    )


def truth_of(folder: Path, n_epochs: int) -> None:
    """Write the truth of a receiver that stands, as `vestige simulate` does."""
    x_m, y_m, z_m = ecef(*HERE, HEIGHT_M)[0].tolist()
    rows = [f"1422,{79200 + second}.086,{x_m!r},{y_m!r},{z_m!r}" for second in range(n_epochs)]
    (folder / "receiver_truth.csv").write_text("\n".join(["gst_week,gst_second,x_m,y_m,z_m", *rows]) + "\n")


@pytest.mark.parametrize(
    ("heights_m", "used", "first_s", "missed"),
    [
        ((500.0, 501.0), 7, 40.0, []),
        ((500.0, 509.0), 7, 40.0, ["mean of 2 fixes, vertically"]),
        ((500.0, 516.0, 484.0), 7, 40.0, ["largest error"]),
        ((500.0,), 5, 40.0, ["fewest satellites of a fix"]),
        ((500.0,), 7, 61.0, ["first fix"]),
    ],
)
def test_which_limit_is_missed(
    script: ModuleType, tmp_path: Path, heights_m: tuple[float, ...], used: int, first_s: float, missed: list[str]
) -> None:
    truth_of(tmp_path, 90)
    fixes: Fixes = fixes_of(printed(*heights_m, used=used, first_s=first_s))
    assert fixes.at_s[0] == first_s
    figures = [*script.common(fixes), *script.standing(fixes, tmp_path)]
    assert [one.what for one in figures if not one.met] == missed


def test_a_figure_that_could_not_be_measured_is_missed(script: ModuleType) -> None:
    assert not script.Figure(what="Doppler", measured=np.nan, bar=0.5, unit="Hz").met


@pytest.mark.parametrize(("measured", "status"), [(0.4, 0), (0.6, 1)])
def test_the_exit_status_and_the_json(
    script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    measured: float, status: int,
) -> None:  # fmt: skip
    figure = script.Figure(what="Doppler", measured=measured, bar=0.5, unit="Hz")
    monkeypatch.setattr(script, "judged", lambda *_: ([figure], 2))
    monkeypatch.setattr(script.shutil, "which", lambda _: "gnss-sdr")
    with pytest.raises(SystemExit) as stop:
        script.main(["--case", "e6", "--json", str(tmp_path / "found.json")])
    assert stop.value.code == status
    (found,) = json.loads((tmp_path / "found.json").read_text())["figures"]
    assert (found["case"], found["measured"], found["runs"], found["met"]) == ("e6", measured, 2, status == 0)
    row = capsys.readouterr().out.splitlines()[-1]
    assert row == f"| e6 | Doppler | {measured} Hz | at most 0.5 Hz | 2 | {'MISSED' if status else ''} |"


@needs_gnss_sdr
@pytest.mark.judged(
    by="gnss-sdr",
    what="E6-B in the E6 samples that `vestige simulate --export gnss-sdr` writes",
    figure="Doppler within 0.5 Hz, C/N0 within 1.0 dB",
)
def test_it_judges_a_recording_of_the_command(script: ModuleType, tmp_path: Path) -> None:
    """E6-B of two satellites."""
    settings = ["receiver.sample_rate_hz=10.3e6", "constellation.svids=[8, 13]"]
    figures, runs = script.judged("e6", tmp_path / "e6", 9, settings)
    assert 1 <= runs <= 3
    assert [one.bar for one in figures] == [2, 0.5, 1.0]
    assert [one.what for one in figures if not one.met] == []
