from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.errors import InputFileError
from vestige.recording.numeric_csv import WAYPOINTS, read_numeric_csv

HEADER = "time_s,latitude_deg,longitude_deg,height_m\n"
GOOD = HEADER + "0,48.0,11.0,500\n10.5,48.001,11.0,5e2\n"


def _read(path: Path, text: str) -> np.ndarray:
    path.write_text(text)
    return read_numeric_csv(path, WAYPOINTS)


def test_rows(tmp_path: Path) -> None:
    np.testing.assert_array_equal(_read(tmp_path / "way.csv", GOOD + "\n"), [[0, 48, 11, 500], [10.5, 48.001, 11, 500]])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("height_m", "height", "line 1: found time_s,latitude_deg,longitude_deg,height, expected time_s"),
        ("10.5,", "0,", "line 3: time_s: found 0.0, expected more than 0.0"),
        ("48.001", "98.001", "line 3: latitude_deg: found 98.001"),
        ("48.001", "nan", "line 3: latitude_deg: found nan"),
        ("48.001", "4_8", "line 3: latitude_deg: found 4_8"),
        ("48.001", "", "line 3: latitude_deg: found , expected"),
        (",5e2", "", "line 3: found 3 fields, expected 4"),
        ("10.5,48.001,11.0,5e2\n", "", "found 1 rows, expected two"),
        ("5e2\n", "5e2", "no line end"),
        (GOOD, "", "line 1: found nothing"),
    ],
)
def test_garbage_is_one_clear_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        _read(tmp_path / "way.csv", GOOD.replace(old, new))
