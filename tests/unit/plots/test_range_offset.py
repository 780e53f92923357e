from __future__ import annotations

import numpy as np

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


def test_without_misses_there_is_no_legend() -> None:
    assert range_offset(campaign_results(50, cn0_dbhz=50.0)).get_legend() is None


def test_draws_where_it_is_told() -> None:
    ax = new_axes()
    assert range_offset(campaign_results(5), ax=ax) is ax
    assert range_offset(campaign_results(5)) is not ax
