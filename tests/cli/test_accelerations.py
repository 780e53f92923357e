"""`process --accelerations`: two RECS 0.3 s apart, and a manoeuvre in between that a CSV file explains or does not."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import click
import numpy as np
import pytest

from night import invoke
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.services.recs_make import command as recs_make
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import local_axes_at
from vestige.navigation.line_of_sight import ReceiverMotion
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.recording.live.follow_journal import LINES, FollowJournal, FollowProgress
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime
from whole_sky import sky

START = GalileoTime.parse("2026-11-21T12:00:16 GST")
ORBITS = walker_ephemerides(GalileoTime.parse("2026-11-21T12:00:00 GST"))
PLACE = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0).motion(np.zeros(1))
AXES = local_axes_at(PLACE.position_m)[0]
EAST_MPS2 = 20.0  # for 0.15 s: 3 m/s
FROM_S, TO_S = 0.15, 0.3
N_SATELLITES = 4
STANDS, MOVES = "0,0,0", f"{EAST_MPS2},0,0"
SETTINGS = (
    "--level",
    3,
    "--time-uncertainty",
    0.02,
    "--hardware-bias-m",
    0,
    "--search-window",
    2e-5,
    "--search-ms",
    1,
    "--json",
)


def _motion(at_s: float) -> ReceiverMotion:
    """Stand, be pushed to the east, go on."""
    pushed_s, after_s = min(max(at_s - FROM_S, 0.0), TO_S - FROM_S), max(at_s - TO_S, 0.0)
    speed = EAST_MPS2 * pushed_s
    return ReceiverMotion(
        position_m=PLACE.position_m + (speed * (pushed_s / 2 + after_s)) * AXES[:1],
        velocity_mps=speed * AXES[:1],
        acceleration_mps2=np.zeros((1, 3)),
    )


def _observed(at_s: float, svids: tuple[int, ...]) -> ObservationEpoch:
    view = sky(ORBITS, START, np.array([at_s]), _motion(at_s), mask_deg=15.0)
    observations = {}
    for svid in svids:
        k = view.svids.index(svid)
        rate_mps = float(view.rate_mps[0, k] - view.satellite_clock_mps[0, k])
        observations[svid] = E1Observation(
            svid=svid,
            pseudorange_m=float(view.range_m[0, k] - view.satellite_clock_m[0, k]),
            carrier_phase_cycles=float("nan"),
            doppler_hz=-rate_mps * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS,
            doppler_rate_hz_per_s=0.0,
            cn0_dbhz=47.0,
        )
    return ObservationEpoch(time=START + at_s, observations=observations)


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording whose samples have straight ranges, half a metre at most from those that its observations tell.

    Without E1 samples, in which level 3 would search: E1 is in the observations.
    """
    room = tmp_path_factory.mktemp("inertial")
    view = sky(ORBITS, START, np.zeros(1), PLACE, mask_deg=15.0)
    up = [k for k in range(len(view.svids)) if view.in_view[0, k]][:N_SATELLITES]
    svids = tuple(view.svids[k] for k in up)
    satellites = "".join(
        f"[[satellite]]\nsvid = {view.svids[k]}\nrange_m = {float(view.range_m[0, k])!r}\n"
        f"range_rate_mps = {float(view.rate_mps[0, k])!r}\ncn0_e1_dbhz = 47.0\ncn0_e6_dbhz = 49.0\n"
        for k in up
    )
    head = f'kind = "recording"\nseed = 5\nstart = "{START}"\nduration_s = 0.425\n[receiver]\nsample_rate_hz = 6.2e6\n'
    (room / "scenario.toml").write_text(head + satellites)
    assert invoke(simulate, room / "scenario.toml", "-o", room / "night").exception is None
    for path in (*(room / "night").glob("e1.*"), *(room / "night").glob("*-collection")):
        path.unlink()
    epochs = [_observed(n / 10, svids) for n in range(-2, 19)]
    write_csv_observations(room / "night" / "observations.csv", epochs)
    osnma = room / "night" / "osnma"
    made = invoke(
        recs_make, "--from-recording", room / "night", "--keys", osnma / "keys.csv", "--public-key",
        osnma / "public_key.pem", "-o", room / "night" / "assistance", "--svids", ",".join(map(str, svids)),
        "--interval", 0.3,
    )  # fmt: skip
    assert made.exception is None
    with (room / "night" / "e6.sigmf-data").open(
        "ab"
    ) as samples:  # so far --follow waits before it judges the last RECS
        samples.write(bytes(2 * 7_440_000))
    write_rinex_navigation(room / "night.rnx", ORBITS)
    return room / "night"


def _imu(path: Path, during: str, until_s: float = 0.6) -> Path:
    """Write 50 rows a second that say one thing during the push and nothing before and after."""
    rows = ["gst_week,gst_second,east_mps2,north_mps2,up_mps2"]
    for n in range(-25, round(until_s * 50)):
        pushed = FROM_S <= n / 50 < TO_S
        rows.append(f"{START.week},{START.second + n / 50:.2f},{during if pushed else STANDS}")
    path.write_text("\n".join(rows) + "\n")
    return path


def _inertial(verdicts: list[dict]) -> list[list[dict]]:
    """Return the check of each satellite, snapshot by snapshot."""
    found = [(one["snapshot"], check) for one in verdicts for check in one["checks"] if "inertial" in check["name"]]
    return [[check for index, check in found if index == n] for n in sorted({index for index, _ in found})]


def _processed(night: Path, *options: object) -> list[dict]:
    result = invoke(process, night, *SETTINGS, *options)
    assert result.exception is None, result.exception
    return json.loads(result.stdout)["verdicts"]


def _navigation(night: Path) -> tuple[str, Path]:
    return "--navigation", night.parent / "night.rnx"


def test_a_manoeuvre_that_the_file_explains_passes(night: Path, tmp_path: Path) -> None:
    imu = _imu(tmp_path / "imu.csv", MOVES)
    verdicts = _processed(night, *_navigation(night), "--accelerations", imu)
    first, second = _inertial(verdicts)
    assert {one["outcome"] for one in first} == {"NOT_RUN"}
    assert [one["outcome"] for one in second] == ["PASS"] * N_SATELLITES
    assert max(abs(one["statistic"]) for one in second) < 0.1
    assert {one["status"] for one in verdicts} == {"AUTHENTIC"}


@pytest.mark.parametrize("during", [STANDS, f"-{EAST_MPS2},0,0"])
def test_one_that_it_does_not_is_suspect(night: Path, tmp_path: Path, during: str) -> None:
    verdicts = _processed(night, *_navigation(night), "--accelerations", _imu(tmp_path / "imu.csv", during))
    failed = [one for one in _inertial(verdicts)[1] if one["outcome"] == "FAIL"]
    assert failed
    assert all("more than the motion explains" in one["reason"] for one in failed)
    assert "SUSPECT" in {one["status"] for one in verdicts}


def test_of_sensors_that_may_be_as_wrong_nothing_follows(night: Path, tmp_path: Path) -> None:
    loose = ("--accelerations", _imu(tmp_path / "imu.csv", STANDS), "--acceleration-bias-mps2", 5.0)
    assert {one["outcome"] for one in _inertial(_processed(night, *_navigation(night), *loose))[1]} == {"PASS"}


@pytest.mark.parametrize(
    ("navigation", "sensors", "until_s", "reason"),
    [
        (True, False, 0.6, "no accelerations of inertial sensors"),
        (False, True, 0.6, "no position fix"),
        (True, True, 0.35, "the accelerations do not cover the time since 2026-11-21T12:00:16"),
    ],
)
def test_without_what_it_needs_it_is_not_run(
    night: Path, tmp_path: Path, navigation: bool, sensors: bool, until_s: float, reason: str
) -> None:
    imu = ("--accelerations", _imu(tmp_path / "imu.csv", MOVES, until_s)) if sensors else ()
    verdicts = _processed(night, *(_navigation(night) if navigation else ()), *imu)
    assert [one["outcome"] for one in _inertial(verdicts)[1]] == ["NOT_RUN"] * N_SATELLITES
    assert all(one["reason"].startswith(reason) for one in _inertial(verdicts)[1])
    assert {one["status"] for one in verdicts} == {"AUTHENTIC"}


@pytest.mark.parametrize("level", [1, 2])
def test_other_levels_refuse_them(night: Path, tmp_path: Path, level: int) -> None:
    result = invoke(process, night, "--level", level, "--accelerations", _imu(tmp_path / "imu.csv", STANDS))
    assert str(result.exception) == "--accelerations: only at --level 3"


def test_a_bad_file_is_one_line(night: Path, tmp_path: Path) -> None:
    imu = tmp_path / "imu.csv"
    missing = invoke(process, night, *SETTINGS, "--accelerations", imu)
    assert "imu.csv" in str(missing.exception)
    imu.write_text("time_s,x_mps2,y_mps2,z_mps2\n0,0,0,0\n")
    bad = invoke(process, night, *SETTINGS, "--accelerations", imu)
    assert "imu.csv: line 1: found time_s,x_mps2,y_mps2,z_mps2, expected gst_week,gst_second,east" in str(bad.exception)


def test_followed_they_are_waited_for_and_it_goes_on_after_a_stop(
    night: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sensors' file is not there at first, and grows; each snapshot is judged by a program of its own."""
    imu, output = tmp_path / "imu.csv", tmp_path / "kept"
    finished = _imu(tmp_path / "finished.csv", MOVES)
    expected = _processed(night, *_navigation(night), "--accelerations", finished)
    lines = finished.read_text().splitlines(keepends=True)
    # to 0.26 s and half a row, then to the end; the second snapshot is of 0.386 s
    parts = [lines[:4], [*lines[4:40], lines[40][:9]], [lines[40][9:], *lines[41:]]]

    def write(part: list[str]) -> None:
        with imu.open("a") as stream:
            stream.writelines(part)

    timers = [threading.Timer(0.1 * (1 + n), write, (part,)) for n, part in enumerate(parts[:2])]
    timers.append(threading.Timer(1.5, write, (parts[2],)))
    record = FollowJournal.record

    def stopped_after(self: FollowJournal, kept: list[str], progress: FollowProgress) -> None:
        record(self, kept, progress)
        if progress.index == 0:
            timers[2].start()
        raise KeyboardInterrupt

    arguments = (night, *SETTINGS, *_navigation(night), "--accelerations", imu, "--follow", "-o", output)
    monkeypatch.setattr(FollowJournal, "record", stopped_after)
    for timer in timers[:2]:
        timer.start()
    stops = [invoke(process, *arguments, "--poll-s", 0.02, "--idle-s", 30).exception for _ in range(2)]
    for timer in timers:
        timer.join()
    assert all(isinstance(stop, (KeyboardInterrupt, click.Abort)) for stop in stops)
    kept = [json.loads(line) for line in (output / LINES).read_text().splitlines()]
    verdicts = [{key: value for key, value in one.items() if key != "kind"} for one in kept if one["kind"] == "verdict"]
    assert verdicts == expected
    assert {one["outcome"] for one in _inertial(verdicts)[1]} == {"PASS"}


def test_a_silent_sensor_is_not_waited_for_for_ever(night: Path, tmp_path: Path) -> None:
    imu = _imu(tmp_path / "imu.csv", MOVES, 0.35)
    arguments = (night, *SETTINGS, *_navigation(night), "--accelerations", imu, "--follow", "--poll-s", 0.02)
    result = invoke(process, *arguments, "--idle-s", 1, "--wait-s", 0.05)
    assert result.exception is None
    verdicts = [one for one in map(json.loads, result.stdout.splitlines()) if one["kind"] == "verdict"]
    assert {one["reason"][:31] for one in _inertial(verdicts)[1]} == {"the accelerations do not cover "}
