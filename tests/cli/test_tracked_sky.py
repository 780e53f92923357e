"""E1 of a sky, tracked from its samples: `track`, and `process` with samples, RECS and keys alone, live as well."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import Result

from night import done, invoke
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.recordings.track import command as track
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import ecef_from_geodetic
from vestige.navigation.inav.ephemeris_words import ephemeris_words
from vestige.recording.live.follow_journal import LINES
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
from vestige.recording.observations.observation_file import ObservationTrack, open_observations

pytestmark = pytest.mark.slow

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
RATE_HZ, DURATION_S = 6.2e6, 36
EVERY_S = 8  # from RECS to RECS
SETTINGS = (
    f"receiver.sample_rate_hz={RATE_HZ}", "constellation.svids=[7, 8, 13, 14]", f"recs.every={EVERY_S}",
)  # fmt: skip
BANDS = ("e1", "e6")
FAST = ("--follow", "--poll-s", "0.02", "--json")
ONCE = (*FAST, "--idle-s", "0.3")


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """36 s of four satellites: every word of an ephemeris comes in 30 s."""
    folder = tmp_path_factory.mktemp("tracked") / "sky"
    settings = [item for one in SETTINGS for item in ("--set", one)]
    # one thread costs less time of the processor than two, which wait for each other
    done(simulate, NIGHT, "-o", folder, "--epochs", f"0:{DURATION_S}", "--workers", 1, *settings)
    yield folder
    shutil.rmtree(folder)  # 0.9 GB


@pytest.fixture(scope="module")
def night(sky: Path) -> Path:
    """Samples, RECS and keys of the sky alone; the keys are there, as the message needs longer for its root."""
    folder = sky.parent / "night"
    folder.mkdir()
    for path in sky.glob("*sigmf*"):
        (folder / path.name).symlink_to(path)
    shutil.copytree(sky / "assistance", folder / "assistance")
    return folder


@pytest.fixture(scope="module")
def tracked(sky: Path) -> Path:
    folder = sky.parent / "tracked"
    result = done(track, sky, "-o", folder)
    assert result.stdout.count("dBHz") == 4
    return folder


@pytest.fixture(scope="module")
def finished(night: Path) -> Result:
    """What `process` says of the finished recording."""
    return done(process, night, "--json")


@pytest.fixture(scope="module")
def verdicts(finished: Result) -> list[dict]:
    """The verdicts of the finished recording."""
    found: list[dict] = json.loads(finished.stdout)["verdicts"]
    assert {one["snapshot"] for one in found if one["status"] == "AUTHENTIC"} >= {1, 2, 3}
    return found


def test_observations_are_those_that_were_sent(sky: Path, tracked: Path) -> None:
    """Against the truth, whose noise is known: pseudorange 1 m rms, Doppler 0.5 Hz, phase between epochs 1 cm."""
    noise = {}
    with (sky / "truth.csv").open() as stream:
        for row in csv.DictReader(stream):
            names = ("e1_noise_m", "doppler_e1_hz", "e1_phase_noise_m")
            noise[int(row["svid"]), float(row["gst_second"])] = tuple(float(row[name]) for name in names)
    found = ObservationTrack(open_observations(tracked / "observations.rnx"))
    range_error, doppler_error, phase_step_error = [], [], []
    phase_before: dict[int, float] = {}
    for epoch in open_observations(sky / "observations.csv"):
        ours = found.at(epoch.time)
        for svid, one in epoch.observations.items():
            if svid not in ours:
                continue
            noise_m, doppler_hz, phase_noise_m = noise[svid, float(epoch.time.second)]
            range_error.append(ours[svid].pseudorange_m - (one.pseudorange_m - noise_m))
            doppler_error.append(ours[svid].doppler_hz - doppler_hz)
            cycles = ours[svid].carrier_phase_cycles - one.carrier_phase_cycles
            phase_m = cycles * SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ + phase_noise_m
            if svid in phase_before:
                phase_step_error.append(phase_m - phase_before[svid])
            phase_before[svid] = phase_m
    assert len(range_error) > 4 * 30
    assert (sum(error**2 for error in range_error) / len(range_error)) ** 0.5 < 1.0
    assert (sum(error**2 for error in doppler_error) / len(doppler_error)) ** 0.5 < 0.5
    assert len(phase_step_error) > 4 * 29
    assert np.sqrt(np.mean(np.square(phase_step_error))) < 0.01


def test_the_message_is_read(sky: Path, tracked: Path) -> None:
    """Every page is one that was sent, and every ephemeris has the words of the one that was sent."""
    sent = {one.svid: one for one in read_rinex_navigation(sky / "rinex" / "navigation.rnx")}
    found = read_rinex_navigation(tracked / "navigation.rnx")
    assert {one.svid for one in found} == {7, 8, 13, 14}
    for one in found:
        assert ephemeris_words(one) == ephemeris_words(sent[one.svid])
    pages = {}
    for name, folder in (("sent", sky), ("found", tracked)):
        with (folder / "inav_pages.csv").open() as stream:
            pages[name] = {row["SVID"]: row["NavBitsHEX"] for row in csv.DictReader(stream)}
    for svid, line in pages["found"].items():
        assert line in pages["sent"][svid]


@pytest.mark.skipif(shutil.which("rnx2rtkp") is None, reason="RTKLIB is not installed (Debian: apt-get install rtklib)")
def test_rtklib_finds_the_receiver(tracked: Path) -> None:
    """Its fix of our observations and orbits is within three of the standard deviations that it states itself."""
    run = subprocess.run(
        ["rnx2rtkp", "-p", "0", "-sys", "E", "-e", "observations.rnx", "navigation.rnx"],  # noqa: S607
        cwd=tracked, capture_output=True, text=True, check=True,
    )  # fmt: skip
    rows = np.array([line.split()[2:10] for line in run.stdout.splitlines() if line[:1] != "%"], float)
    place = ecef_from_geodetic(np.radians([48.1]), np.radians([11.6]), np.array([500.0]))[0]
    assert rows.shape[0] > 20
    assert np.all(np.abs(rows[:, :3] - place) < 3 * rows[:, 5:8])
    # what it states is that of a real sky without corrections; ours has none
    assert np.all(np.abs(np.mean(rows[:, :3] - place, axis=0)) < 2.0)


def test_process_needs_samples_recs_and_keys_only(night: Path, finished: Result) -> None:
    """No observation file: every satellite is AUTHENTIC at each RECS that was tracked, with a position by the message.

    A time tag that is 10 s late gives the same verdicts where the bound on the clock says so.
    """
    result, early = json.loads(finished.stdout), "4 RECS came before E1 was tracked, from 2026-11-22T22:00:00.5"
    assert early in finished.stderr
    assert {one["status"] for one in result["verdicts"]} == {"AUTHENTIC"}
    assert len(result["verdicts"]) == 16
    assert any("4 RECS came before E1 was tracked" in line for line in result["warnings"])
    last = result["positions"][-1]
    assert last["latitude_deg"] == pytest.approx(48.1, abs=5e-5)
    assert last["longitude_deg"] == pytest.approx(11.6, abs=8e-5)
    said = done(process, night, "--start", "2026-11-22T22:00:10 GST", "--time-uncertainty", 15, "--json")
    late = json.loads(said.stdout)
    assert "4 RECS came before E1 was tracked" in said.stderr
    assert [one["status"] for one in late["verdicts"]] == [one["status"] for one in result["verdicts"]]
    later = done(process, night, "--start", "2026-11-22T22:00:10 GST", "--time-uncertainty", 60, "--json")
    unknown = json.loads(later.stdout)["verdicts"]
    assert {one["status"] for one in unknown} == {"NOT_AVAILABLE"}
    assert "key" in unknown[0]["reason"]


def _copied(night: Path, folder: Path, **samples: Path | bytes | None) -> Path:
    """Return a recording with the same description; samples of a band are linked, or others, or none."""
    folder.mkdir()
    for path in night.iterdir():
        band = path.stem if path.suffix == ".sigmf-data" else ""
        content = samples.get(band, path)
        if band and isinstance(content, bytes):
            (folder / path.name).write_bytes(content)
        elif band and content is not None:
            (folder / path.name).symlink_to(path)
        elif not band:
            (shutil.copytree if path.is_dir() else shutil.copy)(path, folder / path.name)
    return folder


def _objects(text: str, kind: str = "verdict") -> list[dict]:
    return [one for one in map(json.loads, text.splitlines()) if one["kind"] == kind]


def _said(found: list[dict]) -> dict[tuple[int, int], str]:
    return {(one["snapshot"], one["svid"]): one["status"] for one in found}


def _agree(found: list[dict], expected: list[dict]) -> None:
    assert _said(found) == _said(expected)
    for one, other in zip(found, expected, strict=True):
        if other["range_offset_m"] is not None:
            # the error of the time tag is known a little differently at each moment, and with it the snapshot's time
            assert one["range_offset_m"] == pytest.approx(other["range_offset_m"], abs=0.1)


def test_the_verdicts_are_those_of_the_finished_recording(night: Path, verdicts: list[dict], tmp_path: Path) -> None:
    """Written in pieces that end anywhere; positions need ephemerides, which four satellites have told in 36 s."""
    folder = _copied(night, tmp_path / "night", e1=b"", e6=b"")
    data = {band: (night / f"{band}.sigmf-data").read_bytes() for band in BANDS}

    def write() -> None:
        for step in range(1, 38):
            for band in BANDS:
                with (folder / f"{band}.sigmf-data").open("ab") as stream:
                    stream.write(data[band][stream.tell() : len(data[band]) * step // 37])
            time.sleep(0.05)

    writer = threading.Thread(target=write)
    writer.start()
    result = invoke(
        process,
        folder,
        *FAST,
        "--idle-s",
        "2",
        "--positions",
        tmp_path / "sky.nmea",
        "--positions",
        tmp_path / "sky.csv",
    )
    writer.join()
    assert result.exception is None
    _agree(_objects(result.stdout), verdicts)
    sentences = (tmp_path / "sky.nmea").read_text().split()
    snapshots = {one["snapshot"] for one in _objects(result.stdout)} | {0}
    assert len(sentences) == 2 * len(snapshots)
    # no root key, so no tag has verified an ephemeris: no position is a valid fix
    assert {one.split(",")[6] for one in sentences[::2]} == {"0"}
    assert {one.split(",")[2] for one in sentences[1::2]} == {"V"}
    assert {one["orbits_authenticated"] for one in _objects(result.stdout, "position")} == {False}
    assert len((tmp_path / "sky.csv").read_text().splitlines()) == 1


def test_killed_and_started_again(night: Path, verdicts: list[dict], tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    arguments = (str(night), *FAST, "-o", str(kept))
    command = [sys.executable, "-m", "vestige", "process", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as first:  # noqa: S603
        assert first.stdout is not None
        for line in first.stdout:
            if json.loads(line)["snapshot"] >= 1:
                break
        first.send_signal(signal.SIGKILL)
    before = _objects((kept / LINES).read_text())
    assert before
    second = invoke(process, *arguments, "--idle-s", "0.3")
    assert second.exception is None
    assert "continuing after snapshot" in second.stderr
    _agree(_objects((kept / LINES).read_text()), verdicts)
    assert not _said(_objects(second.stdout)).keys() & _said(before).keys()


@pytest.mark.parametrize("late_s", [10, -10])
def test_a_time_tag_ten_seconds_off(night: Path, verdicts: list[dict], late_s: int) -> None:
    """The message places everything; the clock, and how far it may be wrong, only proves the order of RECS and key."""
    meta = json.loads((night / "e1.sigmf-meta").read_text())["captures"][0]["vestige:start_gst"]
    week, second = meta.split(":")
    start = f"{week}:{float(second) + late_s!r}"
    result = invoke(process, night, *ONCE, "--start", start, "--time-uncertainty", "20")
    assert result.exception is None
    found = _objects(result.stdout)
    # a clock that may be 20 s wrong cannot prove that a RECS was received before its key was disclosed
    assert {one["status"] for one in found} <= {"AUTHENTIC", "NOT_AVAILABLE"}
    assert all("disclos" in one["reason"] for one in found if one["status"] == "NOT_AVAILABLE")
    sure = _objects(invoke(process, night, *ONCE, "--start", start, "--time-uncertainty", "10.5").stdout)
    assert (
        result.stderr.count(f"the time tag of the samples is 10.00 s {'ahead of' if late_s > 0 else 'behind'} the time")
        == 1
    )
    assert _said(sure) == _said(verdicts)
    for one, other in zip(sure, verdicts, strict=True):  # the time of the signal, within the travel time
        assert one["gst_second"] == pytest.approx(other["gst_second"], abs=0.02)
    assert "AUTHENTIC" in _said(sure).values()


@pytest.mark.parametrize("band", BANDS)
def test_a_band_that_ends(night: Path, tmp_path: Path, band: str) -> None:
    half = (night / f"{band}.sigmf-data").read_bytes()[: round(20 * RATE_HZ) * 2]
    folder = _copied(night, tmp_path / "night", **{band: half})
    result = invoke(process, folder, *FAST, "--idle-s", "3", "--wait-s", "0.5")
    assert result.exception is None
    found = _objects(result.stdout)
    # the RECS that may be in a recording are those in E6
    assert {one["status"] for one in found if one["snapshot"] >= 3} == ({"NOT_AVAILABLE"} if band == "e1" else set())
    assert f"{band}.sigmf-data: {band.upper()} samples are" in result.stderr


@pytest.mark.parametrize("case", ["zeros", "lost in both"])
def test_bad_samples_have_no_authentic_verdict_that_is_wrong(
    night: Path, verdicts: list[dict], tmp_path: Path, case: str
) -> None:
    """Two cases; `test_bad_samples_tracked.py` has more of them on a finished recording."""
    data = {band: np.fromfile(night / f"{band}.sigmf-data", np.int8) for band in BANDS}
    lost = slice(round(17 * RATE_HZ) * 2, round(17.3137 * RATE_HZ) * 2)
    if case == "zeros":
        data["e1"][:] = 0
    else:
        data = {band: np.delete(one, lost) for band, one in data.items()}
    folder = _copied(night, tmp_path / "night", **{band: one.tobytes() for band, one in data.items()})
    result = invoke(process, folder, *ONCE, "--time-uncertainty", "1")
    assert result.exception is None
    found = _said(_objects(result.stdout))
    if case == "zeros":
        assert not found
        assert "no navigation message has given the time" in result.stderr
    else:
        # Until the loss all is as without it. The RECS at 24 s is 0.3 s from where it is looked for. At 32 s the
        # message has told the time anew, and as both bands lost the same samples, AUTHENTIC is right again.
        before = {key: status for key, status in found.items() if key[0] <= 1}
        assert before == {key: status for key, status in _said(verdicts).items() if key[0] <= 1}
        after = {number: {status for key, status in found.items() if key[0] == number} for number in (3, 4)}
        assert after == {3: {"NOT_DETECTED"}, 4: {"AUTHENTIC"}}


def test_two_named_pipes(night: Path, verdicts: list[dict], tmp_path: Path) -> None:
    start = json.loads((night / "e1.sigmf-meta").read_text())["captures"][0]["vestige:start_gst"]
    text = f'start = "{start}"\ntime_uncertainty_s = 0.001\nsample_rate_hz = {RATE_HZ}\n'
    for band, carrier_hz in (("e1", 1575.42e6), ("e6", 1278.75e6)):
        os.mkfifo(tmp_path / band)
        text += f'[{band}]\nfile = "{band}"\nformat = "int8"\nlayout = "iq"\ncenter_frequency_hz = {carrier_hz}\n'
    (tmp_path / "recording.toml").write_text(text)

    def write(band: str) -> None:
        with (night / f"{band}.sigmf-data").open("rb") as source, (tmp_path / band).open("wb") as pipe:
            shutil.copyfileobj(source, pipe, 777_777)

    writers = [threading.Thread(target=write, args=(band,)) for band in BANDS]
    for one in writers:
        one.start()
    # tracking needs 30 s until it knows the time; four RECS of 1.6 s wait meanwhile, not all samples
    result = invoke(process, tmp_path, *FAST, "--assistance", night / "assistance", "--buffer-mb", "200")
    for one in writers:
        one.join()
    assert result.exception is None
    _agree(_objects(result.stdout), verdicts)


def test_nmea_on_standard_output(night: Path) -> None:
    result = invoke(process, night, *[one for one in ONCE if one != "--json"], "--positions", "-")
    assert result.exception is None
    assert all(line.startswith("$GA") for line in result.stdout.splitlines())
    assert "snapshot 1" in result.stderr
    both = invoke(process, night, *ONCE, "--positions", "-").exception
    assert isinstance(both, click.UsageError)
