"""E1 of a sky, tracked from its samples: `vestige track`, and `process` with samples, RECS and keys alone."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from night import invoke
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.recordings.track import command as track
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.errors import InputFileError
from vestige.navigation.earth import ecef_from_geodetic
from vestige.navigation.inav.ephemeris_words import ephemeris_words
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
from vestige.recording.observations.observation_file import ObservationTrack, open_observations

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
SETTINGS = ("receiver.sample_rate_hz=5.2e6", "constellation.svids=[7, 8, 13, 14]", "recs.every=10")


def _written(command: object, *arguments: object) -> Result:
    result = invoke(command, *arguments)
    if result.exception is not None:
        raise result.exception
    return result


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """34 s of four satellites: every word of an ephemeris comes in 30 s."""
    folder = tmp_path_factory.mktemp("tracked") / "sky"
    settings = [item for one in SETTINGS for item in ("--set", one)]
    _written(simulate, NIGHT, "-o", folder, "--epochs", "0:34", *settings)
    return folder


@pytest.fixture(scope="module")
def tracked(sky: Path) -> Path:
    folder = sky.parent / "tracked"
    result = _written(track, sky, "-o", folder)
    assert result.stdout.count("dBHz") == 4
    return folder


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_process_needs_samples_recs_and_keys_only(sky: Path, tmp_path: Path) -> None:
    """No observation file: every satellite is AUTHENTIC at each RECS that was tracked, with a position by the message.

    A time tag that is 10 s late gives the same verdicts where the bound on the clock says so.
    """
    alone = tmp_path / "alone"
    alone.mkdir()
    for path in sky.iterdir():
        if "sigmf" in path.name:
            (alone / path.name).symlink_to(path)
    shutil.copytree(sky / "assistance", alone / "assistance")
    said = _written(process, alone, "--json")
    result, early = json.loads(said.stdout), "4 RECS came before E1 was tracked, from 2026-11-22T22:00:00.5"
    assert early in said.stderr
    assert {one["status"] for one in result["verdicts"]} == {"AUTHENTIC"}
    assert len(result["verdicts"]) == 12
    assert any("4 RECS came before E1 was tracked" in line for line in result["warnings"])
    last = result["positions"][-1]
    assert last["latitude_deg"] == pytest.approx(48.1, abs=5e-5)
    assert last["longitude_deg"] == pytest.approx(11.6, abs=8e-5)
    said = _written(process, alone, "--start", "2026-11-22T22:00:10 GST", "--time-uncertainty", 15, "--json")
    late = json.loads(said.stdout)
    assert "4 RECS came before E1 was tracked" in said.stderr
    assert [one["status"] for one in late["verdicts"]] == [one["status"] for one in result["verdicts"]]
    later = _written(process, alone, "--start", "2026-11-22T22:00:10 GST", "--time-uncertainty", 60, "--json")
    unknown = json.loads(later.stdout)["verdicts"]
    assert {one["status"] for one in unknown} == {"NOT_AVAILABLE"}
    assert "key" in unknown[0]["reason"]


def test_too_short_a_recording_is_not_tracked(tmp_path: Path) -> None:
    np.random.default_rng(1).integers(-40, 40, 2 * 800_000, dtype=np.int8).tofile(tmp_path / "e1")
    (tmp_path / "recording.toml").write_text(
        'start = "2026-11-21T12:00:16 GST"\ntime_uncertainty_s = 1.0\nsample_rate_hz = 4e6\n'
        '[e1]\nfile = "e1"\nformat = "int8"\nlayout = "iq"\ncenter_frequency_hz = 1575.42e6\n'
    )
    with pytest.raises(InputFileError, match=r"found 0\.2 s.*expected at least 2 s.*vestige process"):
        _written(track, tmp_path, "-o", tmp_path / "tracked")
    assert not (tmp_path / "tracked").exists()


def test_track_refuses_what_it_cannot_do(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(InputFileError, match="something there already"):
        _written(track, tmp_path, "-o", tmp_path / "there")
    with pytest.raises(InputFileError, match="no description of samples"):
        _written(track, tmp_path, "-o", tmp_path / "new")


def test_help_names_the_loops() -> None:
    text = CliRunner().invoke(track, ["--help"]).stdout
    for option in ("--pll-bandwidth-hz", "--dll-bandwidth-hz", "--integration-ms", "--correlators", "--replica"):
        assert option in text
