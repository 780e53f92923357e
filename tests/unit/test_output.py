"""Outputs: complete or as before, never over an input, never through a link, and nothing is left after an error."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from builders import START
from full_disk import files_of_at_most
from simulated_chain import make_chain
from vestige import plots
from vestige.crypto.keys.key_file import write_key_file
from vestige.errors import InputFileError
from vestige.output import check_output, new_folder, replacement
from vestige.recording.assistance.receiver_corrections import write_hardware_bias
from vestige.recording.live.follow_journal import LINES, FollowJournal
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import SigmfWriter
from vestige.recording.search_log import SearchLog
from vestige.records import Band, SampleBatch
from vestige.report.page import Page, write_page
from vestige.sample_processor.search.exhaustive_search import SearchState
from vestige.threats.runs import write_runs

CHAIN = make_chain(b"test of outputs", START, 3)
STATE = SearchState(done=1.0, total=2.0, peaks=(), block_start=START, block_magnitude=1.0, blocks=1)
FORM = SampleFormat(component="int8", layout="iq")


def test_the_folder_is_there_when_it_is_complete(tmp_path: Path) -> None:
    with new_folder(tmp_path / "above" / "a") as part:
        (part / "file").write_text("text")
        assert not (tmp_path / "above" / "a").exists()
    assert [path.name for path in (tmp_path / "above").iterdir()] == ["a"]
    assert (tmp_path / "above" / "a" / "file").read_text() == "text"


def test_two_writers_at_once(tmp_path: Path) -> None:
    """The first to end has written its own files only, the second is refused and leaves nothing."""
    first, second = new_folder(tmp_path / "a"), new_folder(tmp_path / "a")
    one, two = first.__enter__(), second.__enter__()
    for number, part in enumerate((one, two, one, two)):
        (part / f"{number}").write_text("text")
    second.__exit__(None, None, None)
    with pytest.raises(InputFileError, match="a: output folder: found an existing file or folder"):
        first.__exit__(None, None, None)
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["1", "3"]
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_writer_that_fails_leaves_the_other_alone(tmp_path: Path) -> None:
    with new_folder(tmp_path / "a") as part:
        (part / "file").write_text("text")
        with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "a"):
            raise KeyboardInterrupt
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["file"]


def test_what_a_killed_writer_left_is_no_result(tmp_path: Path) -> None:
    killed = new_folder(tmp_path / "a")  # still held at the end, so that nothing cleans up after it
    (killed.__enter__() / "half").write_text("text")
    assert not (tmp_path / "a").exists()
    with new_folder(tmp_path / "a") as part:
        assert not list(part.iterdir())
        (part / "whole").write_text("text")
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["whole"]
    with pytest.raises(InputFileError):
        killed.__exit__(None, None, None)


def test_a_name_that_is_taken(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(InputFileError, match="expected a new name"), new_folder(tmp_path / "a"):
        pass


def test_where_nothing_can_be_written_the_error_has_the_name_of_the_output() -> None:
    with pytest.raises(OSError, match=r"/proc/a'?$"), new_folder(Path("/proc/a")):
        pass


def test_an_output_that_is_an_input_or_lies_among_inputs_is_refused(tmp_path: Path) -> None:
    recording, page = tmp_path / "raw", tmp_path / "pages.sbf"
    recording.mkdir()
    (recording / "e6.bin").write_bytes(b"samples")
    page.write_bytes(b"pages")
    (tmp_path / "linked").symlink_to(recording)
    (tmp_path / "hard.sbf").hardlink_to(page)
    inputs = (recording, page, None)
    for name in ("raw/e6.bin", "raw/new.csv", "linked/e6.bin", "raw/../pages.sbf", "hard.sbf"):
        with pytest.raises(InputFileError, match=rf"{name}: output: found (an input|a path in the input folder raw)"):
            check_output(tmp_path / name, inputs)
    for folder in (recording, tmp_path / "linked"):
        with pytest.raises(InputFileError, match="output: found an input"):
            check_output(folder, inputs, folder=True)
    check_output(tmp_path / "verdicts.csv", inputs)
    check_output(recording / "journal", inputs, folder=True)
    check_output(None, inputs)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        check_output(tmp_path / "nowhere" / "keys.csv", inputs)


def test_nothing_is_written_into_the_results_of_a_campaign(tmp_path: Path) -> None:
    (tmp_path / "a.zarr" / "c").mkdir(parents=True)
    (tmp_path / "a.zarr" / "zarr.json").write_text("{}")
    for name in ("keys.csv", "c/0", "b.zarr"):
        output = tmp_path / "a.zarr" / name
        for written in (replacement, new_folder):
            with pytest.raises(InputFileError, match=r"a path in the results a\.zarr"), written(output):
                pass
        with pytest.raises(InputFileError, match=r"a path in the results a\.zarr"):
            check_output(output, ())
    assert sorted(path.name for path in (tmp_path / "a.zarr").iterdir()) == ["c", "zarr.json"]


def test_a_link_or_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years")
    (tmp_path / "keys.csv").symlink_to(tmp_path / "thesis.tex")
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    os.mkfifo(tmp_path / "pipe")
    for name, found in (
        ("keys.csv", "a symbolic link"),
        ("dangling", "a symbolic link"),
        ("pipe", "a device or a pipe"),
    ):
        with pytest.raises(InputFileError, match=f"{name}: output: found {found}"), replacement(tmp_path / name):
            pass
        with pytest.raises(InputFileError, match=f"{name}: output: found {found}"):
            check_output(tmp_path / name, ())
    assert (tmp_path / "thesis.tex").read_text() == "years"
    assert not (tmp_path / "nothing").exists()


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_writer_that_fails_leaves_what_was_there(tmp_path: Path, error: type[BaseException]) -> None:
    (tmp_path / "keys.csv").write_text("before")
    with pytest.raises(error), replacement(tmp_path / "keys.csv") as part:  # noqa: PT012
        part.write_text("half")
        raise error
    assert (tmp_path / "keys.csv").read_text() == "before"
    assert [path.name for path in tmp_path.iterdir()] == ["keys.csv"]


def test_a_folder_is_replaced_as_a_whole(tmp_path: Path) -> None:
    for number in range(2):
        with replacement(tmp_path / "a.zarr") as part:
            part.mkdir()
            (part / str(number)).write_text("")
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]
    assert [path.name for path in (tmp_path / "a.zarr").iterdir()] == ["1"]


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, synced = tmp_path / "log.json", []
    sync = os.fsync

    def watched(number: int) -> None:
        synced.append((os.fstat(number).st_ino, os.fstat(number).st_size, path.exists()))
        sync(number)

    monkeypatch.setattr(os, "fsync", watched)
    with replacement(path) as part:
        part.write_text("content")
    assert synced == [(path.stat().st_ino, len("content"), False)]


WRITERS: dict[str, Callable[[Path], object]] = {
    "keys.csv": lambda path: write_key_file(path, CHAIN.validated_keys(), (CHAIN.root,)),
    "log.json": lambda path: SearchLog(path=path, of={}).keep("a", STATE),
    "receiver.toml": lambda path: write_hardware_bias(path.parent, 1e-9),
    "page.html": lambda path: write_page(Page(title="", question="", body=(), version="1"), path),
    "runs.csv": lambda path: write_runs(path, {}),
    "figure.png": lambda path: plots.write(plots.new_axes(), path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_after_a_full_disk_nothing_is_left_and_the_error_has_the_name(tmp_path: Path, name: str) -> None:
    with files_of_at_most(10), pytest.raises(OSError, match=rf"{name}'?$"):
        WRITERS[name](tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", WRITERS)
def test_nothing_is_written_through_a_link_that_was_prepared(tmp_path: Path, name: str) -> None:
    (tmp_path / "thesis.tex").write_text("years")
    for prepared in (f"{name}.part", f".{name}.part", f".{name}"):
        (tmp_path / prepared).symlink_to(tmp_path / "thesis.tex")
    WRITERS[name](tmp_path / name)
    assert (tmp_path / "thesis.tex").read_text() == "years"
    assert (tmp_path / name).is_file()
    assert not (tmp_path / name).is_symlink()


def test_a_journal_writes_through_no_link(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years")
    kept = tmp_path / "kept"
    with FollowJournal(kept, {}):
        pass
    (kept / LINES).unlink()
    (kept / LINES).symlink_to(tmp_path / "thesis.tex")
    with pytest.raises(InputFileError, match=f"{LINES}: output: found a symbolic link"):
        FollowJournal(kept, {})
    assert (tmp_path / "thesis.tex").read_text() == "years"


def test_a_journal_on_a_full_disk_says_its_name_and_goes_on_later(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    with FollowJournal(kept, {}):
        pass
    with files_of_at_most(10), pytest.raises(OSError, match=rf"{LINES}'?$"), FollowJournal(kept, {}) as journal:
        journal.record(["x" * 100], None)  # type: ignore[arg-type]  (it is not reached)
    with FollowJournal(kept, {}):
        assert (kept / LINES).read_text() == ""


def test_samples_are_written_through_no_link_and_leave_nothing_on_a_full_disk(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years")
    (tmp_path / "e6.sigmf-data.part").symlink_to(tmp_path / "thesis.tex")
    writer = SigmfWriter(tmp_path / "e6", form=FORM)
    batch = SampleBatch(
        band=Band.E6, start=START, first_sample=0, sample_rate_hz=1e7, center_frequency_hz=1278.75e6,
        samples=np.ones(100, np.complex64),
    )  # fmt: skip
    with files_of_at_most(10), pytest.raises(OSError, match="File too large"), writer:
        writer.append(batch)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"thesis.tex": "years"}
