"""A quiet replay of both bands with the true E1 nulled, as samples through `vestige process`: found with every RECS."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from vestige.cli.main import vestige

NULLED = """
kind = "campaign"
seed = 7
start = "2026-11-21T12:00:00 GST"
epochs = 3
interval_s = 0.4
[line_of_sight]
s0_m = 25_000_000.0
v_mps = -412.0
[recs]
duration_ms = 16
key_delay = 1
[receiver]
cn0_dbhz = 45.0
cn0_e1_dbhz = 45.0
time_uncertainty_s = 0.001
sample_rate_hz = 6.2e6
[[attack]]
kind = "meaconing"
delay_s = 1e-4
power_db = 6.0
bands = ["E1", "E6"]
reception_gain_db = 20.0
[[attack]]
kind = "nulling"
gain_db = -0.3
phase_error_rad = 0.03
"""


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    room = tmp_path_factory.mktemp("nulled")
    (room / "scenario.toml").write_text(NULLED, encoding="utf-8")
    assert _invoke("simulate", room / "scenario.toml", "-o", room / "night").exit_code == 0
    return room / "night"


def _invoke(*arguments: object):  # type: ignore[no-untyped-def]
    return CliRunner().invoke(vestige, [str(argument) for argument in arguments])


def _verdicts(night: Path, level: int) -> list[dict]:
    result = _invoke("process", night, "--level", level, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)["verdicts"]


@pytest.mark.slow
def test_level_2_takes_it_for_the_true_signal(night: Path) -> None:
    assert [one["status"] for one in _verdicts(night, 2)] == ["AUTHENTIC"] * 3


@pytest.mark.slow
def test_level_3_finds_it_with_every_recs_and_where_the_true_signal_is(night: Path) -> None:
    """The RECS before and after are in the same samples; each says by itself that it came twice, 0.1 ms apart."""
    found = _verdicts(night, 3)
    assert [one["status"] for one in found] == ["SPOOFED"] * 3
    assert [one["true_offset_m"] for one in found] == [pytest.approx(-1e-4 * 299_792_458.0, abs=5.0)] * 3
