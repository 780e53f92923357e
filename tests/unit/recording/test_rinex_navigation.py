from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation, write_rinex_navigation
from vestige.time import GalileoTime

TOE = GalileoTime(1372, 604_200)
SKY = walker_ephemerides(TOE)
SHARED = replace(SKY[3], af0_s=-1.5e-4, bgd_e1_e5b_s=-4.5e-9, sisa_m=3.12, sqrt_a=5440.6, crs_m=-66.25)


def _lines(path: Path) -> list[str]:
    write_rinex_navigation(path, [SHARED])
    return path.read_text().splitlines(keepends=True)


@given(
    svid=st.integers(1, 36),
    iod=st.integers(0, 1023),
    second=st.integers(0, 604_799),
    af0=st.floats(-0.03, 0.03),
    angle=st.floats(-math.pi, math.pi),
    eccentricity=st.floats(0, 0.5),
    health=st.integers(0, 3),
    valid=st.booleans(),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_what_is_written_is_read(
    tmp_path: Path,
    svid: int,
    iod: int,
    second: int,
    af0: float,
    angle: float,
    eccentricity: float,
    health: int,
    valid: bool,
) -> None:
    """To 13 digits; times, numbers and flags exactly."""
    time = GalileoTime(1372, second)
    before = replace(
        SKY[0], svid=svid, iod_nav=iod, toe=time, toc=time, af0_s=af0, m0_rad=angle, omega0_rad=-angle,
        eccentricity=eccentricity, e1b_health=health, e1b_data_valid=valid,
    )  # fmt: skip
    path = tmp_path / "navigation.rnx"
    write_rinex_navigation(path, [before])
    (after,) = read_rinex_navigation(path)
    for field in fields(Ephemeris):
        old, new = getattr(before, field.name), getattr(after, field.name)
        if isinstance(old, float):
            assert new == pytest.approx(old, rel=1e-12, abs=1e-99, nan_ok=True), field.name
        else:
            assert new == old, field.name


def test_each_issue_once_and_in_order(tmp_path: Path) -> None:
    path = tmp_path / "navigation.rnx"
    write_rinex_navigation(path, [*SKY, *SKY[:3]])
    assert [ephemeris.svid for ephemeris in read_rinex_navigation(path)] == list(range(1, 25))


def test_other_systems_and_fnav_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "navigation.rnx"
    lines = _lines(path)
    glonass = ["R01 2025 12 12 13 15 00 .100000000000E-03 .000000000000E+00 .360000000000E+05\n"] + ["    0.0\n"] * 3
    fnav = [line.replace("5.130000000000E+02", "2.580000000000E+02") for line in lines[3:]]
    path.write_text("".join(lines[:3] + glonass + fnav + lines[3:] + ["G" + line[1:] for line in lines[3:4]]))
    assert len(read_rinex_navigation(path)) == 1


def test_version_4_names_its_records(tmp_path: Path) -> None:
    path = tmp_path / "navigation.rnx"
    lines = _lines(path)
    head = [lines[0].replace("3.05", "4.00"), *lines[1:3]]
    system_time = ["> STO E04 IFNV\n", "    2025 12 12 00 00 00 GAUT\n", "     0.0\n"]
    path.write_text("".join(head + system_time + ["> EPH E04 INAV\n"] + lines[3:] + ["> EPH E04 FNAV\n"] + lines[3:]))
    (ephemeris,) = read_rinex_navigation(path)
    assert ephemeris.toe == TOE


def test_a_week_of_transmission_is_mended(tmp_path: Path) -> None:
    """toe in the old week, the message already counts the new one."""
    path = tmp_path / "navigation.rnx"
    text = "".join(_lines(path))
    path.write_text(text.replace("2.396000000000E+03", "2.397000000000E+03"))
    assert read_rinex_navigation(path)[0].toe == TOE


@pytest.mark.parametrize(
    ("line", "old", "new", "message"),
    [
        (1, "N: GNSS", "O: GNSS", "line 1: found "),
        (1, "     3.05", "     2.11", "RINEX 2.11 is not read"),
        (1, "     3.05", "     x.05", "version 3 or 4"),
        (3, "END OF HEADER", "COMMENT", "END OF HEADER"),
        (4, "E04", "E99", "line 4: svid: found 99"),
        (4, "2025 12", "2025 13", "line 4: found E04 2025 13"),
        (4, "2025 12", "1997 12", "line 4: found E04 1997 12"),
        (4, "-1.500000000000E-04", "-1.5000x0000000E-04", "af0_s, a number"),
        (4, "-1.500000000000E-04", "                   ", "af0_s, a number"),
        (4, "-1.500000000000E-04", " 1.500000000000E+99", "line 4: af0_s"),
        (4, "-1.500000000000E-04", "1.500000000000E+999", "line 4: af0_s: found inf"),
        (6, "5.440600000000E+03", "nan", "column 62"),
        (6, "5.440600000000E+03", "0.000000000000E+00", "line 6: sqrt_a"),
        (9, "5.130000000000E+02", "5.135000000000E+02", "a whole number"),
        (9, "5.130000000000E+02", "5.120000000000E+02", "I/NAV or F/NAV"),
        (9, "5.130000000000E+02", "2.580000000000E+02", "found none, expected Galileo I/NAV"),
        (9, "2.396000000000E+03", "2.386000000000E+03", "line 9: week"),
        (10, "    ", "E04 ", "lines of a Galileo record"),
    ],
)
def test_garbage_is_one_clear_line(tmp_path: Path, line: int, old: str, new: str, message: str) -> None:
    path = tmp_path / "navigation.rnx"
    lines = _lines(path)
    assert old in lines[line - 1], lines[line - 1]
    lines[line - 1] = lines[line - 1].replace(old, new, 1)
    path.write_text("".join(lines))
    with pytest.raises(VestigeError, match=message) as error:
        read_rinex_navigation(path)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)


def test_a_file_that_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "navigation.rnx"
    whole = "".join(_lines(path))
    for length in range(0, len(whole) - 1, 7):
        path.write_text(whole[:length])
        with pytest.raises(VestigeError):
            read_rinex_navigation(path)


@given(place=st.integers(0, 1100), byte=st.integers(0, 255))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)
def test_a_changed_byte_is_an_error_or_an_ephemeris(tmp_path: Path, place: int, byte: int) -> None:
    path = tmp_path / "navigation.rnx"
    _lines(path)
    data = bytearray(path.read_bytes())
    data[place % len(data)] = byte
    path.write_bytes(bytes(data))
    try:
        assert all(isinstance(ephemeris, Ephemeris) for ephemeris in read_rinex_navigation(path))
    except VestigeError as error:
        assert "\n" not in str(error)  # noqa: PT017


def test_nothing_to_write(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="needs an ephemeris"):
        write_rinex_navigation(tmp_path / "navigation.rnx", [])
    with pytest.raises(ValueError, match="whole seconds"):
        write_rinex_navigation(tmp_path / "navigation.rnx", [replace(SHARED, toe=GalileoTime(1372, 0, 0.5))])
