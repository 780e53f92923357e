from __future__ import annotations

import errno
import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

from vestige.errors import InputFileError
from vestige.folder_lock import only_writer

HOLDER = """
import sys, time
from pathlib import Path
from vestige.folder_lock import only_writer
with only_writer(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_second_writer_is_refused_until_the_first_has_left(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    with only_writer(folder):
        with pytest.raises(InputFileError, match="found another process that writes into it"), only_writer(folder):
            pass
        with only_writer(tmp_path / "other"):
            pass
    with only_writer(folder):
        assert list(folder.iterdir()) == []


def test_the_lock_of_a_process_that_was_killed_is_gone(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE) as holder:  # noqa: S603
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(InputFileError, match="one process at a time"), only_writer(tmp_path):
            pass
        holder.kill()
        holder.wait()
        with only_writer(tmp_path):
            pass


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputFileError, match="found a file, expected a folder"), only_writer(tmp_path / "file"):
        pass


def test_a_file_system_without_locks_is_used_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    with only_writer(tmp_path):
        (tmp_path / "written").write_text("")
