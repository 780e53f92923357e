"""No RECS of a pipe loses its samples: twenty runs at full speed, and twenty with a writer that stalls and bursts.

Another process writes while the reader's thread and the epochs go on as they happen to. `test_live_recording` has the
same without chance, for the one moment that was wrong once: RECS were lost when what was let go depended on an end that
the reader's thread had moved on. With that mistake the runs at full speed lose 7 to 35 of 90 RECS each.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from vestige.recording.assistance.growing_assistance import GrowingAssistance
from vestige.recording.description import BandFile, RecordingDescription
from vestige.recording.live.following import FollowedEpoch, Following, WaitLimits
from vestige.recording.live.live_recording import LiveRecording, buffer_s
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sample_stream import BLOCK_BYTES, SampleStream
from vestige.records import Band
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase, with_default_range
from vestige.simulated.exported_case_folder import write_companions
from vestige.time import GalileoTime

QUICK = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
START = GalileoTime.parse("2026-11-21T12:00:00 GST")
N_EPOCHS, INTERVAL_S = 90, 2.0
FS = 1e5  # of samples that nobody correlates: a run takes half a second
BYTES_PER_S = round(2 * FS)
LARGE, SMALL = 1 << 26, round(buffer_s(0.0) * BYTES_PER_S) + 2 * BLOCK_BYTES  # all of it, and 3 of 90 RECS

STALLS_AND_BURSTS = """
import itertools, sys, time
with open(sys.argv[1], "rb") as samples:
    for n_bytes, pause_s in itertools.cycle([(1_000_000, 0.005), (1, 0.0), (77_777, 0.02), (2_000_001, 0.005)]):
        piece = samples.read(n_bytes)
        if not piece:
            break
        sys.stdout.buffer.write(piece)
        sys.stdout.buffer.flush()
        time.sleep(pause_s)
"""
WRITERS = {"full speed": ["cat"], "stalls and bursts": [sys.executable, "-c", STALLS_AND_BURSTS]}


@pytest.fixture(scope="module")
def companions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A RECS each 2 s with its keys and observations, and three minutes of noise."""
    folder = tmp_path_factory.mktemp("pipe")
    scenario = with_default_range(load_scenario(QUICK, (f"interval_s={INTERVAL_S}", f"epochs={N_EPOCHS}")))  # type: ignore[arg-type]
    write_companions(AcasTestCase(scenario=scenario, first=0, end=N_EPOCHS), folder)
    n_bytes = round((N_EPOCHS * INTERVAL_S + 1) * BYTES_PER_S)
    (folder / "e6").write_bytes(np.random.default_rng(5).integers(-100, 100, n_bytes, dtype=np.int8).tobytes())
    return folder


def _file(path: Path) -> BandFile:
    form = SampleFormat(component="int8", layout="iq")
    return BandFile(
        band=Band.E6, path=path, described_in=path, form=form, sample_rate_hz=FS, center_frequency_hz=1278.75e6,
        start=START,
    )  # fmt: skip


def _following(companions: Path, stream: SampleStream | None, told: list[str]) -> Following:
    path = companions / "e6" if stream is None else Path("-")
    live = LiveRecording(
        RecordingDescription(path=path, bands={Band.E6: _file(path)}),
        observations=companions / "observations.csv",
        streams={} if stream is None else {Band.E6: stream},
        warn=lambda error: told.append(str(error)),
    )
    folder = GrowingAssistance(companions / "assistance", warn=lambda error: told.append(str(error)))
    patience = WaitLimits(poll_s=0.005, idle_s=0.02 if stream is None else None)
    return Following(live=live, folder=folder, time_uncertainty_s=1.0, searchable=False, patience=patience)


def _samples(epoch: FollowedEpoch) -> bytes:
    return b"" if epoch.snapshot.e6 is None else epoch.snapshot.e6.batch.samples.tobytes()


@pytest.fixture(autouse=True)
def _threads_take_turns_often() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.fixture(scope="module")
def finished(companions: Path) -> list[bytes]:
    """The samples of each RECS in the finished recording."""
    found = [_samples(epoch) for epoch in _following(companions, None, [])]
    assert len(found) == N_EPOCHS
    assert all(found)
    return found


@pytest.mark.parametrize(("capacity_bytes", "n_runs"), [(LARGE, 20), (SMALL, 5)], ids=["large buffer", "small buffer"])
@pytest.mark.parametrize("writer", WRITERS)
def test_every_recs_of_a_pipe_has_its_samples(
    companions: Path, finished: list[bytes], writer: str, capacity_bytes: int, n_runs: int
) -> None:
    for _ in range(n_runs):
        told: list[str] = []
        with subprocess.Popen([*WRITERS[writer], str(companions / "e6")], stdout=subprocess.PIPE) as process:  # noqa: S603
            assert process.stdout is not None
            stream = SampleStream(process.stdout.fileno(), _file(Path("-")), capacity_bytes=capacity_bytes)
            try:
                following = _following(companions, stream, told)
                found = [_samples(epoch) for epoch in following]
            finally:
                process.kill()  # if it has not ended, the test has failed
                while not stream.look().ended:
                    stream.keep([], 1 << 40)
                    stream.wait(0.1)
        assert process.returncode in (0, -9)
        assert sum(map(bool, found)) == N_EPOCHS
        assert found == finished
        assert following.live.n_dropped == 0
        assert not [line for line in told if "dropped" in line]
