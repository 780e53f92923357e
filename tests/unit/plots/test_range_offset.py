from __future__ import annotations

import numpy as np
import xarray

from results_builder import campaign_results
from vestige.plots.curves.range_offset import range_offset
from vestige.plots.figure import BLUE, RED, new_axes


def test_every_offset_is_a_dot_and_every_miss_a_tick() -> None:
    results = campaign_results(300, cn0_dbhz=31.0, unavailable=slice(50, 60))
    ax = range_offset(results)
    lines = {line.get_color(): line for line in ax.lines}
    np.testing.assert_array_equal(lines[BLUE].get_xdata(), results["time_s"])
    np.testing.assert_array_equal(lines[BLUE].get_ydata(), results["range_offset_m"][0, :, 0])
    missed = np.flatnonzero(results["tap_index"].values[0, :, 0] < 0)
    missed = missed[(missed < 50) | (missed >= 60)]
    np.testing.assert_array_equal(lines[RED].get_xdata(), missed)
    assert lines[RED].get_label() == f"not detected: {missed.size}"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "range offset (m)")


def with_offsets(*offsets_m: float) -> xarray.Dataset:
    results = campaign_results(len(offsets_m))
    results["range_offset_m"].values[:] = np.array(offsets_m)[:, None]
    return results


def test_misses_stand_below_every_dot() -> None:
    results = with_offsets(3.0, -22.5, np.nan, 4.0)
    results["tap_index"].values[0, :, 0] = [5, 3, -1, 5]
    ax = range_offset(results)
    (ticks,) = (line for line in ax.lines if line.get_color() == RED)
    strip = ax.transAxes.transform((0, 2 * ticks.get_ydata()[0]))[1]
    assert ax.transData.transform((0, -22.5))[1] > strip


def test_the_edge_of_the_bank_is_in_view() -> None:
    low_m, high_m = range_offset(with_offsets(0.0, 67.5)).get_ylim()
    assert low_m < 0
    assert high_m > 75


def test_the_limits_of_the_range_check_are_lines_if_offsets_come_near() -> None:
    assert len(range_offset(with_offsets(0.0, 13.0), limit_m=26.6).lines) == 2
    ax = range_offset(with_offsets(0.0, -13.5), limit_m=26.6)
    assert [line.get_ydata()[0] for line in ax.lines[2:]] == [-26.6, 26.6]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["range check ±26.6 m"]
    assert len(range_offset(with_offsets(np.nan), limit_m=26.6).lines) == 2


def test_without_misses_there_is_no_legend() -> None:
    assert range_offset(campaign_results(50, cn0_dbhz=50.0)).get_legend() is None


def test_draws_where_it_is_told() -> None:
    ax = new_axes()
    assert range_offset(campaign_results(5), ax=ax) is ax
    assert range_offset(campaign_results(5)) is not ax
