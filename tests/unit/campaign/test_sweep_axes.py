from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.campaign.sweep.sweep_axes import MAX_CAMPAIGNS, as_settings, grid, parse_axis, store_name
from vestige.errors import VestigeError
from vestige.scenario.toml.toml_file import overridden

VALUES = st.one_of(st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(max_size=8))
SETTINGS = st.dictionaries(st.sampled_from(["seed", "a.b", "a.c"]), VALUES, min_size=1)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("28:31:1", (28, 29, 30, 31)),
        ("28:31.9:1", (28, 29, 30, 31)),
        ("0:0.3:0.1", (0, 0.1, 0.2, 0.3)),  # in binary 0.3 is less than three times 0.1
        ("2:1:-.5", (2, 1.5, 1)),
        ("-3:-1:1", (-3, -2, -1)),
        ("1e-7:1e-7:1", (1e-7,)),
        (" 5 : 6 : 1 ", (5, 6)),
        ("28,30.5", (28, 30.5)),
        ('"samples", "correlators"', ("samples", "correlators")),
        ("true,1", (True, 1)),
        ("7", (7,)),
    ],
)
def test_ranges_and_lists(text: str, values: tuple[Any, ...]) -> None:
    axis = parse_axis(f"a.b={text}")
    assert axis.key == "a.b"
    assert axis.values == values
    assert [isinstance(value, bool) for value in axis.values] == [isinstance(value, bool) for value in values]


BAD = (
    *("", "a", "=1", "a=", "a= ", "a=1:2", "a=1:2:3:4", "a=x:2:1", "a=1:2:0", "a=2:1:1", "a=nan:1:1", "a=1.2.3:2:1"),
    f"a=1,0x{'f' * 4000}",
    *("a=0:1:1e-9", "a=0:1e400:1", "a=1,2,2.0", "a=[1],[2]", "a={x=1}", "a=1]\nb=[2", "a=samples", "a=1,,2"),
)


@pytest.mark.parametrize("text", BAD)
def test_what_says_nothing_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(VestigeError, match="--sweep") as caught:
        parse_axis(text)
    assert "\n" not in str(caught.value)


def test_every_combination() -> None:
    axes = [parse_axis("a=1,2"), parse_axis("b=5:7:1")]
    assert [tuple(settings.values()) for settings in grid(axes)] == [(1, 5), (1, 6), (1, 7), (2, 5), (2, 6), (2, 7)]


def test_bounds_of_a_grid() -> None:
    with pytest.raises(VestigeError, match="each key once"):
        grid([parse_axis("a=1,2"), parse_axis("a=3")])
    axes = [parse_axis(f"{key}=1:{MAX_CAMPAIGNS // 10}:1") for key in "ab"]
    with pytest.raises(VestigeError, match="10000 campaigns"):
        grid(axes)


@given(SETTINGS)
def test_settings_are_what_a_scenario_reads(settings: dict[str, Any]) -> None:
    raw = overridden({}, as_settings(settings))
    read = {key: raw["a"][key[2:]] if "." in key else raw[key] for key in settings}
    assert read == settings
    assert {key: type(value) for key, value in read.items()} == {key: type(value) for key, value in settings.items()}


@given(SETTINGS, SETTINGS)
def test_names_are_one_to_one_and_stay_in_the_folder(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert Path(store_name(one)).name == store_name(one)
    assert (store_name(one) == store_name(other)) == (as_settings(one) == as_settings(other))


def test_names() -> None:
    assert store_name({"receiver.cn0_dbhz": 28}) == "receiver.cn0_dbhz=28.zarr"
    assert "/" not in store_name({"../a": "b/c"})
    with pytest.raises(VestigeError, match="at most 200"):
        store_name({"a": "x" * 300})


def test_a_value_that_is_not_utf_8_has_a_name_of_its_bytes() -> None:
    (settings,) = grid([parse_axis('start="\udcff"')])  # the byte FF of a command line, as Python gives it
    assert store_name(settings) == "start=%22%FF%22.zarr"
