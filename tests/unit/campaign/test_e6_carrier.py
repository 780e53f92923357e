"""The carrier of E6 in a campaign: its phase against that of E1, and its monitors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from tests.sky_builder import sky_scenario

from vestige.acas_processor.levels import OPTIONAL
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SUDDEN = Path(__file__).resolve().parents[3] / "scenarios" / "liftoff_sudden.toml"
QUIET = ("receiver.multipath=none", "receiver.cn0_dbhz=60.0", "receiver.e1_tracking=none")
MONITORS = "processor.e6_carrier={window=20, ray_life_s=0.0}"


def sudden(*settings: str) -> CampaignScenario:
    scenario = load_scenario(SUDDEN, settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


def against_e1(scenario: CampaignScenario) -> np.ndarray:
    results = direct_results(ScenarioPlan(scenario=scenario), judge=False)
    turned = results["phase_rad"].values[0] - results["predicted_phase_rad"].values
    return np.angle(np.exp(1j * turned))


@pytest.mark.parametrize("fidelity", ["correlators", "samples"])
def test_e1_predicts_the_phase_of_e6(fidelity: str) -> None:
    """The true phases of E6 go through thousands of turns; 60 dBHz leave 6 mrad of noise."""
    found = against_e1(sudden("epochs=12", f'fidelity="{fidelity}"', *QUIET))
    assert np.max(np.abs(found)) < 0.03
    moved = against_e1(sudden("epochs=12", f'fidelity="{fidelity}"', *QUIET, "receiver.ionosphere.code_only=false"))
    assert np.std(moved) > 0.5  # an ionosphere that is new every second breaks the carrier


@pytest.mark.parametrize("fidelity", ["correlators", "samples"])
def test_e1_predicts_it_under_a_sky_but_for_a_constant(fidelity: str) -> None:
    """Reception is 80 ms later than the observation; a smooth ionosphere moves by less than 1 mm in a second."""
    ionosphere = 'receiver.ionosphere={kind="heavy-tailed", preset="2017", correlation="smooth"}'
    quiet = ("receiver.e1_multipath=false", *QUIET, ionosphere, "receiver.cn0_e1_dbhz=60.0")
    found = against_e1(sky_scenario("epochs=4", "recs.every=1", f'fidelity="{fidelity}"', *quiet))
    steps = np.diff(np.unwrap(found, axis=0), axis=0)
    assert np.nanmax(np.abs(steps)) < 0.1
    assert np.all(np.isfinite(found))


def run(*settings: str, epochs: int = 700) -> xarray.Dataset:
    return direct_results(ScenarioPlan(scenario=sudden(f"epochs={epochs}", 'fidelity="correlators"', *settings)))


def test_the_monitors_are_optional_and_leave_the_other_checks_alone() -> None:
    """To the bit, as long as they raise no alarm; where they do, no reference levels are learned."""
    for level in (1, 3):
        with_them, without = (run(f"processor.level={level}", *more, epochs=500) for more in ((MONITORS,), ()))
        own = [str(spec.name) for spec in OPTIONAL]
        assert [name for name in with_them["check"].values if name not in without["check"].values] == own
        for name in ("check_result", "check_statistic", "check_threshold"):
            kept = with_them[name].isel(check=slice(0, without.sizes["check"]))
            np.testing.assert_array_equal(kept.values, without[name].values)
        for name in without.data_vars:
            if "check" not in without[name].dims:
                np.testing.assert_array_equal(with_them[name].values, without[name].values, err_msg=str(name))


def test_a_failure_is_suspicion() -> None:
    results = run(MONITORS)
    rows = [list(results["check"].values).index(str(spec.name)) for spec in OPTIONAL]
    failed = np.any(results["check_result"].values[rows, :, 0] == 1, axis=0)
    assert not failed[:500].any()
    assert np.mean(failed[650:700]) > 0.6
    cause = results["cause"].values[failed, 0]
    assert set(rows) & set(cause.tolist())


def test_results_are_judged_alike_wherever_they_are_cut() -> None:
    plan = ScenarioPlan(scenario=sudden("epochs=120", 'fidelity="correlators"', MONITORS))
    columns = plan.measure(0, plan.prepare().advance(0, 120))
    whole = plan.judge(None, 0, columns)[1]
    state, parts = None, []
    for low, high in ((0, 3), (3, 50), (50, 51), (51, 120)):
        part = {
            name: values[:, low:high] if plan.columns[name].dims[0] == "detector" else values[low:high]
            for name, values in columns.items()
        }
        state, found = plan.judge(state, low, part)
        parts.append(found)
    for name in ("check_statistic", "check_threshold"):
        np.testing.assert_array_equal(np.concatenate([one[name] for one in parts], axis=1), whole[name])
