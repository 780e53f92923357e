"""Files that never end, or hold more than they can mean, are refused before they are read."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from vestige.crypto.file_bytes import read_bytes, read_text
from vestige.crypto.recs import recs_file
from vestige.errors import InputFileError
from vestige.plots.curves.sweep import read_sweep
from vestige.receiver.errors.empirical_ionosphere import read_residuals
from vestige.recording.assistance.assistance_files import Settings, read_recs
from vestige.report.threat_table import read_threat_table
from vestige.scenario.load import load_scenario
from vestige.spoofer.profile_table import read_profile_table

READERS = (
    lambda path: read_recs(path, Settings()),
    load_scenario,
    read_profile_table,
    read_residuals,
    read_sweep,
    read_threat_table,
    recs_file.read_recs_file,
)


@pytest.mark.parametrize("read", READERS)
def test_no_pipe_no_device_and_no_monster_is_read(tmp_path: Path, read: Callable[[Path], object]) -> None:
    pipe, device, monster = (tmp_path / name for name in ("pipe.csv", "device.csv", "monster.csv"))
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    monster.touch()
    os.truncate(monster, 1 << 40)
    for path, found in ((pipe, "something else"), (device, "something else"), (monster, f"{1 << 40} bytes")):
        with pytest.raises(InputFileError, match=f"found {found}, expected"):
            read(path)


def test_text_is_utf_8_with_or_without_a_mark(tmp_path: Path) -> None:
    path = tmp_path / "text"
    for mark in (b"", b"\xef\xbb\xbf"):
        path.write_bytes(mark + "é\n".encode())
        assert read_text(path, at_most=6) == "é\n"
    path.write_bytes(b"ab\xff")
    with pytest.raises(InputFileError, match="byte 2: found bytes that are not UTF-8"):
        read_text(path, at_most=6)


def test_the_limit_is_the_longest_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bytes"
    path.write_bytes(b"1234")
    assert read_bytes(path, at_most=4) == b"1234"
    with pytest.raises(InputFileError, match="found 4 bytes, expected at most 3 bytes"):
        read_bytes(path, at_most=3)
