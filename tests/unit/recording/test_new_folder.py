from __future__ import annotations

from pathlib import Path

import pytest

from vestige.errors import InputFileError
from vestige.recording.new_folder import new_folder


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
    with pytest.raises(InputFileError, match="a: output folder: found something there already"):
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
    with pytest.raises(InputFileError, match="a name that is not taken"), new_folder(tmp_path / "a"):
        pass


def test_where_nothing_can_be_written_the_error_has_the_name_of_the_output() -> None:
    with pytest.raises(OSError, match=r"/proc/a'?$"), new_folder(Path("/proc/a")):
        pass
