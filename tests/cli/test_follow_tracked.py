"""`process --follow` with samples and RECS alone: E1 is tracked while it is written."""

from __future__ import annotations

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

from night import invoke
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.recording.live.follow_journal import LINES

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
def night(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A sky of four satellites, without observations; the keys are there, as the message needs longer for its root."""
    folder = tmp_path_factory.mktemp("tracked") / "night"
    settings = [item for one in SETTINGS for item in ("--set", one)]
    assert invoke(simulate, NIGHT, "-o", folder, "--epochs", f"0:{DURATION_S}", *settings).exception is None
    for name in ("observations.csv", "inav_pages.csv", "truth.csv"):
        (folder / name).unlink()
    shutil.rmtree(folder / "rinex")
    yield folder
    shutil.rmtree(folder)  # 0.9 GB


@pytest.fixture(scope="module")
def verdicts(night: Path) -> list[dict]:
    """The verdicts of the finished recording."""
    result = invoke(process, night, "--json")
    assert result.exception is None
    found: list[dict] = json.loads(result.stdout)["verdicts"]
    assert {one["snapshot"] for one in found if one["status"] == "AUTHENTIC"} >= {1, 2, 3}
    return found


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
    result = invoke(process, folder, *FAST, "--idle-s", "2", "--nmea", tmp_path / "nmea")
    writer.join()
    assert result.exception is None
    _agree(_objects(result.stdout), verdicts)
    sentences = (tmp_path / "nmea").read_text().split()
    snapshots = {one["snapshot"] for one in _objects(result.stdout)} | {0}
    assert len(sentences) == 2 * len(snapshots)
    # no root key, so no tag has verified an ephemeris: no position is a valid fix
    assert {one.split(",")[6] for one in sentences[::2]} == {"0"}
    assert {one.split(",")[2] for one in sentences[1::2]} == {"V"}


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
    assert "going on after snapshot" in second.stderr
    _agree(_objects((kept / LINES).read_text()), verdicts)
    assert not _said(_objects(second.stdout)).keys() & _said(before).keys()


def test_a_time_tag_ten_seconds_late(night: Path, verdicts: list[dict], tmp_path: Path) -> None:
    meta = json.loads((night / "e1.sigmf-meta").read_text())["captures"][0]["vestige:start_gst"]
    week, second = meta.split(":")
    late = f"{week}:{float(second) + 10!r}"
    result = invoke(process, night, *ONCE, "--start", late, "--time-uncertainty", "20")
    assert result.exception is None
    found = _objects(result.stdout)
    # a clock that may be 20 s wrong cannot prove that a RECS was received before its key was disclosed
    assert {one["status"] for one in found} <= {"AUTHENTIC", "NOT_AVAILABLE"}
    assert all("disclos" in one["reason"] for one in found if one["status"] == "NOT_AVAILABLE")
    sure = _objects(invoke(process, night, *ONCE, "--start", late, "--time-uncertainty", "10.5").stdout)
    assert _said(sure).keys() == _said(verdicts).keys()
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
        assert "no message has told the time" in result.stderr
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
    result = invoke(process, night, *[one for one in ONCE if one != "--json"], "--nmea", "-")
    assert result.exception is None
    assert all(line.startswith("$GA") for line in result.stdout.splitlines())
    assert "snapshot 1" in result.stderr
    both = invoke(process, night, *ONCE, "--nmea", "-").exception
    assert isinstance(both, click.UsageError)
