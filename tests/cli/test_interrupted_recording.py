"""A recording whose process was killed: the same command resumes it, with the bytes of an undisturbed run."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from vestige.cli.recordings.simulate import command as simulate
from vestige.errors import InputFileError
from vestige.receiver.samples.recorder import stretch_samples
from vestige.records import Band
from vestige.simulated import simulated_recording, unfinished_recording

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
ONE = (
    str(SCENARIOS / "quick.toml"), "--epochs", "5:8", "--set", "receiver.sample_rate_hz=3e6", "--set", "interval_s=0.1",
)  # fmt: skip
SKY = (
    str(SCENARIOS / "night.toml"), "--epochs", "50:53", "--set", "receiver.sample_rate_hz=6.2e6",
    "--set", "constellation.svids=[7, 8]", "--set", "recs.every=10",
)  # fmt: skip
STRETCH = stretch_samples(3e6)

# It writes slowly, so that it is killed while it writes.
PROGRAM = """
import sys, time
from vestige.cli.main import main
from vestige.recording.samples.sigmf_writer import SigmfWriter
from vestige.records import Band
from vestige.simulated import simulated_recording

append = SigmfWriter.append
def slowly(self, batch):
    time.sleep(0.01)
    append(self, batch)

SigmfWriter.append = slowly
simulated_recording._KEPT_BATCHES = 7
main(sys.argv[1:])
"""


def invoked(output: Path, *arguments: object) -> Result:
    return CliRunner().invoke(
        simulate, [str(one) for one in (*arguments, "-o", output)], standalone_mode=False, catch_exceptions=True
    )


def written(output: Path, *arguments: object) -> Result:
    result = invoked(output, *arguments)
    if result.exception is not None:
        raise result.exception
    return result


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return what a process leaves that is killed when all samples are written, and nothing else is complete."""

    def killed(*_: object) -> None:
        raise SystemError

    with monkeypatch.context() as patch:
        patch.setattr(simulated_recording, "_KEPT_BATCHES", 7)
        patch.setattr(simulated_recording, "write_collection", killed)
        patch.setattr(unfinished_recording.shutil, "rmtree", lambda *_, **__: None)
        assert isinstance(invoked(tmp_path / "a", *ONE).exception, SystemError)
    folder = unfinished_recording.unfinished_folder(tmp_path / "a")
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]
    return folder


def noted(folder: Path, **samples: int) -> None:
    progress = folder / "progress.json"
    progress.write_text(json.dumps(json.loads(progress.read_text()) | {"samples": samples}))


def test_what_is_counted_is_kept_and_the_rest_is_made(
    left: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """E1 was complete, E6 was cut off in a sample; what stands behind the samples that are counted is never used."""
    inside = left / "a"
    part = inside / "e6.sigmf-data.part"
    (inside / "e6.sigmf-data").rename(part)
    part.write_bytes(part.read_bytes()[: 2 * 7 * STRETCH] + b"torn off")
    complete = inside / "e1.sigmf-data"
    complete.write_bytes(complete.read_bytes() + b"behind the end")
    noted(left, E1=1_500_000, E6=7 * STRETCH)
    (inside / "of another version").write_text("stale")
    made: list[int] = []
    record_band = simulated_recording.record_band

    def counted(*arguments: object, **options: int) -> object:
        made.append(options["n_samples"])
        return record_band(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(simulated_recording, "record_band", counted)
    monkeypatch.setattr(simulated_recording.SimulatedRecording, "seconds_to_write", lambda _: 0.0)
    result = written(tmp_path / "a", *ONE)
    assert "a: resumes an interrupted recording; already there: 0.50 s of E1, 0.07 s of E6" in result.stderr
    # the first stretch of each band to compare with, and the rest of E6
    assert sorted(made) == [STRETCH, STRETCH, 1_500_000 - 7 * STRETCH]
    written(tmp_path / "undisturbed", *ONE)
    assert files(tmp_path / "a") == files(tmp_path / "undisturbed")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "undisturbed"]


def test_samples_are_in_the_file_before_they_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process may be killed at any moment; what it has not handed to the system by then is lost."""
    keep = unfinished_recording.UnfinishedRecording.keep
    counted: list[tuple[int, int]] = []

    def checked(unfinished: unfinished_recording.UnfinishedRecording, band: Band, n_samples: int) -> None:
        part = unfinished.folder / f"{band.value.lower()}.sigmf-data.part"
        counted.append((part.stat().st_size, 2 * n_samples))
        keep(unfinished, band, n_samples)

    monkeypatch.setattr(unfinished_recording.UnfinishedRecording, "keep", checked)
    monkeypatch.setattr(simulated_recording, "_KEPT_BATCHES", 7)
    written(tmp_path / "a", *ONE)
    assert len(counted) == 2 * (50 // 7 + 1)  # of two bands, 0.5 s in stretches of 10 ms, and at the end
    assert all(size == n_bytes for size, n_bytes in counted)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (("--set", "seed=2"), "scenario"),
        (("--format", "int16"), "number format"),
        (("--epochs", "5:7"), "stretch of time"),
    ],
)
def test_another_command_does_not_go_on(left: Path, tmp_path: Path, change: tuple[str, ...], found: str) -> None:
    before = files(left)
    result = invoked(tmp_path / "a", *ONE, *change)
    assert isinstance(result.exception, InputFileError)
    assert str(result.exception) == (
        f"{left}: unfinished recording: found a recording with another {found}, expected the command that began "
        "this recording; remove the folder to begin again"
    )
    assert files(left) == before


@pytest.mark.parametrize("name", ["vestige_version", "processor_name"])
def test_another_build_does_not_go_on(left: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(simulated_recording, name, lambda: "another")
    assert "found a recording with another" in str(invoked(tmp_path / "a", *ONE).exception)


def test_samples_that_are_missing_or_changed_are_no_beginning(left: Path, tmp_path: Path) -> None:
    data = left / "a" / "e1.sigmf-data"
    samples = bytearray(data.read_bytes())
    samples[100] ^= 1
    data.write_bytes(samples)
    error = invoked(tmp_path / "a", *ONE).exception
    assert "e1.sigmf-data.part: first samples: found other samples, expected the samples that this command" in str(
        error
    )
    assert list(tmp_path.iterdir()) == []  # as it says


def test_fewer_samples_than_counted(left: Path, tmp_path: Path) -> None:
    data = left / "a" / "e1.sigmf-data"
    data.write_bytes(data.read_bytes()[:-1])
    assert "found 2999999 bytes, expected 3000000 bytes" in str(invoked(tmp_path / "a", *ONE).exception)


@pytest.mark.parametrize(
    "text", ["", "[]", '{"recording": 1, "samples": {}}', '{"recording": {}, "samples": {"L1": 1}}']
)
def test_progress_that_is_none(left: Path, tmp_path: Path, text: str) -> None:
    (left / "progress.json").write_text(text)
    error = invoked(tmp_path / "a", *ONE).exception
    assert isinstance(error, InputFileError)
    assert "remove the folder to begin again" in str(error)


def test_a_folder_that_somebody_else_can_write_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    hidden = unfinished_recording.unfinished_folder(tmp_path / "a")
    hidden.symlink_to(tmp_path / "elsewhere")
    assert "expected your own folder that nobody else can write" in str(invoked(tmp_path / "a", *ONE).exception)
    hidden.unlink()
    hidden.mkdir()
    hidden.chmod(0o777)
    assert "expected your own folder that nobody else can write" in str(invoked(tmp_path / "a", *ONE).exception)


def test_two_at_once(tmp_path: Path) -> None:
    with unfinished_recording.unfinished_recording(tmp_path / "a", {}):
        error = invoked(tmp_path / "a", *ONE).exception
    assert "found another process that writes into it" in str(error)
    assert (tmp_path / "a").is_dir()


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 3])
def test_a_process_that_is_killed_while_it_writes(tmp_path: Path, workers: int) -> None:
    output = tmp_path / "a"
    progress = unfinished_recording.unfinished_folder(output) / "progress.json"
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", PROGRAM, "simulate", *SKY, "-o", str(output), "-j", "2"], stderr=subprocess.PIPE
    )
    until = time.monotonic() + 60
    while not (progress.is_file() and {"E1", "E6"} <= json.loads(progress.read_text())["samples"].keys()):
        assert time.monotonic() < until
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(0.5)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert not output.exists()
    counted = json.loads(progress.read_text())["samples"]
    assert all(0 < count < 6_900_000 for count in counted.values())  # of 2.3 s
    assert "resumes" in written(output, *SKY, "-j", workers).stderr
    written(tmp_path / "undisturbed", *SKY, "-j", 2)
    assert files(output) == files(tmp_path / "undisturbed")
