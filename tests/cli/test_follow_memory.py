"""`process --follow` at level 2 without an observation file for half an hour: it needs as much memory as for minutes.

Tracking itself is replaced by drawn stretches, with the pages of a whole sky; all else is what follows a recorder.
`test_tracking_memory.py` has the memory of tracking.
"""

from __future__ import annotations

import gc
import json
import os
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import click
import pytest

from night import invoke
from vestige.cli.recordings.process import command as process
from vestige.navigation.inav.page import PAGE_S, InavPage
from vestige.recording.live.follow_journal import LINES
from vestige.recording.live.following import Following
from vestige.recording.live.received_message import ReceivedMessage
from vestige.records import E1Observation, SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.sample_processor.tracking.tracking_receiver import TrackedStretch, TrackingReceiver
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import write_companions
from vestige.time import GalileoTime

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
DURATION_S = 1860
SVIDS = (6, 7, 8, 13, 14)  # what observations need grows with their number, and so does the time of the test
RATE_HZ = 2e5  # of samples that are holes in a file
CARRIERS_HZ = {"e1": 1575.42e6, "e6": 1278.75e6}
EARLY, LATE = (4, 10), (50, 57)  # epochs of 30 s: minutes 2 to 5, and 25 to 28.5


@pytest.fixture(scope="module")
def case() -> AcasTestCase:
    scenario = load_scenario(NIGHT, (f"epochs={DURATION_S}", f"constellation.svids={list(SVIDS)}"))
    return AcasTestCase(scenario=scenario, first=0, end=DURATION_S)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def half_hour(case: AcasTestCase, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """RECS each 30 s and the trust anchor, without keys or observations, and sample files that are holes."""
    folder = tmp_path_factory.mktemp("half_hour")
    write_companions(case, folder)
    (folder / "assistance" / "keys.csv").unlink()
    (folder / "observations.csv").unlink()
    text = f'start = "{case.simulation.start}"\ntime_uncertainty_s = 1.0\nsample_rate_hz = {RATE_HZ}\n'
    for band, carrier_hz in CARRIERS_HZ.items():
        text += f'[{band}]\nfile = "{band}.bin"\nformat = "int8"\nlayout = "iq"\n'
        text += f"center_frequency_hz = {carrier_hz}\n"
        with (folder / f"{band}.bin").open("wb") as stream:
            os.truncate(stream.fileno(), round(DURATION_S * RATE_HZ) * 2)
    (folder / "recording.toml").write_text(text)
    return folder


def _drawn(case: AcasTestCase) -> object:
    """What stands in for tracking: all satellites at a constant range, and their pages when they are complete."""
    assert case.message is not None
    sent = case.message.pages
    pages = sorted((page for own in sent.values() for page in own), key=lambda page: page.time)
    waiting = [0]

    def track(receiver: TrackingReceiver, piece: SampleBatch, _pool: object = None) -> TrackedStretch:
        end = piece.start + piece.samples.size / piece.sample_rate_hz
        first = piece.start.gst_seconds * 10 + round(piece.start.fraction * 10)
        epochs = [_epoch(number, list(sent)) for number in (first, first + 1)]
        done: list[InavPage] = []
        while waiting[0] < len(pages) and end - pages[waiting[0]].time >= PAGE_S:
            done.append(pages[waiting[0]])
            waiting[0] += 1
        receiver.time_is_told = receiver.time_is_told or bool(done)
        return TrackedStretch(epochs=epochs, pages=done if receiver.time_is_told else [])

    return track


def _epoch(number: int, svids: list[int]) -> ObservationEpoch:
    seen = {
        svid: E1Observation(
            svid=svid,
            pseudorange_m=2.4e7,
            carrier_phase_cycles=0.0,
            doppler_hz=0.0,
            doppler_rate_hz_per_s=float("nan"),
            cn0_dbhz=45.0,
        )
        for svid in svids
    }
    return ObservationEpoch(time=GalileoTime.from_gst_seconds(number // 10) + number % 10 / 10, observations=seen)


@pytest.mark.slow
def test_memory_is_constant(
    case: AcasTestCase, half_hour: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    peaks: dict[int, int] = {}
    messages: list[ReceivedMessage] = []
    n_keys: list[int] = []
    follow = Following.__iter__

    def watched(self: Following) -> Iterator[object]:
        for number, epoch in enumerate(follow(self)):
            if number in (EARLY[0], LATE[0]):
                gc.collect()
                tracemalloc.reset_peak()
            if number in (EARLY[1], LATE[1]):
                peaks[number] = tracemalloc.get_traced_memory()[1]
                assert self.live.tracking is not None
                messages.append(self.live.tracking.message)
                n_keys.append(len(self.folder.found.assistance.keys))
            yield epoch

    monkeypatch.setattr(TrackingReceiver, "track", _drawn(case))
    # The clock on the wall runs ten times as fast, as on a slow machine: what waits to be tracked is not overdue.
    fast_clock = SimpleNamespace(monotonic=lambda: time.monotonic() * 10)
    monkeypatch.setattr("vestige.recording.live.following.time", fast_clock)
    monkeypatch.setattr(Following, "__iter__", watched)
    monkeypatch.setattr(click, "echo", lambda *_arguments, **_options: None)  # CliRunner keeps what is printed
    tracemalloc.start()
    try:
        result = invoke(
            # to be slow in tracking is no end of the recording, however short --idle-s is
            process, half_hour, "--follow", "--level", "2", "--poll-s", "0.01", "--idle-s", "0",
            "-o", tmp_path / "kept", "--positions", tmp_path / "positions.nmea",
        )  # fmt: skip
    finally:
        tracemalloc.stop()
    assert result.exception is None
    assert len(peaks) == 2
    # keys come out of the pages, and those of the last minutes are there
    assert [n >= 7 for n in n_keys] == [True, True]
    orbits, verified = messages[-1].ephemerides()
    assert verified == set(case.message.pages)  # type: ignore[union-attr]
    assert {one.svid for one in orbits} == verified
    # How many observations wait for keys depends on the speed of the machine, up to 180 s of them: 2.5 MB. Those of
    # the 23 minutes between the two would be 16 MB.
    assert peaks[LATE[1]] < peaks[EARLY[1]] + 5_000_000
    lines = (tmp_path / "kept" / LINES).read_text().splitlines()
    without_key = {json.loads(line)["snapshot"] for line in lines if "no validated OSNMA key" in line}
    assert all(number > 57 for number in without_key)  # the keys of the last RECS came after the end
    assert len((tmp_path / "positions.nmea").read_text().splitlines()) == 2 * 62
