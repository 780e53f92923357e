"""Files that another process is still writing: lines, observations, samples out of a pipe, the assistance folder."""

from __future__ import annotations

import math
import os
import threading
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders import START
from vestige.errors import InputFileError, VestigeError
from vestige.recording.assistance.growing_assistance import GrowingAssistance
from vestige.recording.description import BandFile
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.observations.growing_observations import GrowingObservations
from vestige.recording.observations.interpolation import interpolate, is_final
from vestige.recording.observations.observation_file import ObservationTrack
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sample_stream import BLOCK_BYTES, SampleStream
from vestige.recording.text_lines import LONGEST_LINE, GrowingLines
from vestige.records import Band, E1Observation
from vestige.records.observation_epoch import ObservationEpoch

GAP_S = 2.0 + 1e-6  # epochs one second apart


def _observation(svid: int, t: float, *, doppler: bool, rate: bool) -> E1Observation:
    return E1Observation(
        svid=svid,
        pseudorange_m=25e6 + 100.0 * svid * t + t * t,
        carrier_phase_cycles=(100.0 * svid * t + t * t) / 0.19029367279836487,
        doppler_hz=-(100.0 * svid + 2 * t) / 0.19029367279836487 if doppler else math.nan,
        doppler_rate_hz_per_s=-2 / 0.19029367279836487 if rate else math.nan,
        cn0_dbhz=45.0,
    )


@st.composite
def epochs(draw: st.DrawFn) -> list[ObservationEpoch]:
    """Epochs once a second, of satellites that come and go, with or without Doppler and its rate."""
    found = []
    for second in range(draw(st.integers(3, 14))):
        seen = draw(st.lists(st.tuples(st.integers(1, 3), st.booleans(), st.booleans()), unique_by=lambda one: one[0]))
        found.append(
            ObservationEpoch(
                time=START + float(second),
                observations={s: _observation(s, second, doppler=d, rate=r) for s, d, r in seen},
                slipped=frozenset(s for s, *_ in seen if draw(st.booleans())),
            )
        )
    return found


@given(epochs(), st.data())
def test_what_is_final_does_not_change(whole: list[ObservationEpoch], data: st.DataObject) -> None:
    time = START + data.draw(st.sampled_from([0.0, 0.4, 1.0, 2.0, 2.7, 4.5, 5.0]))
    known = data.draw(st.integers(0, len(whole)))
    if is_final(whole[:known], time, max_gap_s=GAP_S):
        before = interpolate(whole[:known], time, max_gap_s=GAP_S)
        assert repr(before) == repr(interpolate(whole, time, max_gap_s=GAP_S))  # NaN too


@pytest.mark.parametrize(("rate", "needed"), [(True, 6), (False, 7)])
def test_no_more_is_waited_for_than_is_needed(rate: bool, needed: int) -> None:
    """At 4.5 s: the epoch at 5 s, the sixth; without Doppler rates one more."""
    whole = [
        ObservationEpoch(time=START + float(s), observations={1: _observation(1, s, doppler=True, rate=rate)})
        for s in range(12)
    ]
    final = [is_final(whole[:known], START + 4.5, max_gap_s=GAP_S) for known in range(13)]
    assert final.index(True) == needed
    assert all(final[needed:])


def test_a_satellite_that_may_come_back_is_waited_for() -> None:
    """Lost after 4 s, asked for at 4.5 s, joined if it is there again at 6 s, and not after that."""
    lost = [
        ObservationEpoch(
            time=START + float(s),
            observations={k: _observation(k, s, doppler=True, rate=True) for k in (1, 2) if k == 2 or s < 5},
        )
        for s in range(8)
    ]
    final = [is_final(lost[:known], START + 4.5, max_gap_s=GAP_S) for known in range(9)]
    assert final.index(True) == 8  # the epoch at 7 s


@given(st.binary(max_size=60), st.data())
def test_lines_in_pieces_are_the_lines(content: bytes, data: st.DataObject) -> None:
    found = []
    cuts = sorted(data.draw(st.lists(st.integers(0, len(content)), max_size=5)))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "lines"
        lines = GrowingLines(path)
        for first, last in zip([0, *cuts], [*cuts, len(content)], strict=True):
            with path.open("ab") as stream:
                stream.write(content[first:last])
            while (line := lines.take()) is not None:
                found.append(line)
    whole = content.removeprefix(b"\xef\xbb\xbf").split(b"\n")[:-1]
    assert found == [(n, raw.decode("latin-1").rstrip("\r")) for n, raw in enumerate(whole, start=1)]


def test_a_file_that_shrinks_or_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    lines = GrowingLines(path)
    assert lines.take() is None  # not there yet
    path.write_bytes(b"one\ntwo")
    assert lines.take() == (1, "one")
    assert lines.take() is None
    path.write_bytes(b"")
    with pytest.raises(InputFileError, match="as before, or more"):
        lines.take()
    path.write_bytes(bytes(LONGEST_LINE + 10))
    with pytest.raises(InputFileError, match="a whole line"):
        GrowingLines(path).take()


def test_a_track_goes_on_where_the_file_has_grown(tmp_path: Path) -> None:
    whole = [
        ObservationEpoch(time=START + float(s), observations={1: _observation(1, s, doppler=True, rate=True)})
        for s in range(40)
    ]
    write_csv_observations(tmp_path / "whole.csv", whole)
    data, path = (tmp_path / "whole.csv").read_bytes(), tmp_path / "growing.csv"
    growing = GrowingObservations(path, warn=pytest.fail)
    track = ObservationTrack(growing)
    assert not track.settled(START + 1.5)
    answers, written, wanted = [], 0, 1.5
    while wanted < 37:
        written += 61
        path.write_bytes(data[:written])
        if track.settled(START + wanted):
            answers.append(track.at(START + wanted))
            wanted += 4.0
    assert not track.settled(START + 39.0)  # more of this epoch may come
    path.write_bytes(data)
    growing.end()
    assert track.settled(START + 39.0)
    finished = ObservationTrack(whole)
    assert answers == [finished.at(START + (1.5 + 4.0 * n)) for n in range(len(answers))]


RINEX = f"""\
{"     3.05           OBSERVATION DATA    E":<60}RINEX VERSION / TYPE
{"E    1 C1C":<60}SYS / # / OBS TYPES
{"  2021    11    25     0    40   18.0000000     GAL":<60}TIME OF FIRST OBS
{"":<60}END OF HEADER
> 2021 11 25 00 40 18.0000000  0  1
E03  24563187.250
> 2021 11 25 00 40 19.0000000  0  2
E03  2456318x.250
E08  24563187.250
> 2021 11 25 00 40 20.0000000  0  1
E03  24563188.250
"""


def test_a_damaged_epoch_of_rinex_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.rnx").write_text(RINEX)
    told: list[VestigeError] = []
    found = list(GrowingObservations(tmp_path / "a.rnx", warn=told.append))
    assert [epoch.time.second % 60 for epoch in found] == [18 % 60, 20 % 60]
    assert [str(error).split(": ")[1] for error in told] == ["line 8"]


@pytest.mark.parametrize("text", ["a letter\n", RINEX.replace("3.05", "2.11")])
def test_what_is_no_such_file_is_an_error(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.rnx").write_text(text)
    with pytest.raises(VestigeError):
        next(iter(GrowingObservations(tmp_path / "a.rnx", warn=pytest.fail)))


@pytest.mark.parametrize("header_bytes", [0, 5])
def test_a_stream_is_cut_like_a_file(header_bytes: int) -> None:
    rng = np.random.default_rng(3)
    values = rng.integers(-100, 100, 2 * 100_000, dtype=np.int8)
    file = BandFile(
        band=Band.E6, path=Path("-"), described_in=Path("-"), form=SampleFormat(component="int8", layout="iq"),
        sample_rate_hz=1e6, center_frequency_hz=1278.75e6, first_sample=7000, start=START, header_bytes=header_bytes,
    )  # fmt: skip
    reading, writing = os.pipe()
    stream = SampleStream(reading, file, capacity_bytes=3 * BLOCK_BYTES)

    def feed() -> None:
        with os.fdopen(writing, "wb") as pipe:
            pipe.write(bytes(header_bytes) + values.tobytes())

    feeder = threading.Thread(target=feed)
    feeder.start()
    done = 7000
    while True:
        stream.wait(1.0)
        seen = stream.look()
        end = seen.end_sample
        cut = stream.cut(done, end)
        assert cut is not None
        assert (cut.first_sample, cut.end_sample) == (done, end)
        batch = cut.read(done, end - done)
        own = values[2 * (done - 7000) : 2 * (end - 7000)].astype(np.float32)
        assert np.array_equal(batch.samples.view(np.float32), own)
        assert batch.start - START == pytest.approx((done - 7000) / 1e6, abs=1e-12)
        assert stream.keep([], end)
        assert end < 7000 + BLOCK_BYTES or stream.cut(7000, end) is None
        done = end
        if seen.ended:
            break
    feeder.join()
    os.close(reading)
    assert done == 107_000


@settings(max_examples=40)
@given(
    st.lists(st.integers(1, 3 * BLOCK_BYTES), max_size=8),
    st.lists(st.tuples(st.integers(0, 12), st.integers(1, 6)), max_size=5),
    st.integers(0, 16),
)
def test_what_is_kept_is_whole_and_no_more_than_that(
    pieces: list[int], chosen: list[tuple[int, int]], rest: int
) -> None:
    """Against the plain definition: a window is there if no byte of it was let go, and nothing else is."""
    file = BandFile(
        band=Band.E6, path=Path("-"), described_in=Path("-"), form=SampleFormat(component="int8", layout="iq"),
        sample_rate_hz=1e6, center_frequency_hz=1278.75e6, start=START,
    )  # fmt: skip
    unit = BLOCK_BYTES // 4  # samples, half a block
    windows = [(first * unit, (first + length) * unit) for first, length in chosen]
    with Path(os.devnull).open("rb") as nothing:
        stream = SampleStream(nothing.fileno(), file, capacity_bytes=1 << 30)
        stream._changed.acquire()
        stream._changed.wait_for(lambda: stream._ended)
        stream._changed.release()
    content = np.random.default_rng(1).bytes(sum(pieces))
    for size in pieces:
        stream._append(content[stream._end_byte : stream._end_byte + size])
        stream._end_byte += size
    end = len(content) // 2
    assert stream.keep(windows, rest * unit)
    for first, last in (*windows, (rest * unit, end)):
        cut = stream.cut(first, last)
        assert cut is not None
        assert cut.held == content[2 * first : 2 * min(last, end)]
    wanted = sum(min(2 * last, len(content)) - 2 * first for first, last in windows if first < end)
    most = wanted + max(len(content) - 2 * rest * unit, 0) + 2 * 3 * BLOCK_BYTES * (len(windows) + 1)
    assert stream._n_kept <= most


def test_problems_of_the_assistance_folder_are_told_when_they_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vestige.recording.assistance import growing_assistance

    clock = [100.0]
    monkeypatch.setattr(growing_assistance.time, "monotonic", lambda: clock[0])
    told: list[str] = []
    folder = GrowingAssistance(tmp_path, warn=lambda error: told.append(str(error)))
    (tmp_path / "keys.csv").write_text("# vestige OSN")
    assert folder.look(START, START)
    clock[0] += 4.0
    assert not folder.look(START, START)
    assert told == []
    clock[0] += 2.0
    folder.look(START, START)
    assert len(set(told)) == 1
    (tmp_path / "keys.csv").unlink()
    told.clear()
    assert folder.look(START, START)
    clock[0] += 60.0
    folder.look(START, START)
    assert told == []
