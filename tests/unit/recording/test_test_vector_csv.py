from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from osnma_builder import Broadcast, make_page, make_word
from page_files import vector_csv
from simulated_chain import make_chain
from vestige.errors import InputFileError
from vestige.navigation.inav.page import InavPage
from vestige.recording.samples.test_vector_csv import HEADER, read_test_vector
from vestige.time import GalileoTime

START = GalileoTime(1251, 604_770)
PAGES = Broadcast(make_chain(b"csv", START, 3), n_subframes=3, svids=(2, 7)).pages()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "vector.csv"
    path.write_text(vector_csv(PAGES))
    return path


def test_pages_come_back_with_the_time_that_the_satellites_tell(path: Path) -> None:
    assert list(read_test_vector(path)) == PAGES


def test_a_given_start_wins(path: Path) -> None:
    pages = list(read_test_vector(path, GalileoTime(1, 1)))
    assert pages[0].time == GalileoTime(1, 1)
    assert [page.data for page in pages] == [page.data for page in PAGES]


def test_lines_of_different_length(path: Path) -> None:
    shorter = [page for page in PAGES if page.svid == 2 or page.time < START + 30]
    path.write_text(vector_csv(shorter) + "\n")
    assert list(read_test_vector(path)) == shorter


def test_words_with_a_wrong_checksum_have_no_vote(path: Path) -> None:
    other = START + 1000
    lie = make_page(2, START, make_word(5, 2, other, 1), bytes(5)).data[:-5] + bytes(5)
    lies = [InavPage(svid=2, time=page.time, data=lie) for page in PAGES if page.svid == 2]
    truth = [page for page in PAGES if page.svid == 7]
    path.write_text(vector_csv([*lies, *truth]))
    assert next(read_test_vector(path)).time == START + 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: found nothing"),
        ("a,b\n", "line 1"),
        (HEADER, "line 2: found nothing"),
        (f"{HEADER}\n02,240", "line 2: found 2 fields"),
        (f"{HEADER}\n37,240,{'0' * 60}", "line 2, SVID"),
        (f"{HEADER}\n00,240,{'0' * 60}", "line 2, SVID"),
        (f"{HEADER}\n02,240,{'0' * 59}G", "line 2, digit 60: found G"),
        (f"{HEADER}\n02,240,{'0' * 59}", "line 2, NumNavBits: found 240, expected 236"),
        (f"{HEADER}\n02,236,{'0' * 59}", "a multiple of 240"),
        (f"{HEADER}\n02,0,", "a multiple of 240"),
        (f"{HEADER}\n02,240,{'0' * 60}\n02,240,{'0' * 60}", "line 3: found SVID 2 again"),
        (f"{HEADER}\n02,240,{'0' * 60}", "words 0 and 5: found no time"),
    ],
)
def test_files_that_are_none(path: Path, text: str, words: str) -> None:
    path.write_text(text)
    with pytest.raises(InputFileError, match=words):
        list(read_test_vector(path))


def test_satellites_that_tell_different_times(path: Path) -> None:
    digits = [make_page(svid, START, make_word(5, svid, START + 60 * svid, 1), bytes(5)).data.hex() for svid in (1, 2)]
    path.write_text(f"{HEADER}\n01,240,{digits[0]}\n02,240,{digits[1]}")
    with pytest.raises(InputFileError, match="2 different start times"):
        list(read_test_vector(path))


def test_not_text(path: Path) -> None:
    path.write_bytes(HEADER.encode() + b"\n\xff")
    with pytest.raises(InputFileError, match="not ASCII"):
        list(read_test_vector(path))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(st.data())
def test_damage_gives_one_line_or_pages_at_the_true_time(path: Path, data: st.DataObject) -> None:
    text = vector_csv(PAGES).encode()
    at = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(at, min(len(text), at + 70)))
    path.write_bytes(text[:at] + data.draw(st.sampled_from([b"", b"00", b",", b"\n", b"\xff", b"A" * 70])) + text[end:])
    try:
        pages = list(read_test_vector(path))
    except InputFileError:
        return
    assert pages[0].time == START + 1
    assert all(page in PAGES for page in pages if page.crc_ok)
