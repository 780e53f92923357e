from __future__ import annotations

import numpy as np
import pytest
import xarray
from scipy.special import bdtr, bdtrc

from vestige.errors import VestigeError
from vestige.plots.curves.detection_curve import COUNTED_EVENTS, detection_curve
from vestige.theory.thresholds import miss_probability, probability_of_detection

ATTRS = {"integration_s": 0.016, "p_fa": 1e-7}


def sweep(cn0_dbhz: list[float], trials: list[int], detections: list[int]) -> xarray.Dataset:
    rows = {"cn0_dbhz": cn0_dbhz, "trials": trials, "detections": detections}
    rows |= {"false_alarm_trials": trials, "false_alarms": detections}
    return xarray.Dataset({name: ("row", values) for name, values in rows.items()}, attrs=ATTRS)


def test_frequencies_in_the_order_of_c_over_n0() -> None:
    ax = detection_curve(sweep([33.0, 30.0, 36.0], [100, 200, 50], [90, 20, 50]))
    dots = next(line for line in ax.lines if line.get_label() == "counted")
    np.testing.assert_array_equal(dots.get_xdata(), [30.0, 33.0, 36.0])
    np.testing.assert_allclose(dots.get_ydata(), [0.1, 0.9, 1.0])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("C/N0 (dBHz)", r"probability ($P_\mathrm{d}$)")
    assert ax.get_title() == r"Detection, 16 ms, $P_\mathrm{fa}$ $10^{-7}$"


def test_the_interval_is_that_of_clopper_and_pearson() -> None:
    events, trials = np.array([0, 1, 20, 199, 200]), 200
    ax = detection_curve(sweep([30.0, 31, 32, 33, 34], [trials] * 5, events.tolist()))
    low, high = np.array([segment[:, 1] for segment in ax.collections[0].get_segments()]).T
    # Each end is the probability at which what was counted, or more extreme, has a chance of 2.5 %.
    np.testing.assert_allclose(bdtrc(events[1:] - 1, trials, low[1:]), 0.025, rtol=1e-6)
    np.testing.assert_allclose(bdtr(events[:-1], trials, high[:-1]), 0.025, rtol=1e-6)
    assert low[0] == 0.0
    assert high[-1] == 1.0


@pytest.mark.parametrize(("count", "theory"), [("detections", probability_of_detection), ("misses", miss_probability)])
def test_theory_is_marcum_q(count: str, theory: object) -> None:
    ax = detection_curve(sweep([30.0, 34.0], [100, 100], [50, 99]), count=count)
    line = next(line for line in ax.lines if "Marcum" in str(line.get_label()))
    assert callable(theory)
    np.testing.assert_allclose(line.get_ydata(), theory(np.asarray(line.get_xdata()), 0.016, 1e-7))
    assert line.get_xdata()[[0, -1]].tolist() == [29.0, 35.0]


def test_misses_are_counted_from_the_other_end() -> None:
    ax = detection_curve(sweep([30.0, 34.0, 35.0], [100, 1000, 1000], [50, 999, 1000]), count="misses")
    dots = next(line for line in ax.lines if line.get_label() == "counted")
    np.testing.assert_allclose(dots.get_ydata(), [0.5, 0.001])
    none = next(line for line in ax.lines if line.get_label() == "none counted")
    np.testing.assert_allclose(none.get_data(), [[35.0], [1 - 0.025 ** (1 / 1000)]])
    assert ax.get_yscale() == "log"
    assert ax.get_ylim()[0] < 0.001


def test_false_alarms_beside_the_probability_asked_for() -> None:
    ax = detection_curve(sweep([30.0, 34.0], [10**8, 10**8], [7, 12]), count="false_alarms")
    dots = next(line for line in ax.lines if line.get_label() == "counted")
    np.testing.assert_allclose(dots.get_ydata(), [7e-8, 1.2e-7])
    theory = next(line for line in ax.lines if line.get_label() == r"required $P_\mathrm{fa}$")
    assert set(theory.get_ydata()) == {1e-7}


def test_without_integration_time_there_is_no_theory() -> None:
    bare = sweep([30.0], [10], [5])
    bare.attrs.clear()
    ax = detection_curve(bare)
    assert [line.get_label() for line in ax.lines] == ["counted"]
    assert ax.get_title() == "Detection"


@pytest.mark.parametrize("count", COUNTED_EVENTS)
@pytest.mark.parametrize(
    ("cn0_dbhz", "trials", "detections"),
    [([30.0], [10], [11]), ([30.0], [0], [0]), ([30.0], [10], [-1]), ([np.nan], [10], [1]), ([], [], [])],
)
def test_impossible_counts(count: str, cn0_dbhz: list[float], trials: list[int], detections: list[int]) -> None:
    with pytest.raises(VestigeError, match=r"sweep: .*found .* expected"):
        detection_curve(sweep(cn0_dbhz, trials, detections), count=count)


@pytest.mark.parametrize(("count", "missing"), [("misses", "detections"), ("false_alarms", "false_alarm_trials")])
def test_what_is_missing_is_named(count: str, missing: str) -> None:
    with pytest.raises(VestigeError, match=f"found no {missing}"):
        detection_curve(sweep([30.0], [10], [5]).drop_vars(missing), count=count)
