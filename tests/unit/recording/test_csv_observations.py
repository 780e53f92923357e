from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError, VestigeError
from vestige.recording.observations.csv_observations import CsvParser, write_csv_observations
from vestige.recording.observations.observation_epoch import LIMITS, read_epochs
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime


def _read(path: Path) -> Iterator[ObservationEpoch]:
    return read_epochs(path, CsvParser(path))


TEXT = """\
gst_week,gst_second,svid,pseudorange_m,carrier_phase_cycles,doppler_hz,doppler_rate_hz_per_s,cn0_dbhz,cycle_slip
1161,348018.5,3,24563187.25,129081234.0625,-993.0,-0.41,45.1,0
1161,348018.5,8,25.5e6,,1032.1,,,1
1161,348019.5,3,24563000.25,129080234.0625,-993.5,-0.41,45.0,
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "observations.csv"
    path.write_text(text, encoding="latin-1")
    return path


def same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))


def measured(name: str) -> st.SearchStrategy[float]:
    number = st.floats(*LIMITS[name])
    return number if name == "pseudorange_m" else st.one_of(st.just(math.nan), number)


observations = st.builds(E1Observation, svid=st.integers(1, 36), **{name: measured(name) for name in LIMITS})


@st.composite
def epochs(draw: st.DrawFn) -> list[ObservationEpoch]:
    fractions = st.floats(0, 1, exclude_max=True)
    times = draw(st.sets(st.builds(GalileoTime, st.integers(0, 9999), st.integers(0, 604_799), fractions), max_size=4))
    result = []
    for time in sorted(times):
        seen = {o.svid: o for o in draw(st.lists(observations, min_size=1, max_size=4))}
        slipped = frozenset(draw(st.sets(st.sampled_from(sorted(seen)))))
        result.append(ObservationEpoch(time=time, observations=seen, slipped=slipped))
    return result


@given(original=epochs())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_is_read_to_the_last_bit(tmp_path: Path, original: list[ObservationEpoch]) -> None:
    path = tmp_path / "observations.csv"
    write_csv_observations(path, original)
    again = list(_read(path))
    assert [(e.time, e.slipped, set(e.observations)) for e in again] == [
        (e.time, e.slipped, set(e.observations)) for e in original
    ]
    for before, after in zip(original, again, strict=True):
        for svid, observation in before.observations.items():
            assert all(same(getattr(observation, name), getattr(after.observations[svid], name)) for name in LIMITS)


def test_values(tmp_path: Path) -> None:
    first, second = _read(write(tmp_path, TEXT))
    assert first.time == GalileoTime(1161, 348018, 0.5)
    assert first.slipped == {8}
    assert first.observations[3] == E1Observation(
        svid=3, pseudorange_m=24563187.25, carrier_phase_cycles=129081234.0625, doppler_hz=-993.0,
        doppler_rate_hz_per_s=-0.41, cn0_dbhz=45.1,
    )  # fmt: skip
    assert math.isnan(first.observations[8].carrier_phase_cycles)
    assert (set(second.observations), second.slipped) == ({3}, frozenset())


def test_columns_may_be_missing_and_in_any_order(tmp_path: Path) -> None:
    text = "\xef\xbb\xbfsvid, pseudorange_m, gst_second, gst_week\r\n3, 2.5e7, 348018, 1161\r\n\r\n"
    (epoch,) = _read(write(tmp_path, text))
    assert epoch.time == GalileoTime(1161, 348018)
    assert math.isnan(epoch.observations[3].doppler_hz)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("gst_week", "week", "line 1: found week,gst_second"),
        ("cycle_slip", "slip", "line 1: column: found slip, expected one of gst_week"),
        ("cycle_slip", "svid", "found svid twice"),
        ("45.1,0", "45.1", "line 2: found 8 values, expected 9 values"),
        ("24563187.25", "nan", "line 2: pseudorange_m: found nan, expected a number"),
        ("24563187.25", "", "line 2: pseudorange_m: found nothing"),
        ("24563187.25", "1e300", "line 2: pseudorange_m: found 1e+300, expected a number from -1e+11"),
        ("24563187.25", "1_000", "line 2: pseudorange_m: found 1_000"),
        ("24563187.25", "-inf", "found -inf"),
        ("-993.0", "1e7", "line 2: doppler_hz"),
        ("45.1", "451", "line 2: cn0_dbhz: found 451.0, expected a number from -50 to 100"),
        ("45.1,0", "45.1,2", "line 2: cycle_slip: found 2, expected 0 or 1"),
        ("8,25.5e6", "37,25.5e6", "line 3: svid: found 37, expected a Galileo satellite, 1 to 36"),
        ("8,25.5e6", "\xb2,25.5e6", "line 3: svid"),
        ("8,25.5e6", "3,25.5e6", "line 3: svid: found 3, expected each satellite once an epoch"),
        ("348019.5", "604800", "line 4: gst_second: found 1161:604800"),
        ("348019.5", "-1", "line 4: gst_week, gst_second"),
        ("348019.5", "348018.25", "line 4: time: found 2021-11-25T00:40:18.250 GST, expected a time after"),
        ("45.0,\n", "45.0,", "line 4: found no line end, end of the file, expected a whole line"),
        ("45.0,\n", "4", "line 4: found no line end, end of the file, expected a whole line"),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in TEXT
    path = write(tmp_path, TEXT.replace(old, new, 1))
    with pytest.raises(InputFileError) as caught:
        list(_read(path))
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


def refusal(read: Callable[[], object]) -> str:
    """The one line with which a file is refused, or an empty text."""
    try:
        read()
    except VestigeError as error:
        return str(error)
    return ""


@given(cut=st.integers(0, len(TEXT)), garbage=st.binary(max_size=12))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
def test_damage_is_one_clear_line_or_observations(tmp_path: Path, cut: int, garbage: bytes) -> None:
    path = tmp_path / "observations.csv"
    path.write_bytes(TEXT[:cut].encode() + garbage + TEXT[cut + len(garbage) :].encode())
    line = refusal(lambda: list(_read(path)))
    assert not line or (line.startswith(f"{path}: line ") and line.isprintable())


@given(cut=st.integers(0, len(TEXT) - 1))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_cut_off_file_gives_no_altered_value(tmp_path: Path, cut: int) -> None:
    whole = [dict(e.observations) for e in _read(write(tmp_path, TEXT))]
    got = []
    with contextlib.suppress(VestigeError):
        got.extend(epoch.observations for epoch in _read(write(tmp_path, TEXT[:cut])))
    for before, after in zip(whole, got, strict=False):
        assert all(repr(before[svid]) == repr(observation) for svid, observation in after.items())
