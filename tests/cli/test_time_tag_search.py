"""`vestige process` with a wrong time tag and no observation file: chips that come once tell the time."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.group_delay import inter_frequency_delay_s
from vestige.recording.assistance.folder import read_assistance

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "vestigial.toml"
SMALL = ("--set", "receiver.sample_rate_hz=6.2e6")


def _simulated(folder: Path, *settings: str) -> Path:
    arguments = [str(SCENARIO), "-o", str(folder), *SMALL]
    for one in settings:
        arguments += ["--set", one]
    result = CliRunner().invoke(simulate, arguments, standalone_mode=False)
    assert result.exception is None
    (folder / "observations.csv").unlink(missing_ok=True)
    return folder


def _process(*arguments: object) -> Result:
    result = CliRunner().invoke(process, [*map(str, arguments), "--json"], standalone_mode=False)
    assert result.exception is None
    return result


@pytest.fixture(scope="module")
def clear(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _simulated(tmp_path_factory.mktemp("label") / "clear", "attack=none")


@pytest.mark.parametrize("late_s", [3.3, -11.9, 0.1])
def test_a_wrong_label_is_found_out(clear: Path, late_s: float) -> None:
    start = f"2026-11-21T12:00:{late_s:06.3f} GST" if late_s > 0 else f"2026-11-21T11:59:{60 + late_s:06.3f} GST"
    result = _process(clear, "--start", start)
    (verdict,) = json.loads(result.stdout)["verdicts"]
    assert verdict["status"] == "AUTHENTIC"
    assert abs(verdict["range_offset_m"]) < 6
    size = r"(9\d|10\d) ms" if abs(late_s) < 1 else f"{abs(late_s):.2f} s"  # to the travel time, 10 ms
    assert re.search(f"the time tag is {size} {'ahead of' if late_s > 0 else 'behind'}", result.stderr)


def test_a_right_label_is_left_alone(clear: Path) -> None:
    result = _process(clear)
    assert json.loads(result.stdout)["verdicts"][0]["status"] == "AUTHENTIC"
    assert "late by the RECS" not in result.stderr


def test_the_time_tag_search_takes_the_cipher_mode_of_the_command(clear: Path) -> None:
    """The RECS are encrypted in CBC: decrypted in CTR they are noise, and tell no time."""
    result = _process(clear, "--start", "2026-11-21T12:00:03.300 GST", "--cipher-mode", "ctr")
    assert "no RECS was found within the time tag's" in result.stderr
    assert json.loads(result.stdout)["verdicts"] == []


def test_the_convention_of_group_delays_moves_the_range_offset(clear: Path) -> None:
    offsets_m = [
        json.loads(_process(clear, "--bgd", convention).stdout)["verdicts"][0]["range_offset_m"]
        for convention in ("os-icd", "minus-os-icd")
    ]
    (delay,) = read_assistance(clear / "assistance").assistance.group_delays
    shift_m = 2 * SPEED_OF_LIGHT_MPS * inter_frequency_delay_s(delay.bgd_e1_e6_s)
    assert offsets_m[1] - offsets_m[0] == pytest.approx(shift_m, abs=0.5)
    assert abs(shift_m) > 1.0


def test_a_label_that_is_wrong_by_more_than_it_says_is_not_believed(clear: Path) -> None:
    """±0.5 s around a label 3.3 s late: nothing is found, and the tolerance is stated."""
    result = _process(clear, "--start", "2026-11-21T12:00:03.300 GST", "--time-uncertainty", "0.5")
    assert json.loads(result.stdout)["verdicts"] == []


def test_the_second_coming_is_named(tmp_path: Path) -> None:
    folder = _simulated(tmp_path / "spoofed", "attack.0.delay_s=0.2137")
    shutil.rmtree(folder / "rinex", ignore_errors=True)
    result = _process(folder)
    assert "E11: spoofing: its RECS was found 2 times" in result.stderr
    assert json.loads(result.stdout)["verdicts"][0]["status"] != "AUTHENTIC"
