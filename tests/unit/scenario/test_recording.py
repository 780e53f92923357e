from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.errors import InputFileError
from vestige.scenario.load import load_scenario
from vestige.scenario.recording import RecordingScenario
from vestige.time import GalileoTime

GOOD = """
kind = "recording"
seed = 1
start = "2026-11-21T12:00:16 GST"
duration_s = 0.13
[[satellite]]
svid = 3
range_m = 2.4e7
cn0_e1_dbhz = 45.0
cn0_e6_dbhz = 47.0
"""


def _load(tmp_path: Path, text: str) -> RecordingScenario:
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    return load_scenario(path)


def test_defaults_are_filled_in(tmp_path: Path) -> None:
    scenario = _load(tmp_path, GOOD)
    assert scenario.start_time == GalileoTime.parse("2026-11-21T12:00:16")
    assert scenario.receiver.sample_rate_hz == 12.5e6
    assert scenario.satellites[0].range_rate_mps == 0.0


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (("seed = 1", "seed = 1\ntypo = 2"), "typo"),
        (("svid = 3", "svid = 3\ncolour = 'red'"), "satellite.0.colour"),
        (("svid = 3", "svid = 37"), "satellite.0.svid"),
        (("range_m = 2.4e7", "range_m = nan"), "satellite.0.range_m"),
        (("2026-11-21T12:00:16 GST", "2026-11-21T12:00:16.5 GST"), "start"),
        (("2026-11-21T12:00:16 GST", "tomorrow"), "start"),
        (("duration_s = 0.13", ""), "duration_s"),
        (("[[satellite]]", "[receiver]\nsample_rate_hz = 1e3\n[[satellite]]"), "receiver.sample_rate_hz"),
        (("cn0_e6_dbhz = 47.0", "cn0_e6_dbhz = 47.0\n" + GOOD[GOOD.index("[[") :]), "satellite"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: tuple[str, str], place: str) -> None:
    with pytest.raises(InputFileError) as error:
        _load(tmp_path, GOOD.replace(*change))
    assert error.value.place == place
    assert "\n" not in str(error.value)


@given(st.text(max_size=200))
def test_garbage_is_one_clear_error(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("garbage") / "scenario.toml"
    path.write_text(text, encoding="utf-8", newline="")
    with pytest.raises(InputFileError):
        load_scenario(path)
