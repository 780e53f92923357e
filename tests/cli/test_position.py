"""`process --navigation`: a recording of five satellites of a real geometry gives its place, as text and as JSON."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import click
import numpy as np
import pynmea2
import pytest
from jsonschema import Draft202012Validator

from night import invoke
from vestige.cli.outputs.other_programs import ENDINGS
from vestige.cli.outputs.verdict_lines import verdict_line_schema, verdict_schema
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.services.recs_make import command as recs_make
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.time import GalileoTime
from whole_sky import sky

START = GalileoTime.parse("2026-11-21T12:00:16 GST")
ORBITS = walker_ephemerides(GalileoTime.parse("2026-11-21T12:00:00 GST"))
PLACE = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)
BIAS = ("--hardware-bias-m", 0, "--search-window", 4e-4)


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    room = tmp_path_factory.mktemp("position")
    at_s = np.zeros(1)
    view = sky(ORBITS, START, at_s, PLACE.motion(at_s), mask_deg=15.0)
    up = [k for k in range(len(view.svids)) if view.in_view[0, k]][:5]
    satellites = "".join(
        f"[[satellite]]\nsvid = {view.svids[k]}\nrange_m = {view.range_m[0, k]!r}\n"
        f"range_rate_mps = {view.rate_mps[0, k]!r}\ncn0_e1_dbhz = 47.0\ncn0_e6_dbhz = 49.0\n"
        for k in up
    )
    head = f'kind = "recording"\nseed = 5\nstart = "{START}"\nduration_s = 0.125\n[receiver]\nsample_rate_hz = 6.2e6\n'
    (room / "scenario.toml").write_text((head + satellites).replace("np.float64(", "").replace(")", ""))
    assert invoke(simulate, room / "scenario.toml", "-o", room / "night").exception is None
    made = invoke(
        recs_make, "--from-recording", room / "night", "--keys", room / "night" / "osnma" / "keys.csv",
        "--public-key", room / "night" / "osnma" / "public_key.pem", "-o", room / "night" / "assistance",
        "--svids", ",".join(str(view.svids[k]) for k in up),
    )  # fmt: skip
    assert made.exception is None
    write_rinex_navigation(room / "night.rnx", ORBITS)
    return room / "night"


@pytest.mark.slow
@pytest.mark.parametrize("level", [1, 2])
def test_five_authentic_ranges_are_a_position(night: Path, level: int) -> None:
    navigation = ("--navigation", night.parent / "night.rnx", "--level", level)
    found = json.loads(invoke(process, night, *BIAS, *navigation, "--json").stdout)
    (position,) = found["positions"]
    assert [one["status"] for one in found["verdicts"]] == ["AUTHENTIC"] * 5
    assert position["svids"] == [one["svid"] for one in found["verdicts"]]
    assert position["earlier"] == []
    # 1e-4 degrees are 11 m; 100 ms of E1 tell a range to a metre or two
    assert position["latitude_deg"] == pytest.approx(48.0, abs=2e-4)
    assert position["longitude_deg"] == pytest.approx(11.0, abs=2e-4)
    assert position["height_m"] == pytest.approx(500.0, abs=40.0)
    assert {one["available_at"] for one in found["verdicts"]} == {position["available_at"]}
    assert 5 < position["latency_s"] < 90


@pytest.mark.slow
def test_it_is_printed_and_a_line_of_a_recording_that_is_followed(night: Path) -> None:
    navigation = ("--navigation", night.parent / "night.rnx")
    printed = invoke(process, night, *BIAS, *navigation).stdout
    (line,) = (line for line in printed.splitlines() if line.startswith("  position "))
    assert "from 5 authentic ranges, known after" in line
    followed = invoke(
        process, night, *BIAS, *navigation, "--follow", "--json", "--idle-s", 0.2, "--poll-s", 0.02,
        "--time-uncertainty", 0.02,
    )  # fmt: skip
    assert followed.exception is None
    kinds = [json.loads(line)["kind"] for line in followed.stdout.splitlines()]
    assert kinds == ["verdict"] * 5 + ["position"] + ["state"] * 5 + ["end"]


@pytest.mark.slow
def test_other_programs_get_the_position(night: Path, tmp_path: Path) -> None:
    """`process` replaces the files, `live` continues them; the JSON is what its schema says."""
    navigation = ("--navigation", night.parent / "night.rnx", "--json")
    files = [tmp_path / f"night{ending}" for ending in ENDINGS]
    outputs = [item for path in files for item in ("--positions", path)]
    live = ("--follow", "--idle-s", 0.2, "--poll-s", 0.02, "--time-uncertainty", 0.02)
    whole, line_by_line = Draft202012Validator(verdict_schema()), Draft202012Validator(verdict_line_schema())
    for n_positions, more in ((1, ()), (1, ()), (2, live)):
        result = invoke(process, night, *BIAS, *navigation, *outputs, *more)
        assert result.exception is None
        printed = [json.loads(line) for line in result.stdout.splitlines()]
        for one in printed:
            (line_by_line if more else whole).validate(one)
        (position,) = [one for one in printed if one["kind"] == "position"] if more else printed[0]["positions"]
        assert position["orbits_authenticated"]
        nmea, table, geojson, kml = (path.read_text() for path in files)
        assert [pynmea2.parse(line).is_valid for line in nmea.splitlines()] == [True] * 2 * n_positions
        rows = list(csv.DictReader(table.splitlines()))
        assert [row["svids"] for row in rows] == [" ".join(map(str, position["svids"]))] * n_positions
        place = (position["longitude_deg"], position["latitude_deg"], position["height_m"])
        features = json.loads(geojson)["features"]
        assert [tuple(one["geometry"]["coordinates"]) for one in features] == [
            pytest.approx(place, abs=1e-3)
        ] * n_positions
        assert kml.count("<Placemark>") == n_positions


@pytest.mark.slow
def test_mavlink_says_that_it_is_authentic(night: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAVLINK20", "1")
    monkeypatch.setenv("MAVLINK_DIALECT", "development")
    mavutil = pytest.importorskip("pymavlink.mavutil", reason="pymavlink is not installed: vestige[mavlink]")
    more = ("--navigation", night.parent / "night.rnx", "--level", 2, "--mavlink", tmp_path / "night.tlog")
    assert invoke(process, night, *BIAS, *more).exception is None
    log = mavutil.mavlink_connection(str(tmp_path / "night.tlog"))
    said = log.recv_match(type="GNSS_INTEGRITY")
    log.close()
    assert (said.authentication_state, said.spoofing_state, said.raim_state) == (3, 1, 2)
    assert 100 < said.raim_hfom < 2000


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--positions", "night.gpx"), "night.gpx, expected a name that ends in .nmea, .csv, .geojson, .kml, or -"),
        (("--positions", "-", "--json"), "standard output is for --json"),
    ],
)
def test_positions_that_cannot_be_written(night: Path, arguments: tuple[str, ...], expected: str) -> None:
    found = invoke(process, night, *arguments).exception
    assert isinstance(found, click.UsageError)
    assert expected in found.format_message()


@pytest.mark.slow
def test_without_orbits_there_is_none(night: Path) -> None:
    assert json.loads(invoke(process, night, *BIAS, "--json").stdout)["positions"] == []
    assert "position" not in invoke(process, night, *BIAS).stdout


@pytest.mark.slow
def test_orbits_of_the_day_before_are_named(night: Path) -> None:
    old = walker_ephemerides(GalileoTime.parse("2026-11-20T12:00:00 GST"))
    later = walker_ephemerides(GalileoTime.parse("2026-11-20T13:00:00 GST"))
    write_rinex_navigation(night.parent / "old.rnx", (*later, *old))
    expected = (
        f"warning: {night.parent / 'old.rnx'}: no satellites have an ephemeris within 4 h of "
        "2026-11-21T12:00:16.000 GST, "
        "and a position needs 4; the given ephemerides are of 2026-11-20T12:00:00.000 GST "
        "to 2026-11-20T13:00:00.000 GST"
    )
    for more in ((), ("--follow", "--idle-s", 0.2, "--poll-s", 0.02, "--time-uncertainty", 0.02)):
        found = invoke(process, night, *BIAS, "--navigation", night.parent / "old.rnx", *more)
        assert [line for line in found.stderr.splitlines() if "ephemeris" in line] == [expected]
        assert "AUTHENTIC" in found.stdout
        assert "position" not in found.stdout
    good = invoke(process, night, *BIAS, "--navigation", night.parent / "night.rnx")
    assert "ephemeris" not in good.stderr
