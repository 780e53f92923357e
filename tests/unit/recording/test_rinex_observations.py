from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError, UnsupportedError, VestigeError
from vestige.recording.observations.observation_epoch import read_epochs
from vestige.recording.observations.rinex_observations import RinexParser
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime


def _read(path: Path) -> Iterator[ObservationEpoch]:
    return read_epochs(path, RinexParser(path))


# Laid out by hand after the tables of the RINEX 3.05 document: mixed GPS and Galileo, events, missing observations.
HEADER = """\
     3.05           OBSERVATION DATA    M                   RINEX VERSION / TYPE
receiver                                20211125 004000 UTC PGM / RUN BY / DATE
G    4 C1C L1C D1C S1C                                      SYS / # / OBS TYPES
E   16 C1X L1X D1X S1X C5X L5X D5X S5X C7X L7X D7X S7X C1C  SYS / # / OBS TYPES
       L1C D1C S1C                                          SYS / # / OBS TYPES
  2021    11    25     0    40   18.0000000     GPS         TIME OF FIRST OBS
                                                            END OF HEADER
"""


def fields(*values: str) -> str:
    """Observations of 14.3 with two flags each; an empty one is blank."""
    return "".join(f"{value:>14}".ljust(16) if len(value) < 14 else value.ljust(16) for value in values)


BLANK12 = [""] * 12
E03 = "E03" + fields("24563187.250", "129081234.062", "-993.000", "45.100")
E08 = "E08" + fields(*BLANK12, "25000000.125", " 131373000.500 7", "1032.125", "44.800")
G01 = "G01" + fields("20000000.000", "105000000.000", "100.000", "50.000")
BODY = f"""\
> 2021 11 25 00 40 18.5000000  0  3
{G01}
{E03}
{E08}
>                              4  1
{"a remark":60}COMMENT
> 2021 11 25 00 40 19.5000000  0  1
{"E 3" + fields("24563000.250", " 129080234.0621", "", "45.000")}
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "observations.rnx"
    path.write_text(text, encoding="latin-1")
    return path


def test_values(tmp_path: Path) -> None:
    first, second = _read(write(tmp_path, HEADER + BODY))
    assert (first.time, second.time) == (GalileoTime(1161, 348018, 0.5), GalileoTime(1161, 348019, 0.5))
    combined, pilot = first.observations[3], first.observations[8]
    assert (combined.pseudorange_m, combined.carrier_phase_cycles) == (24563187.25, 129081234.062)
    assert (combined.doppler_hz, combined.cn0_dbhz) == (-993.0, pytest.approx(45.1 - 3.0103, abs=1e-4))  # B + C
    assert (pilot.pseudorange_m, pilot.carrier_phase_cycles) == (25000000.125, 131373000.5)
    assert (pilot.doppler_hz, pilot.cn0_dbhz) == (1032.125, 44.8)
    assert math.isnan(pilot.doppler_rate_hz_per_s)
    assert set(first.observations) == {3, 8}
    assert first.slipped == frozenset()
    assert math.isnan(second.observations[3].doppler_hz)
    assert second.slipped == {3}  # loss of lock indicator 1


def test_e1c_is_taken_before_the_combined_signal(tmp_path: Path) -> None:
    both = "E03" + fields("24563187.250", "", "", "", *[""] * 8, "24563188.000", "", "", "42.000")
    text = BODY.replace(E03, both)
    first, second = _read(write(tmp_path, HEADER + text))
    assert (first.observations[3].pseudorange_m, first.observations[3].cn0_dbhz) == (24563188.0, 42.0)
    assert second.slipped == {3}  # another signal has another phase, whatever the indicator says


def test_a_power_failure_breaks_all_phases(tmp_path: Path) -> None:
    text = BODY.replace("18.5000000  0", "18.5000000  1").replace("129080234.0621", "129080234.062 ")
    first, second = _read(write(tmp_path, HEADER + text))
    assert (first.slipped, second.slipped) == ({3, 8}, frozenset())


def test_zero_is_not_measured(tmp_path: Path) -> None:
    text = BODY.replace("24563187.250", "       0.000").replace("1032.125", "   0.000")
    first, _ = _read(write(tmp_path, HEADER + text))
    assert set(first.observations) == {8}
    assert math.isnan(first.observations[8].doppler_hz)


def test_an_event_may_change_the_observation_types(tmp_path: Path) -> None:
    event = ">                              4  1\nE    2 C1B S1B" + " " * 46 + "SYS / # / OBS TYPES\n"
    later = "> 2021 11 25 00 40 20.0000000  0  1\nE05" + fields("23000000.000", "40.000") + "\n"
    *_, last = _read(write(tmp_path, HEADER + BODY + event + later))
    assert (last.observations[5].pseudorange_m, last.observations[5].cn0_dbhz) == (23e6, 40.0)


@pytest.mark.parametrize(("system", "offset"), [("GAL", 0), ("GPS", 0), ("BDT", 14), ("QZS", 0)])
def test_time_systems(tmp_path: Path, system: str, offset: int) -> None:
    first, _ = _read(write(tmp_path, HEADER.replace("GPS         TIME", f"{system}         TIME") + BODY))
    assert first.time == GalileoTime(1161, 348018 + offset, 0.5)


def test_a_galileo_file_needs_no_time_system(tmp_path: Path) -> None:
    header = HEADER.replace("DATA    M", "DATA    E").replace("GPS         TIME", "            TIME")
    first, _ = _read(write(tmp_path, header + BODY))
    assert first.time == GalileoTime(1161, 348018, 0.5)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("     3.05", "     5.00", "line 1: found 5.00, expected RINEX version 3 or 4"),
        ("OBSERVATION DATA", "NAVIGATION DATA ", "the first line of RINEX observations"),
        ("E   16", "E   17", "SYS / # / OBS TYPES: found 16, expected 17 observation types"),
        ("E   16", "E   xx", "a number of observation types"),
        ("END OF HEADER", "END OF HEADAR", "END OF HEADER"),
        ("TIME OF FIRST OBS", "TIME OF LAST OBS ", "TIME OF FIRST OBS before it"),
        ("GPS         TIME", "            TIME", "a time system: GAL, GPS"),
        ("GPS         TIME", "XYZ         TIME", "found XYZ, expected a time system"),
        ("> 2021 11 25 00 40 18.5", "> 2021 13 25 00 40 18.5", "line 8: found > 2021 13 25 00 40 18.5000000"),
        ("> 2021 11 25 00 40 18.5", "> 1998 11 25 00 40 18.5", "an epoch: > YYYY MM DD"),
        ("> 2021 11 25 00 40 18.5", "> 2021 11 25 00 40 61.5", "an epoch: > YYYY MM DD"),
        ("> 2021 11 25 00 40 18.5", "> 2021 11 25 00 40  nan", "an epoch: > YYYY MM DD"),
        ("> 2021 11 25 00 40 19.5", "> 2021 11 25 00 40 17.5", "a time after 2021-11-25T00:40:18.500 GST"),
        ("18.5000000  0  3", "18.5000000  7  3", "an event flag 0 to 6"),
        ("18.5000000  0  3", "18.5000000  0 -3", "an event flag 0 to 6"),
        ("18.5000000  0  3", "18.5000000  0  2", "an epoch record, which begins with >"),
        ("18.5000000  0  3", "18.5000000  0  4", "the observations of a satellite"),
        ("19.5000000  0  1", "19.5000000  0  2", "the end of the file after 1 records"),
        ("E08", "E37", "svid: found 37"),
        ("E08", "E03", "found E03 again"),
        (" 24563187.250", " 2456318x.250", "line 10: column 4: found 2456318x.250, expected a number"),
        (" 24563187.250", "          nan", "expected a number with three decimals"),
        (" 24563187.250", " 24563187.25 ", "expected a number with three decimals"),
        ("45.100", "450.00", "expected a number with three decimals"),
        (" 45.100", "450.100", "cn0_dbhz: found 450.1"),
        ("129080234.0621", "129080234.0629", "a loss-of-lock indicator, 0 to 7"),
    ],
)  # fmt: skip
def test_bad_files_are_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = HEADER + BODY
    assert old in text
    path = write(tmp_path, text.replace(old, new, 1))
    with pytest.raises(InputFileError) as caught:
        list(_read(path))
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


def test_files_without_galileo_e1_are_refused(tmp_path: Path) -> None:
    text = HEADER.replace("C1X", "C8X").replace("C1C  SYS", "C6C  SYS") + BODY
    with pytest.raises(InputFileError, match="a Galileo E1 pseudorange, one of C1C, C1X, C1B"):
        list(_read(write(tmp_path, text)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEADER.replace("     3.05", "     2.11"), "RINEX 2.11 is not read"),
        (f"{'1.0':20}{'COMPACT RINEX FORMAT':40}CRINEX VERS   / TYPE\n", "expand it with crx2rnx"),
        (HEADER.replace("GPS         TIME", "GLO         TIME"), "GLONASS time"),
        (HEADER.replace(" " * 60 + "END", f"{'E  100  2 C1C L1C':60}SYS / SCALE FACTOR\n{'':60}END"), "scaled"),
    ],
)
def test_what_is_not_read_says_so(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UnsupportedError, match=said):
        list(_read(write(tmp_path, text + BODY)))


TEXT = HEADER + BODY


def refusal(read: Callable[[], object]) -> str:
    """The one line with which a file is refused, or an empty text."""
    try:
        read()
    except VestigeError as error:
        return str(error)
    return ""


@given(cut=st.integers(0, len(TEXT)), garbage=st.binary(max_size=12), rest=st.booleans())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=250)
def test_damage_is_one_clear_line_or_observations(tmp_path: Path, cut: int, garbage: bytes, rest: bool) -> None:
    path = tmp_path / "observations.rnx"
    path.write_bytes(TEXT[:cut].encode() + garbage + (TEXT[cut + len(garbage) :].encode() if rest else b""))
    line = refusal(lambda: list(_read(path)))
    assert not line or (line.startswith(f"{path}: ") and line.isprintable())


@given(cut=st.integers(0, len(TEXT) - 1))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_cut_off_file_gives_no_altered_value(tmp_path: Path, cut: int) -> None:
    whole = [repr(epoch) for epoch in _read(write(tmp_path, TEXT))]
    got = []
    with contextlib.suppress(VestigeError):
        got.extend(repr(epoch) for epoch in _read(write(tmp_path, TEXT[:cut])))
    assert got == whole[: len(got)]


@given(st.binary(max_size=200))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_bytes_are_not_rinex(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "observations.rnx"
    path.write_bytes(content)
    with pytest.raises(InputFileError):
        list(_read(path))
