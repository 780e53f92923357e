"""Accelerations as CSV: what is read, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.errors import InputFileError, VestigeError
from vestige.recording.observations.accelerations import GrowingAccelerations, read_accelerations
from vestige.time import GalileoTime

HEADER = "gst_week,gst_second,east_mps2,north_mps2,up_mps2\n"
GOOD = HEADER + "1421,604799.5,0.25,-0.5,1e-3\n1422,0.25,0,0,0.125\n"


def _read(path: Path, text: str) -> GalileoTime:
    path.write_text(text)
    return read_accelerations(path).start


def test_rows_through_the_end_of_a_week(tmp_path: Path) -> None:
    path = tmp_path / "imu.csv"
    path.write_text(GOOD)
    found = read_accelerations(path)
    times = [found.start + elapsed_s for elapsed_s in found.elapsed_s.tolist()]
    assert times == [GalileoTime(1421, 604_799, 0.5), GalileoTime(1422, 0, 0.25)]
    np.testing.assert_array_equal(found.acceleration_mps2, [[0.25, -0.5, 1e-3], [0, 0, 0.125]])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("up_mps2", "up_g", "line 1: found gst_week,.*,up_g, expected gst_week,gst_second,east_mps2"),
        ("east_mps2,north_mps2,up_mps2", "x_mps2,y_mps2,z_mps2", "line 1: found .*x_mps2.*expected .*east_mps2"),
        (",up_mps2", "", "line 1: found .*expected .*up_mps2"),
        ("gst_week,gst_second", "time_s", "line 1: found time_s"),
        ("1422,0.25,", "1421,604799.5,", "line 3: gst_week, gst_second: found 1421:604799.5, expected more than"),
        ("1422,0.25,", "1421,7,", "line 3: gst_week, gst_second: found 1421:7, expected more than 1421:604799.5"),
        ("1422,", "1422.5,", "line 3: gst_week: found 1422.5, expected a whole number"),
        ("604799.5", "604800", "line 2: gst_second: found 604800"),
        ("-0.5", "nan", "line 2: north_mps2: found nan"),
        ("-0.5", "inf", "line 2: north_mps2: found inf"),
        ("-0.5", "", "line 2: north_mps2: found , expected a number"),
        (",0.125", "", "line 3: found 4 fields, expected 5"),
        ("1422,0.25,0,0,0.125\n", "", "found 1 rows, expected two"),
        ("0.125\n", "0.125", "no line end"),
        (GOOD, "", "line 1: found nothing"),
        (GOOD, HEADER, "found 0 rows"),
        (GOOD, "\x00\xff\n", "line 1: found "),
    ],
)
def test_garbage_is_one_clear_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message) as caught:
        _read(tmp_path / "imu.csv", GOOD.replace(old, new))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("gravity", ["0,0,9.81", "0,0,-9.79", "-6.93,0,6.93"])
def test_what_holds_gravity_is_refused(tmp_path: Path, gravity: str) -> None:
    """As a standing sensor gives it that nobody aligned; a vehicle at 1 g for a while is none."""
    path = tmp_path / "imu.csv"
    with pytest.raises(InputFileError, match=r"found 9\.\d+ m/s² .*gravity taken off"):
        _read(path, HEADER + "".join(f"1421,{n},{gravity}\n" for n in range(30)))
    _read(path, HEADER + "".join(f"1421,{n},{gravity if n < 8 else '0,0,0'}\n" for n in range(30)))


def test_a_file_that_grows(tmp_path: Path) -> None:
    path, told = tmp_path / "imu.csv", list[VestigeError]()
    growing = GrowingAccelerations(path, warn=told.append)
    at = GalileoTime(1421, 100)
    assert not growing.look()
    assert not growing.reaches(at)
    assert growing.found.elapsed_s.size == 0
    path.write_text(HEADER + "1421,98,0,0,0\n1421,99,1,0,0\n1421,99.5,xx,0,0\n1421,98,0,0,0\n1421,100.5,2,0")
    assert growing.look()
    assert not growing.reaches(at)  # the last row is half written
    assert [str(error).split(": found")[0].split(": ", 1)[1] for error in told] == [
        "line 4: east_mps2",
        "line 5: gst_week, gst_second",
    ]
    with path.open("a") as stream:
        stream.write(",0\n1421,101,3,0,0\n")
    assert growing.look()
    assert growing.reaches(at)
    assert not growing.look()
    growing.release(at)
    assert growing.found.elapsed_s.tolist() == [1.0, 2.5, 3.0]
    assert growing.found.acceleration_mps2[:, 0].tolist() == [1.0, 2.0, 3.0]


def test_another_file_that_grows_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "imu.csv"
    path.write_text("time,ax,ay,az\n")
    with pytest.raises(InputFileError, match=r"line 1: found time,ax,ay,az, expected gst_week"):
        GrowingAccelerations(path, warn=print).look()
