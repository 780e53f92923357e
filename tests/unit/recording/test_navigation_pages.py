from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError
from vestige.recording.navigation.navigation_pages import read_pages


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "found nothing, expected SBF or an OSNMA test-vector CSV"),
        (b"\x7fELF", "expected SBF or an OSNMA test-vector CSV"),
        (b"SVID,NumNavBits,NavBitsHEX\n", "line 2"),
        (b"noise$@noise", "0 SBF blocks"),
    ],
)
def test_the_content_decides(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "any.name"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=words):
        list(read_pages(path))


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "absent"):
        with pytest.raises(InputFileError):
            list(read_pages(path))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=3000), st.sampled_from([b"", b"$@", b"SVID,NumNavBits,NavBitsHEX\n"]))
def test_garbage_gives_one_line(tmp_path: Path, garbage: bytes, head: bytes) -> None:
    path = tmp_path / "garbage"
    path.write_bytes(head + garbage)
    with pytest.raises(InputFileError):
        list(read_pages(path))
