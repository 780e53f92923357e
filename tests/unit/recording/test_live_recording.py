"""E6 out of a pipe: every RECS has the samples of the finished recording, or it is said that they were dropped.

No test hopes for a race: the samples come between two given questions, or the buffer cannot hold them.
"""

from __future__ import annotations

import fcntl
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.recording.assistance.growing_assistance import GrowingAssistance
from vestige.recording.description import BandFile, RecordingDescription
from vestige.recording.live import following as module
from vestige.recording.live.following import FollowedEpoch, Following, WaitLimits
from vestige.recording.live.live_recording import LiveRecording, buffer_s
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sample_stream import BLOCK_BYTES, SampleStream
from vestige.records import Band
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase, with_default_range
from vestige.simulated.exported_case_folder import write_companions
from vestige.time import GalileoTime

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
START = GalileoTime.parse("2026-11-21T12:00:00 GST")
N_EPOCHS, INTERVAL_S = 12, 2.0
FS = 1e5  # of samples that nobody correlates
BYTES_PER_S = round(2 * FS)
DATA = np.random.default_rng(2).integers(-100, 100, round((N_EPOCHS * INTERVAL_S + 1) * BYTES_PER_S), dtype=np.int8)
SMALL = round(buffer_s(0.0) * BYTES_PER_S) + 2 * BLOCK_BYTES  # of 24 s it holds 3


def _file(path: Path) -> BandFile:
    form = SampleFormat(component="int8", layout="iq")
    return BandFile(
        band=Band.E6, path=path, described_in=path, form=form, sample_rate_hz=FS, center_frequency_hz=1278.75e6,
        start=START,
    )  # fmt: skip


@pytest.fixture(scope="module")
def companions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A RECS each 2 s with its keys and observations, and samples of noise."""
    folder = tmp_path_factory.mktemp("companions")
    scenario = with_default_range(load_scenario(QUICK, (f"interval_s={INTERVAL_S}", f"epochs={N_EPOCHS}")))  # type: ignore[arg-type]
    write_companions(AcasTestCase(scenario=scenario, first=0, end=N_EPOCHS), folder)
    (folder / "e6").write_bytes(DATA.tobytes())
    return folder


class Pipe:
    """A pipe of E6 samples, its reader, and what was told."""

    def __init__(self, *, capacity_bytes: int = 1 << 26, can_wait: bool = True) -> None:
        self._reading, self._writing = os.pipe()
        self.n_written = 0
        options = {} if can_wait else {"can_wait": False}
        self.stream = SampleStream(self._reading, _file(Path("-")), capacity_bytes=capacity_bytes, **options)
        self.told: list[str] = []

    def write(self, n_bytes: int) -> None:
        """Write the next bytes, and close the pipe after the last."""
        data = memoryview(DATA.tobytes())[self.n_written : self.n_written + n_bytes]
        while data:
            n = os.write(self._writing, data)
            data, self.n_written = data[n:], self.n_written + n
        if self.n_written == DATA.size and self._writing >= 0:
            os.close(self._writing)
            self._writing = -1

    def read_by(self, n_bytes: int) -> None:
        """Wait until the reader has taken so much."""
        deadline = time.monotonic() + 30
        while self.stream._end_byte < n_bytes or (n_bytes == DATA.size and not self.stream._ended):
            assert time.monotonic() < deadline
            time.sleep(1e-3)

    def close(self) -> None:
        """End the reader, whatever it waits for, before its descriptor can be another file's."""
        if self._writing >= 0:
            os.close(self._writing)
        self.stream.keep([], 1 << 40)
        while not self.stream.look().ended:
            self.stream.wait(0.1)
            self.stream.keep([], 1 << 40)
        os.close(self._reading)


@pytest.fixture
def pipe() -> Iterator[Callable[..., Pipe]]:
    made: list[Pipe] = []

    def make(**options: object) -> Pipe:
        made.append(Pipe(**options))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for one in made:
        one.close()


def _following(
    companions: Path,
    pipe: Pipe | None = None,
    *,
    assistance: Path | None = None,
    observations: Path | None = None,
    **patience: float,
) -> Following:
    told = [] if pipe is None else pipe.told
    path = companions / "e6" if pipe is None else Path("-")
    live = LiveRecording(
        RecordingDescription(path=path, bands={Band.E6: _file(path)}),
        observations=observations or companions / "observations.csv",
        streams={} if pipe is None else {Band.E6: pipe.stream},
        warn=lambda error: told.append(str(error)),
    )
    folder = GrowingAssistance(assistance or companions / "assistance", warn=lambda error: told.append(str(error)))
    how = WaitLimits(**({"poll_s": 0.005, "idle_s": None if pipe else 0.02} | patience))
    return Following(live=live, folder=folder, time_uncertainty_s=1.0, searchable=False, patience=how)


def _samples(epoch: FollowedEpoch) -> bytes:
    return b"" if epoch.snapshot.e6 is None else epoch.snapshot.e6.batch.samples.tobytes()


@pytest.fixture(scope="module")
def finished(companions: Path) -> list[bytes]:
    """The samples of each RECS in the finished recording."""
    found = [_samples(epoch) for epoch in _following(companions)]
    assert len(found) == N_EPOCHS
    assert all(found)
    return found


def test_what_is_read_between_two_questions_loses_nothing(
    companions: Path, finished: list[bytes], pipe: Callable[..., Pipe], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bursts of 3.7 s arrive after it was asked which RECS are in the samples, before others are let go."""
    fed, to_come = pipe(), Following._to_come

    def followed_by_a_burst(self: Following) -> list[GalileoTime]:
        answer = to_come(self)
        fed.write(round(3.7 * BYTES_PER_S))
        fed.read_by(fed.n_written)
        return answer

    monkeypatch.setattr(Following, "_to_come", followed_by_a_burst)
    assert [_samples(epoch) for epoch in _following(companions, fed)] == finished
    assert fed.told == []


@pytest.mark.parametrize("clock_s", [2.3, -1.7])
def test_a_clock_that_is_wrong_by_seconds_is_followed(
    companions: Path, tmp_path: Path, pipe: Callable[..., Pipe], clock_s: float
) -> None:
    """The observations say where the samples are; before the first of them nothing is let go."""
    lines = [line.split(",") for line in (companions / "observations.csv").read_text().splitlines()]
    column = lines[0].index("pseudorange_m")
    for line in lines[1:]:
        line[column] = repr(float(line[column]) + clock_s * SPEED_OF_LIGHT_MPS)
    path = tmp_path / "observations.csv"
    path.write_text("\n".join(map(",".join, lines)) + "\n")
    finished = [_samples(epoch) for epoch in _following(companions, observations=path)]
    fed = pipe()
    fed.write(BLOCK_BYTES)
    following = _following(companions, fed, observations=path)
    feeder = threading.Thread(target=fed.write, args=(DATA.size,), daemon=True)
    feeder.start()
    assert [_samples(epoch) for epoch in following] == finished
    feeder.join(30)
    assert fed.n_written == DATA.size
    assert all(finished[1:-2])


def test_the_writer_waits_while_the_buffer_is_full_of_recs_without_keys(
    companions: Path, tmp_path: Path, finished: list[bytes], pipe: Callable[..., Pipe], monkeypatch: pytest.MonkeyPatch
) -> None:
    """While it waits, a minute without anything new is no end of the recording."""
    assistance = tmp_path / "assistance"
    assistance.mkdir()
    for path in (companions / "assistance").iterdir():
        if path.name != "keys.csv":
            os.link(path, assistance / path.name)
    fed = pipe(capacity_bytes=SMALL)
    in_pipe = fcntl.fcntl(fed._writing, fcntl.F_GETPIPE_SZ)
    feeder = threading.Thread(target=fed.write, args=(DATA.size,), daemon=True)
    feeder.start()
    waited, clock_s = LiveRecording.wait, [0.0]

    def until_it_is_full(self: LiveRecording, timeout_s: float) -> None:
        waited(self, timeout_s)
        if fed.told and not (assistance / "keys.csv").exists():
            assert fed.stream._n_kept <= SMALL
            assert fed.n_written < DATA.size / 2  # some gaps were let go, and it is held up
            assert fed.n_written <= fed.stream._end_byte + in_pipe
            clock_s[0] += 50.0
            if clock_s[0] > 100.0:
                os.link(companions / "assistance" / "keys.csv", assistance / "keys.csv")

    monkeypatch.setattr(LiveRecording, "wait", until_it_is_full)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock_s[0]))
    found = [_samples(epoch) for epoch in _following(companions, fed, assistance=assistance, idle_s=60.0)]
    assert found == finished
    assert len(set(fed.told)) == 1
    assert "the program that writes the pipe has to wait" in fed.told[0]


def test_a_writer_that_cannot_wait_loses_what_is_said_and_counted(
    companions: Path, tmp_path: Path, finished: list[bytes], pipe: Callable[..., Pipe]
) -> None:
    """The keys never come: the first windows stay, the last ones do not fit, and none is there in part."""
    for path in (companions / "assistance").iterdir():
        if path.name != "keys.csv":
            os.link(path, tmp_path / path.name)
    fed = pipe(capacity_bytes=SMALL, can_wait=False)
    feeder = threading.Thread(target=fed.write, args=(DATA.size,), daemon=True)
    feeder.start()
    following = _following(companions, fed, assistance=tmp_path)
    found = [_samples(epoch) for epoch in following]
    feeder.join(30)
    assert fed.n_written == DATA.size
    lost = [number for number, samples in enumerate(found) if not samples]
    assert found[0] == finished[0]
    assert N_EPOCHS - 3 <= len(lost) < N_EPOCHS  # three windows fit
    assert all(samples in (b"", whole) for samples, whole in zip(found, finished, strict=True))
    assert following.live.n_dropped == len(lost)
    said = [line for line in fed.told if "were dropped" in line]
    assert len(said) == len(lost)
    assert "(--buffer-mb)" in said[0]


def test_a_recs_that_comes_after_its_samples_is_said_and_counted(companions: Path, pipe: Callable[..., Pipe]) -> None:
    fed = pipe()
    live = _following(companions, fed).live
    live.place([0.08])  # the clock is right: what is not asked for need not be kept
    fed.write(10 * BYTES_PER_S)
    fed.read_by(fed.n_written)
    assert live.look()
    live.keep([START + 6.0], START + 9.0)
    kept, late = (live.recording(START + s).e6 for s in (6.0, 3.0))
    assert kept is not None
    assert late is not None
    assert (kept.n_samples > FS, late.n_samples) == (True, 0)
    assert (live.n_dropped, len(fed.told)) == (1, 1)
    assert "the RECS came too late" in fed.told[0]


def test_windows_that_overlap_are_there_once(pipe: Callable[..., Pipe]) -> None:
    """A RECS each 0.1 s waits for its key: windows of 1.4 s each, that are no more than the stream."""
    fed = pipe()
    fed.write(10 * BYTES_PER_S)
    fed.read_by(fed.n_written)
    description = RecordingDescription(path=Path("-"), bands={Band.E6: _file(Path("-"))})
    live = LiveRecording(description, observations=None, streams={Band.E6: fed.stream}, warn=pytest.fail)
    live.keep([START + 0.1 * n for n in range(1, 90)], START + 9.5)
    assert fed.stream._n_kept <= fed.n_written
    live.keep([START + 3.0], START + 9.5)
    assert fed.stream._n_kept <= (1.46 + 1.2) * BYTES_PER_S + 4 * BLOCK_BYTES  # that of 3 s, and the end
