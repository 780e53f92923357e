from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from builders import START
from vestige.errors import InputFileError
from vestige.recording.search_log import SearchLog
from vestige.sample_processor.search.exhaustive_search import SearchState
from vestige.sample_processor.search.peak import Peak

PEAK = Peak(
    svid=11, start_time=START + 0.1 / 3, doppler_hz=-1 / 3, magnitude=9.1, threshold=7.7, cn0_dbhz=40.1
)  # fmt: skip
STATE = SearchState(done=1e9 / 3, total=1e10, peaks=(PEAK,), block_start=START + 1 / 7, block_magnitude=6.6, blocks=7)
OF = {"recording": "night", "integration time": 0.016}


def test_what_was_kept_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    log = SearchLog.open(path, OF)
    assert log.states == {}
    log.keep("first", replace(STATE, blocks=1))
    log.keep("first", STATE)
    log.keep("second", replace(STATE, peaks=()))
    assert SearchLog.open(path, OF).states == {"first": STATE, "second": replace(STATE, peaks=())}
    assert list(tmp_path.iterdir()) == [path]


def test_another_search_or_another_file_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    SearchLog(path=path, of=OF).keep("first", STATE)
    for other in ({**OF, "integration time": 0.004}, {"recording": "night"}, {**OF, "engine": "fft"}):
        with pytest.raises(InputFileError, match="search of another"):
            SearchLog.open(path, other)
    content = json.loads(path.read_bytes())
    broken = content | {"states": {"first": content["states"]["first"] | {"blocks": -1}}}
    first = content["states"]["first"]
    week = content | {"states": {"first": first | {"block_start": {"week": 10**20, "second": 0, "fraction": 0.0}}}}
    long = json.dumps(content).replace('"blocks": 7', f'"blocks": {"9" * 5000}')
    texts = ("", "[1]", "{}", json.dumps(broken), json.dumps(content)[:-9], "\x00\xff", "[" * 100_000)
    for text in (*texts, '{"of": ' * 100_000, json.dumps(week), long):
        path.write_text(text)
        with pytest.raises(InputFileError, match="the log of an exhaustive search"):
            SearchLog.open(path, OF)
    os.truncate(path, 40_000_000_000)
    with pytest.raises(InputFileError, match="length: found 40000000000 bytes"):
        SearchLog.open(path, OF)
    with pytest.raises(FileNotFoundError, match=r"log\.json"):
        SearchLog.open(tmp_path / "nowhere" / "log.json", OF).keep("first", STATE)
