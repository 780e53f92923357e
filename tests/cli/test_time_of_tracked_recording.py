"""`process` and `live` with tracked E1: one clock in all outputs, why there is no verdict, and inputs before tracking.

E1 is tracked once. A message that tells the time would need 30 s of samples, so the tests state the error of the time
tag in the result of tracking, as `track_batches` does.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from click.testing import Result

from night import done, invoke
from vestige.cli.live.live import command as live
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.errors import VestigeError
from vestige.recording.live import live_tracking
from vestige.recording.live.live_tracking import LiveTracking
from vestige.recording.recording import open_recording
from vestige.recording.tracked import track_recording as tracking
from vestige.recording.tracked.track_recording import TrackedRecording, with_code_periods
from vestige.sample_processor.tracking.tracking_receiver import TrackingReceiver
from vestige.time import GalileoTime

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
SVIDS = (7, 8, 13, 14)  # enough for a position
SETTINGS = ("receiver.sample_rate_hz=5.2e6", f"constellation.svids={list(SVIDS)}", "recs.every=2")
START = GalileoTime(1422, 79200)  # of night.toml; RECS are sent at 0 and 2 s
TAG_S = -10.0  # the time tag is 10 s early
WRONG_TAG = ("--start", START + TAG_S, "--time-uncertainty", 10.5)


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Two seconds of four satellites, without observations."""
    folder = tmp_path_factory.mktemp("clock") / "night"
    settings = [item for one in SETTINGS for item in ("--set", one)]
    done(simulate, NIGHT, "-o", folder, "--epochs", "0:3", "--workers", 1, *settings)
    (folder / "observations.csv").unlink()
    yield folder
    for path in folder.glob("*.sigmf-data"):
        path.unlink()


@pytest.fixture(scope="module")
def tracked(night: Path) -> TrackedRecording:
    with pytest.MonkeyPatch.context() as patch:  # tests/cli/test_tracked_sky.py searches all satellites
        patch.setattr(tracking, "TrackingReceiver", partial(TrackingReceiver, svids=SVIDS))
        return replace(tracking.track_recording(open_recording(night)), time_tag_error_s=0.0)


@pytest.fixture
def processed(night: Path, tracked: TrackedRecording, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Return a function that processes the night with what was tracked, in samples with a given time tag."""

    def call(*arguments: object, tag_s: float = 0.0, from_s: float = 0.0) -> Result:
        epochs = tuple(
            with_code_periods(replace(epoch, time=epoch.time + tag_s), tag_s)
            for epoch in tracked.epochs
            if epoch.time - START >= from_s
        )
        found = replace(tracked, epochs=epochs, time_tag_error_s=tag_s)
        monkeypatch.setattr(tracking, "track_recording", lambda *_, **__: found)
        orbits = ("--navigation", night / "rinex" / "navigation.rnx")
        return done(process, night, *orbits, *arguments, *(WRONG_TAG if tag_s else ()))

    return call


def _seconds(path: Path) -> list[float]:
    with path.open() as stream:
        return [float(row["gst_second"]) for row in csv.DictReader(stream)]


def test_a_wrong_time_tag_is_told_and_all_times_are_of_the_signal(
    processed: Callable[..., Result], tmp_path: Path
) -> None:
    files = {name: tmp_path / name for name in ("right.csv", "wrong.csv", "right.geojson", "wrong.geojson")}
    right = processed("--json", "-o", files["right.csv"], "--positions", files["right.geojson"])
    wrong = processed("--json", "-o", files["wrong.csv"], "--positions", files["wrong.geojson"], tag_s=TAG_S)
    line = "the time tag of the samples is 10.00 s behind the time in the navigation message, ± 10 ms"
    assert line not in right.stderr
    assert wrong.stderr.count(line) == 1
    expected, found = json.loads(right.stdout), json.loads(wrong.stdout)
    assert [line in one for one in found["warnings"]].count(True) == 1
    assert [one["status"] for one in found["verdicts"]] == ["AUTHENTIC"] * len(SVIDS)
    for one, other in zip(found["verdicts"], expected["verdicts"], strict=True):
        assert one["gst_second"] == pytest.approx(START.second + 2.086, abs=0.011)
        assert one["gst_second"] == pytest.approx(other["gst_second"], abs=1e-9)
        assert one["available_at"] == other["available_at"]
    (position,), (same,) = found["positions"], expected["positions"]
    assert position["latency_s"] == pytest.approx(same["latency_s"], abs=1e-9)
    assert position["time"] == same["time"]
    assert position["available_at"] == same["available_at"]
    assert files["wrong.geojson"].read_text() == files["right.geojson"].read_text()
    seconds = [_seconds(files[name]) for name in ("right.csv", "wrong.csv")]
    assert seconds[1] == pytest.approx(seconds[0], abs=1e-9)
    text = processed(tag_s=TAG_S).stdout
    assert f"snapshot 1: {position['time']}, level 1" in text
    assert f"known after {position['latency_s']:.1f} s" in text


def test_the_disclosure_rule_keeps_the_clock_of_the_receiver(processed: Callable[..., Result]) -> None:
    """By a clock that may be 45 s wrong, samples until 22:00:02 may be from after the key was on air."""
    (reason,) = {
        one["reason"] for one in json.loads(processed("--json", "--time-uncertainty", 70, tag_s=0.0).stdout)["verdicts"]
    }
    assert "samples until 2026-11-22T22:00:02.1" in reason
    assert "± 70 s by the receiver's clock, key on air from" in reason


@pytest.mark.parametrize("tag_s", [0.0, TAG_S])
def test_recs_before_tracking_are_the_reason_without_a_verdict(processed: Callable[..., Result], tag_s: float) -> None:
    """Tracked satellites are not missing on E1, and the line on standard output says what to record."""
    arguments = {"tag_s": tag_s, "from_s": 2.15}
    found = json.loads(processed("--json", **arguments).stdout)
    assert found["verdicts"] == found["not_seen_on_e1"] == []
    reason = "8 RECS came before E1 was tracked, from 2026-11-22T22:00:02.200 GST on, and have no verdict; begin the"
    assert [reason in one for one in found["warnings"]].count(True) == 1
    text = processed("--level", 1, **arguments).stdout
    assert reason in text
    assert "not seen on E1" not in text
    assert "swapped" not in text


def test_live_without_the_time_does_not_call_tracked_satellites_unseen(
    night: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_tracking, "TrackingReceiver", partial(TrackingReceiver, svids=SVIDS))
    words = ("--idle-s", "0.1", "--poll-s", "0.02", "--time-uncertainty", "1")
    result = done(live, night, *words, "--json")
    end = json.loads(result.stdout.splitlines()[-1])
    assert (end["kind"], end["not_seen_on_e1"]) == ("end", [])
    assert "no navigation message has given the time" in result.stderr
    assert "seen on E1" not in result.stderr


def _not_yet(*_: object, **__: object) -> None:
    raise AssertionError("E1 is tracked before the inputs and outputs are opened")


WRONG = {
    "assistance": ("--assistance", "nowhere"),
    "tree": ("--merkle-tree", "nowhere.xml"),
    "public key": ("--public-key", "nowhere.pem"),
    "certificate": ("--certificate", "nowhere.pem"),
    "second channel": ("--second-channel", "nowhere"),
    "orbits": ("--navigation", "nowhere.rnx"),
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("command", [process, live])
def test_a_wrong_name_is_told_before_tracking(
    night: Path, monkeypatch: pytest.MonkeyPatch, name: str, command: object
) -> None:
    monkeypatch.setattr(tracking, "track_recording", _not_yet)
    monkeypatch.setattr(LiveTracking, "advance", _not_yet)
    found = invoke(command, night, *WRONG[name], "--time-uncertainty", "0.01").exception
    assert isinstance(found, VestigeError)
    assert "nowhere" in str(found)


def test_other_inputs_and_outputs_are_opened_before_tracking(
    night: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracking, "track_recording", _not_yet)
    damaged = tmp_path / "assistance"
    damaged.mkdir()
    (damaged / "receiver.toml").write_text("hardware_bias_m = many\n")
    for arguments in (
        ("--level", 3, "--accelerations", "nowhere.csv"),
        ("--assistance", damaged, "--strict"),
        ("--mavlink", "udpout:nowhere"),
    ):
        assert isinstance(invoke(process, night, *arguments).exception, VestigeError), arguments
