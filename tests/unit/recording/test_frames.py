"""Samples of both bands in one file or pipe, one of each in turn, as a recorder with two front ends writes them."""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click import UsageError

from builders import START, received_batch, satellite
from vestige.cli.live.live_input import opened_live, stdin_description, stdin_stream
from vestige.errors import InputFileError
from vestige.recording.live.frame_splitter import WAITING_BYTES, FrameSplitter
from vestige.recording.recording import open_recording
from vestige.recording.tracked.track_recording import streamed_batches, track_batches, tracked_batches
from vestige.records import Band
from vestige.sample_processor.tracking.tracking_receiver import TrackingReceiver

RATE_HZ = 6.2e6
TOML = """
start = "2026-11-21T12:00:00 GST"
sample_rate_hz = 6.2e6
frame = ["e1", "e6"]
[e1]
file = "both.bin"
format = "int8"
layout = "iq"
center_frequency_hz = 1575.42e6
[e6]
file = "both.bin"
format = "int8"
layout = "iq"
center_frequency_hz = 1278.75e6
"""
STDIN = {
    "description": None, "band": "both", "sample_format": "int8", "layout": "iq", "sample_rate_hz": RATE_HZ,
    "center_frequency_hz": None, "start": START, "buffer_mb": 512.0, "real_time": False,
}  # fmt: skip


@pytest.fixture(scope="module")
def frames() -> np.ndarray:
    """0.9 s of one satellite on E1, and of other numbers on E6: frames of I, Q of both bands."""
    e1 = received_batch(
        Band.E1, [satellite(11, 2.41e7, -350.0, 45.0, 45.0, seed=2)], duration_s=0.9, rate_hz=RATE_HZ, seed=4
    ).samples
    e1 = np.rint(e1.view(np.float32) * (20 / np.std(e1))).astype(np.int8).reshape(-1, 2)
    e6 = np.random.default_rng(3).integers(-128, 128, e1.shape, dtype=np.int8)
    return np.concatenate((e1, e6), axis=1)


@pytest.fixture
def folder(tmp_path: Path, frames: np.ndarray) -> Path:
    (tmp_path / "recording.toml").write_text(TOML)
    (tmp_path / "both.bin").write_bytes(frames.tobytes() + b"\1\2\3")
    return tmp_path


@pytest.fixture
def stdin(monkeypatch: pytest.MonkeyPatch, frames: np.ndarray) -> Callable[[], None]:
    """Put a pipe in place of standard input, which another thread fills as fast as it is read."""

    def replace() -> None:
        reading, writing = os.pipe()

        def write() -> None:
            with os.fdopen(writing, "wb") as pipe:
                pipe.write(frames.tobytes())

        threading.Thread(target=write, daemon=True).start()
        monkeypatch.setattr("sys.stdin", SimpleNamespace(fileno=lambda: reading))

    return replace


def _complex(components: np.ndarray) -> np.ndarray:
    return components.astype(np.float32).reshape(-1).view(np.complex64)


@pytest.mark.parametrize("order", [("e1", "e6"), ("e6", "e1")])
def test_a_file_of_frames_holds_both_bands(folder: Path, frames: np.ndarray, order: tuple[str, str]) -> None:
    (folder / "recording.toml").write_text(TOML.replace('["e1", "e6"]', str(list(order)).replace("'", '"')))
    recording = open_recording(folder)
    for name, place in zip(order, (slice(0, 2), slice(2, 4)), strict=True):
        reader = recording.reader(Band[name.upper()])
        assert reader is not None
        assert reader.n_samples == len(frames)
        assert np.array_equal(reader.samples(1000, 5000), _complex(frames[1000:6000, place]))
    assert "ends in the middle of a sample: it was cut off, or is not int8 I,Q, 1 of 2 channels" in " ".join(
        recording.notes
    )


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ('frame = ["e1", "e6"]', "", "e1.file, e6.file: found the same file for both bands"),
        ('["e1", "e6"]', '["e1", "e1"]', "frame: found"),
        ('["e1", "e6"]', '["e1"]', "frame: found"),
        ('[e6]\nfile = "both.bin"', '[e6]\nfile = "recording.toml"', "file: found"),
        ('[e6]\nfile = "both.bin"\nformat = "int8"', '[e6]\nfile = "both.bin"\nformat = "int16"', "format and layout"),
        ("1278.75e6", "1278.75e6\nfirst_sample = 3", "first_sample: found 0 and 3"),
        ("1278.75e6", "1278.75e6\nsample_rate_hz = 7e6", "sample_rate_hz: found 6200000.0 and 7000000.0"),
    ],
)
def test_frames_that_cannot_be_are_one_line(folder: Path, old: str, new: str, place: str) -> None:
    text = TOML.replace(old, new)
    assert text != TOML
    (folder / "recording.toml").write_text(text)
    with pytest.raises(InputFileError) as error:
        open_recording(folder)
    assert place in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("piece", [1, 5, 4096])
def test_the_splitter_gives_each_channel_its_bytes(piece: int) -> None:
    content = np.random.default_rng(1).bytes(6 * 3000 + 7)
    source = io.BytesIO(content)
    splitter = FrameSplitter(
        lambda at_most: source.read(min(piece, at_most)),
        sample_bytes=2, n_channels=3, wanted=[0, 2], header_bytes=5,
    )  # fmt: skip
    found = dict.fromkeys((0, 2), b"")
    while read := {channel: splitter.read(channel, 999) for channel in found}:
        found = {channel: found[channel] + read[channel] for channel in found}
        if not any(read.values()):
            break
    expected = np.frombuffer(content[5:-2], np.uint8).reshape(-1, 3, 2)
    assert found == {channel: expected[:, channel].tobytes() for channel in found}


def test_a_channel_that_nobody_takes_holds_up_the_pipe() -> None:
    """What waits has a limit: the pipe is not read on until the other channel is taken, too."""
    n_read = 0

    def read(at_most: int) -> bytes:
        nonlocal n_read
        n_read += at_most
        return bytes(at_most)

    splitter = FrameSplitter(read, sample_bytes=4, n_channels=2)
    taken = threading.Thread(target=lambda: [splitter.read(0, 1 << 16) for _ in range(200)], daemon=True)
    taken.start()
    taken.join(0.3)
    assert taken.is_alive()
    assert WAITING_BYTES <= n_read / 2 <= 2 * WAITING_BYTES
    while taken.is_alive():
        splitter.read(1, 1 << 20)
    assert n_read / 2 >= 200 << 16


def test_an_error_of_the_pipe_reaches_both_channels() -> None:
    def read(_at_most: int) -> bytes:
        raise OSError(5, "Input/output error")

    splitter = FrameSplitter(read, sample_bytes=1, n_channels=2)
    for channel in (0, 1):
        with pytest.raises(OSError, match="Input/output error"):
            splitter.read(channel, 1)


def test_tracked_out_of_a_pipe_as_out_of_the_file(
    folder: Path, stdin: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """E1 of the frames on standard input gives the observations of the file, bit for bit; E6 is dropped."""
    monkeypatch.setattr("vestige.recording.tracked.track_recording.TrackingReceiver", _of_one_satellite)
    stdin()
    stream = stdin_stream(stdin_description(STDIN, "e1").bands[Band.E1], capacity_bytes=6_000_000)
    piped = track_batches(streamed_batches(stream))
    reader = open_recording(folder).e1
    assert reader is not None
    filed = track_batches(tracked_batches(reader))
    assert len(piped.epochs) == len(filed.epochs) >= 7
    assert set(piped.epochs[-1].observations) == {11}
    assert repr([one.observations for one in piped.epochs]) == repr([one.observations for one in filed.epochs])


def _of_one_satellite(**settings: object) -> TrackingReceiver:
    return TrackingReceiver(svids=(11,), **settings)  # type: ignore[arg-type]


def test_both_bands_are_followed_out_of_one_pipe(folder: Path, stdin: Callable[[], None], frames: np.ndarray) -> None:
    """The samples of both bands have the number, and the values, of those in the file; with --description, too."""
    for description in (None, folder / "recording.toml"):
        stdin()
        options = STDIN if description is None else STDIN | {"description": description, "band": None}
        live = opened_live(
            stdin_description(options), options, None, None, print, replaceable=True, told=True, around_s=0.0
        )
        while not live.ended:
            live.wait(0.01)
            live.look()
        assert live.end - START == pytest.approx(len(frames) / RATE_HZ, abs=1e-9)
        found = live.recording(START)
        for reader, place in ((found.e1, slice(0, 2)), (found.e6, slice(2, 4))):
            assert reader is not None
            assert reader.end_sample > 0.8 * RATE_HZ
            assert np.array_equal(reader.samples(777, 4000), _complex(frames[777:4777, place]))


def test_two_bands_have_no_common_center_frequency() -> None:
    with pytest.raises(UsageError, match="with --band both, 0 Hz is the carrier of each band"):
        stdin_description(STDIN | {"center_frequency_hz": 1575.42e6})
    with pytest.raises(UsageError, match="need --layout, --sample-rate-hz, or --description"):
        stdin_description(STDIN | {"layout": None, "sample_rate_hz": None})
