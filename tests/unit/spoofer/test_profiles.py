from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.errors import InputFileError
from vestige.spoofer.profiles import (
    ALL_PROFILES,
    AnyProfile,
    Constant,
    Ramp,
    Sine,
    Table,
    Trapezoid,
    as_profile,
    extremes,
    fastest,
)

SINE = Sine(first=75.0, turn=0.0, last=60.0, start_s=500.0, turn_s=600.0, stop_s=1100.0)
CASES: dict[str, tuple[AnyProfile, bool]] = {  # and whether the rate is continuous
    "constant": (Constant(level=3.0), True),
    "ramp": (Ramp(first=-20.0, last=3.0, start_s=10.0, stop_s=60.0), False),
    "smooth ramp": (Ramp(first=-20.0, last=3.0, start_s=10.0, stop_s=60.0, smooth=True), True),
    "sine": (SINE, True),
    "trapezoid": (Trapezoid(base=0.0, top=9.0, start_s=5.0, stop_s=50.0, rise_s=10.0, fall_s=20.0), False),
    "smooth trapezoid": (
        Trapezoid(base=0.0, top=9.0, start_s=5.0, stop_s=50.0, rise_s=10.0, fall_s=20.0, smooth=True),
        True,
    ),
    "table": (Table(time_s=(0.0, 10.0, 15.0), values=(1.0, 4.0, -6.0)), False),
}
every_profile = pytest.mark.parametrize(("profile", "smooth"), CASES.values(), ids=CASES)


def test_every_profile_has_a_case() -> None:
    assert {type(profile) for profile, _ in CASES.values()} == set(ALL_PROFILES)


@every_profile
def test_value_is_the_integral_of_the_rate(profile: AnyProfile, smooth: bool) -> None:
    t_s = np.linspace(-10.0, 1200.0, 1_210_001)
    middle_s = (t_s[1:] + t_s[:-1]) / 2
    integral = np.concatenate([[0.0], np.cumsum(profile.rate(middle_s) * np.diff(t_s))])
    value = profile.value(t_s)
    assert np.max(np.abs(value - value[0] - integral)) < 5e-3
    if smooth:
        assert np.max(np.abs(np.diff(profile.rate(t_s)))) < 1e-3


@every_profile
def test_extremes_and_the_fastest(profile: AnyProfile, smooth: bool) -> None:
    t_s = np.linspace(-10.0, 1200.0, 1_210_001)
    value = profile.value(t_s)
    assert extremes(profile) == pytest.approx((value.min(), value.max()), abs=1e-6)
    assert fastest(profile) == pytest.approx(np.max(np.abs(profile.rate(t_s))), rel=1e-6)


def test_values_of_the_sine() -> None:
    """cos² of a quarter turn is ½: half-way in time is half-way in value; at rest where it turns."""
    t_s = np.array([0.0, 500.0, 550.0, 600.0, 850.0, 1100.0, 2000.0])
    assert SINE.value(t_s) == pytest.approx([75.0, 75.0, 37.5, 0.0, 30.0, 60.0, 60.0])
    assert SINE.rate(t_s) == pytest.approx([0, 0, -37.5 * np.pi / 100, 0, 30 * np.pi / 500, 0, 0])


@given(t_s=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20))
def test_a_number_is_a_constant(t_s: list[float]) -> None:
    profile = as_profile(2.5)
    assert np.all(profile.value(np.array(t_s)) == 2.5)
    assert as_profile(profile) is profile
    assert (extremes(2.5), fastest(2.5)) == ((2.5, 2.5), 0.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ramp(first=0.0, last=1.0, start_s=2.0, stop_s=2.0), "ascend"),
        (lambda: Ramp(first=0.0, last=float("nan"), start_s=0.0, stop_s=2.0), "finite"),
        (lambda: Ramp(first=float("-inf"), last=0.0, start_s=0.0, stop_s=2.0), "finite"),
        (lambda: Sine(first=0.0, turn=0.0, last=1.0, start_s=0.0, turn_s=3.0, stop_s=2.0), "ascend"),
        (lambda: Trapezoid(base=0.0, top=1.0, start_s=0.0, stop_s=5.0, rise_s=3.0, fall_s=3.0), "flanks"),
        (lambda: Table(time_s=(0.0,), values=(1.0,)), "two points"),
        (lambda: Table(time_s=(0.0, 1.0), values=(1.0,)), "two points"),
        (lambda: Table(time_s=(1.0, 0.0), values=(1.0, 2.0)), "ascend"),
    ],
)
def test_what_is_no_profile(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_table_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "delay.csv"
    path.write_text("# pulled by hand\ntime_s,value\n0,1\n\n10,4\n15,-6\n")
    table = Table(path=str(path))
    assert (table.time_s, table.values) == ((0.0, 10.0, 15.0), (1.0, 4.0, -6.0))
    path.unlink()
    assert table.value(np.array([5.0])) == pytest.approx([2.5])


@pytest.mark.parametrize(
    ("content", "place", "found"),
    [
        (b"", "first line", "nothing"),
        (b"t,v\n0,1\n", "first line", "t,v"),
        (b"time_s,value\n0,1\n", "end of file", "1 points"),
        (b"time_s,value\n0,1\n1\n", "line 3", "1"),
        (b"time_s,value\n0,1\n1,x\n", "line 3", "1,x"),
        (b"time_s,value\n0,1\n1,nan\n", "line 3", "1,nan"),
        (b"time_s,value\n0,1\n0,2\n", "line 3", "0,2"),
        (b"\xff\xfe", "byte 0", "bytes that are not UTF-8"),
    ],
)
def test_what_is_no_table(tmp_path: Path, content: bytes, place: str, found: str) -> None:
    path = tmp_path / "delay.csv"
    path.write_bytes(content)
    with pytest.raises(InputFileError) as error:
        Table(path=str(path))
    assert (error.value.place, error.value.found) == (place, found)


@pytest.mark.parametrize("name", ["absent.csv", ".", "a\0b"])
def test_no_file(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputFileError):
        Table(path=f"{tmp_path}/{name}")


@pytest.mark.parametrize("name", ["ramp", "trapezoid", "table"])
def test_rate_at_a_corner_is_that_of_what_follows(name: str) -> None:
    profile, _ = CASES[name]
    corners_s = {"ramp": [10.0, 60.0], "trapezoid": [5.0, 15.0, 30.0, 50.0], "table": [0.0, 10.0, 15.0]}[name]
    at = np.array(corners_s)
    after = (profile.value(at + 1e-3) - profile.value(at)) / 1e-3
    assert profile.rate(at) == pytest.approx(after, abs=1e-6)
