from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from report_builder import SCENARIOS
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import level_verdicts
from vestige.campaign.range_errors import range_errors_m, recs_since, recs_that_count, stored_range_errors_m, window_of
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.store.attributes import scenario_of
from vestige.scenario.load import load_scenario

_FINITE = st.floats(-1e3, 1e3)


def _since_the_recs_before(error_m: np.ndarray, recs: np.ndarray) -> np.ndarray:
    """Return the largest error of each epoch with RECS since the RECS before, epoch by epoch."""
    worst_m, since = np.zeros(recs.size), 0.0
    for epoch, error in enumerate(error_m):
        since = error if abs(error) > abs(since) else since
        if recs[epoch]:
            worst_m[epoch], since = since, 0.0
    return worst_m


@given(st.data(), st.integers(1, 30))
def test_the_error_of_e1_is_the_largest_since_the_recs_before(data: st.DataObject, n: int) -> None:
    recs = data.draw(arrays(np.bool_, n))
    error_m = data.draw(arrays(np.float64, n, elements=_FINITE, unique=True))
    results = xarray.Dataset(
        {
            "recs": ("epoch", recs),
            "e1_pseudorange_m": (("epoch", "satellite"), np.full((n, 1), 23e6)),
            "truth_e1_worst_error_m": (("epoch", "satellite"), error_m[:, None]),
        }
    )
    in_use_m = np.where(recs, 23e6, nan)[:, None]
    found_m = range_errors_m(results, in_use_m, np.zeros((n, 1), np.bool_))[:, 0]
    np.testing.assert_array_equal(np.abs(found_m), np.where(recs, np.abs(_since_the_recs_before(error_m, recs)), nan))
    assert np.isin(found_m[recs], [*error_m, 0.0]).all()


def test_the_recs_after_the_attack_counts() -> None:
    recs = np.array([True, False, True, False, True, False, True])
    attacked = np.array([False, True, False, True, False, False, False])
    assert np.flatnonzero(recs_since(recs, attacked)).tolist() == [2, 4]


@pytest.mark.parametrize("level", [1, 2])
def test_stored_ranges_have_the_errors_of_the_level(level: int) -> None:
    """What the results store gives the numbers that the processor gives when it judges the results again."""
    settings = (
        'fidelity="correlators"', "epochs=260", f"processor.level={level}", "attack.0.start_s=40",
        "attack.0.stop_s=200", "attack.0.power_db=6", "attack.0.delay_m=200", 'attack.0.bands=["E1", "E6"]',
    )  # fmt: skip
    results = direct_results(ScenarioPlan(scenario=load_scenario(SCENARIOS / "liftoff_sudden.toml", settings)))
    (found,) = level_verdicts(results, (level,))
    np.testing.assert_array_equal(stored_range_errors_m(results), found.range_error_m)
    assert np.isfinite(found.range_error_m).any()
    assert window_of(scenario_of(results)) == (40.0, 200.0)
    assert np.flatnonzero(recs_that_count(results)).tolist() == list(range(40, 200))


def test_an_attack_without_end_and_a_run_without_attack() -> None:
    for attack, window in (("attack.0.start_s=7", (7.0, inf)), ("attack=[]", (0.0, inf))):
        scenario = load_scenario(SCENARIOS / "liftoff_sudden.toml", ['fidelity="correlators"', "epochs=2", attack])
        results = direct_results(ScenarioPlan(scenario=scenario))
        assert window_of(scenario) == window_of(scenario_of(results)) == window
