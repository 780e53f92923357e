from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from osnma_builder import make_page, make_word
from page_files import inav_block, sbf_block
from vestige.errors import InputFileError
from vestige.recording.observations.sbf import SbfCounts, read_sbf
from vestige.time import GalileoTime

START = GalileoTime(1372, 604_799)  # the page ends in the next week
PAGES = [
    make_page(svid, START + 2 * k, make_word(5, svid, START + 2 * k, issue=k), bytes([0x82, k, 1, 2, 3]))
    for k in range(20)
    for svid in (4, 36)
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "recording.sbf"


def test_pages_come_back(path: Path) -> None:
    path.write_bytes(b"".join(map(inav_block, PAGES)))
    counts = SbfCounts()
    assert list(read_sbf(path, counts)) == PAGES
    assert counts == SbfCounts(blocks=len(PAGES), e1b=len(PAGES))
    assert all(page.crc_ok for page in read_sbf(path))


def test_garbage_other_blocks_and_cut_blocks_are_skipped_and_counted(path: Path) -> None:
    blocks = [inav_block(page) for page in PAGES]
    other = sbf_block(b"another kind of block", number=4007)
    bad = bytearray(blocks[1])
    bad[20] ^= 1
    long = b"$@" + b"\0\0" + struct.pack("<HH", 4023, 0xFFFC)  # claims to be longer than the file
    path.write_bytes(
        blocks[0][26:] + blocks[0] + b"$$@$@" + other + bytes(bad) + blocks[1] + long + blocks[2] + blocks[3][:-1]
    )
    counts = SbfCounts()
    assert list(read_sbf(path, counts)) == PAGES[:3]
    assert counts.blocks == 4
    assert counts.bad_blocks >= 3
    assert counts.skipped_bytes == 26 + 5 + 52 + 8 + 51


def test_blocks_across_the_border_of_what_is_read_at_once(path: Path) -> None:
    filler = sbf_block(bytes(60_000), number=1)
    path.write_bytes(filler * 17 + b"".join(map(inav_block, PAGES)) + filler * 20 + inav_block(PAGES[0]))
    assert list(read_sbf(path)) == [*PAGES, PAGES[0]]


@pytest.mark.parametrize(("source", "name"), [(21, "e5b"), (17 | 0x20, "mixed"), (21 | 0x20, "mixed"), (19, "other")])
def test_only_e1b_is_read(path: Path, source: int, name: str) -> None:
    path.write_bytes(inav_block(PAGES[0]) + inav_block(PAGES[1], source=source))
    counts = SbfCounts()
    assert list(read_sbf(path, counts)) == PAGES[:1]
    assert getattr(counts, name) == 1


@pytest.mark.parametrize(
    ("tow_ms", "week", "svid"),
    [
        (0xFFFFFFFF, 2396, 74), (1000, 0xFFFF, 74), (1000, 1024, 74), (1500, 2396, 74), (604_801_000, 2396, 74),
        (1000, 2396, 70), (1000, 2396, 107),
    ],
)  # fmt: skip
def test_blocks_without_time_or_satellite(path: Path, tow_ms: int, week: int, svid: int) -> None:
    head = struct.pack("<IHBBBBBB", tow_ms, week, svid, 1, 0, 17, 0, 0)
    path.write_bytes(sbf_block(head + bytes(32)))
    counts = SbfCounts()
    assert list(read_sbf(path, counts)) == []
    assert counts.no_time == 1


@pytest.mark.parametrize("content", [b"", b"$@", b"$@" * 1000, sbf_block(b"x", number=1)])
def test_a_file_without_pages_is_an_error(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with pytest.raises(InputFileError, match="none of them GALRawINAV of E1-B"):
        list(read_sbf(path))


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "absent"):
        with pytest.raises(InputFileError):
            list(read_sbf(path))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damage_costs_pages_and_never_makes_one_up(path: Path, data: st.DataObject) -> None:
    content = b"".join(map(inav_block, PAGES))
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(content)))
        end = data.draw(st.integers(at, min(len(content), at + 200)))
        content = content[:at] + data.draw(st.binary(max_size=200)) + content[end:]
    path.write_bytes(content)
    try:
        found = list(read_sbf(path))
    except InputFileError:
        return
    remaining = iter(PAGES)
    assert all(page in remaining for page in found)  # in order, each one at most once
