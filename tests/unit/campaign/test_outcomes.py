from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st

from vestige.campaign.columns.attack_columns import attack_coords
from vestige.campaign.outcomes import RESOLUTION_M, DetectedSignal, classify, outcomes, report
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.records import Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.spoofer.repeaters import Forgery, LiftOff
from vestige.spoofer.spoofer import Spoofer

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
ATTACKED = load_scenario(SCENARIOS / "quick.toml", ['attack=[{kind="lift-off", delay_m=9.0, power_db=3.0}]'])
E1_M = 23e6


def _one(found_m: float, truth_m: float, spoofer_m: float, power_db: float) -> DetectedSignal:
    values = np.array([found_m]), np.array([truth_m]), np.array([[spoofer_m]]), np.array([[power_db]])
    return DetectedSignal(int(classify(*values)[0]))


@pytest.mark.parametrize(
    ("found_m", "truth_m", "spoofer_m", "power_db", "expected"),
    [
        (nan, 0.0, 80.0, 3.0, DetectedSignal.NONE),
        (2.0, 0.0, 80.0, 3.0, DetectedSignal.TRUE),
        (-22.5, 0.0, 80.0, 3.0, DetectedSignal.TRUE),  # on the flank
        (79.0, 0.0, 80.0, 3.0, DetectedSignal.SPOOFER),
        (-5.0, -80.0, 80.0, 3.0, DetectedSignal.SPOOFER),  # E1 follows the spoofer, which is where it predicts
        (-78.0, -80.0, 80.0, 3.0, DetectedSignal.TRUE),
        (10.0, 0.0, 20.0, 3.0, DetectedSignal.MIXED),
        (10.0, 0.0, 20.0, -20.0, DetectedSignal.TRUE),  # too weak to count
        (79.0, 0.0, 80.0, -inf, DetectedSignal.TRUE),
        (10.0, 0.0, RESOLUTION_M - 0.1, 3.0, DetectedSignal.MIXED),
        (10.0, 0.0, RESOLUTION_M + 0.1, 3.0, DetectedSignal.TRUE),
        (-19.0, 0.0, -20.0, 3.0, DetectedSignal.MIXED),
    ],
)
def test_classes(found_m: float, truth_m: float, spoofer_m: float, power_db: float, expected: DetectedSignal) -> None:
    assert _one(found_m, truth_m, spoofer_m, power_db) is expected


@given(st.floats(-80, 80), st.floats(-20, 20), st.floats(-200, 200), st.floats(-14, 20), st.floats(-500, 500))
def test_only_differences_count(
    found_m: float, truth_m: float, spoofer_m: float, power_db: float, shift_m: float
) -> None:
    moved = _one(found_m + shift_m, truth_m + shift_m, spoofer_m, power_db)
    distances = abs(found_m - truth_m), abs(found_m - truth_m - spoofer_m)
    if abs(distances[0] - distances[1]) > 1e-6 and abs(abs(spoofer_m) - RESOLUTION_M) > 1e-6:
        assert moved is _one(found_m, truth_m, spoofer_m, power_db)
        if abs(spoofer_m) > RESOLUTION_M:
            assert moved is (DetectedSignal.TRUE if distances[0] < distances[1] else DetectedSignal.SPOOFER)


def test_of_several_the_nearest_counts() -> None:
    offset_m, power_db = np.array([[100.0, -90.0, 200.0]]), np.array([[3.0, 3.0, -inf]])
    for found_m, expected in (
        (95.0, DetectedSignal.SPOOFER),
        (-80.0, DetectedSignal.SPOOFER),
        (199.0, DetectedSignal.SPOOFER),
        (3.0, DetectedSignal.TRUE),
    ):
        assert classify(np.array([found_m]), np.zeros(1), offset_m, power_db)[0] == expected


def _results(**columns: list[float]) -> xarray.Dataset:
    """Return results of one satellite, one attack and one detector; a column is a list over epochs.

    `in_use` is the range in use minus that of E1, NaN for none; it is that of the earlier signal unless it is 0.
    """
    n = len(columns["time_s"])
    usual = {"spoofed": 1.0, "error": 0.0, "offset": 100.0, "power": 3.0, "noise": 0.0, "e1_noise": 0.0}
    usual |= {"in_use": 0.0, "recs": 1.0}
    given = {name: [value] * n for name, value in usual.items()} | columns
    status = [list(Status).index(Status[str(name)]) for name in given.pop("status", ["AUTHENTIC"] * n)]
    one = ("epoch", "satellite")

    text = ATTACKED.model_dump_json()
    in_use_m = np.array(given["in_use"])[:, None]

    def column(values: list[float]) -> np.ndarray:
        return np.array(values, float)[:, None]

    return xarray.Dataset(
        {
            "time_s": ("epoch", np.array(given["time_s"])),
            "recs": ("epoch", np.array(given["recs"]) > 0),
            "e1_pseudorange_m": (one, column([E1_M] * n)),
            "range_in_use_m": (one, E1_M + in_use_m),
            "range_is_earlier": (one, np.abs(np.nan_to_num(in_use_m)) > 0),
            "truth_e1_error_m": (one, column(given["error"])),
            "range_offset_m": (("detector", *one), column(given["found"])[None]),
            "status": (one, np.array(status, np.int8)[:, None]),
            "truth_spoofed": (one, column(given["spoofed"]).astype(bool)),
            "truth_prediction_error_m": (one, column([0.0] * n)),
            "truth_spoofer_offset_m": ((*one, "attack"), column(given["offset"])[..., None]),
            "truth_spoofer_power_db": ((*one, "attack"), column(given["power"])[..., None]),
            "truth_noise_rise_db": (one, column(given["noise"])),
            "truth_e1_noise_rise_db": (one, column(given["e1_noise"])),
            "truth_e1_worst_error_m": (one, column(given["error"])),
            "truth_e1_captured": (one, np.abs(column(given["error"])) > 50),
        },
        coords={"detector": ["early"], "forged": ("attack", [False])},
        attrs={"scenario": text, "scenario_digest": sha256(text.encode()).hexdigest()},
    )


def test_report() -> None:
    results = _results(
        time_s=[0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        spoofed=[0, 1, 1, 1, 1, 1],
        found=[0.0, 100.0, nan, 99.0, 1.0, -2.0],
        error=[0.0, 10.0, -70.0, 60.0, 0.0, 0.0],
        status=["AUTHENTIC", "AUTHENTIC", "NOT_DETECTED", "AUTHENTIC", "SPOOFED", "AUTHENTIC"],  # type: ignore[list-item]
    )
    found = report(results)
    assert found is not None
    assert found.shares == {
        DetectedSignal.NONE: 0.2,
        DetectedSignal.TRUE: 0.4,
        DetectedSignal.SPOOFER: 0.4,
        DetectedSignal.MIXED: 0.0,
    }
    assert (found.first_s, found.epochs) == (1.0, 5)
    assert found.time_to_detect_s == 1.0
    assert found.time_to_mitigate_s == 3.0
    assert found.e1_captured == pytest.approx(0.4)


def test_report_of_what_never_happens() -> None:
    results = _results(time_s=[0.0, 1.0], found=[100.0, 100.0], status=["NOT_AVAILABLE"] * 2, in_use=[nan, nan])  # type: ignore[list-item]
    found = report(results)
    assert found is not None
    assert np.isnan([found.time_to_detect_s, found.time_to_mitigate_s, found.worst_range_m]).all()
    assert report(_results(time_s=[0.0], spoofed=[0], found=[0.0])) is None


def test_the_worst_range_is_that_of_the_ranges_in_use_whatever_the_status() -> None:
    """The AUTHENTIC epoch without a range in use, with 90 m, does not count; the SPOOFED one with a range does."""

    def worst_m(in_use: list[float], error: list[float]) -> float:
        status = ["AUTHENTIC", "AUTHENTIC", "SPOOFED", "AUTHENTIC"]
        found = report(
            _results(time_s=[0.0, 1.0, 2.0, 3.0], found=[0.0] * 4, error=error, in_use=in_use, status=status)  # type: ignore[arg-type]
        )
        assert found is not None
        return found.worst_range_m

    assert worst_m([0.0, nan, 0.0, 0.0], [1.0, 90.0, -30.0, 2.0]) == -30.0
    # the earlier signal is 31 m before E1, which the attack delays by 30 m: this range is wrong by −1 m only
    assert worst_m([0.0, nan, -31.0, nan], [0.5, 90.0, 30.0, 2.0]) == -1.0
    assert np.isnan(worst_m([nan] * 4, [1.0, 90.0, 30.0, 2.0]))


def test_a_range_in_use_has_the_largest_error_since_the_recs_before() -> None:
    results = _results(
        time_s=[0.0, 1.0, 2.0, 3.0, 4.0], found=[0.0] * 5, recs=[1, 0, 0, 1, 0], error=[1.0, -50.0, 20.0, 2.0, 99.0],
        in_use=[0.0, nan, nan, 0.0, nan],
    )  # fmt: skip
    found = report(results)
    assert found is not None
    assert found.worst_range_m == -50.0


@pytest.mark.parametrize("band", ["noise", "e1_noise"])
def test_noise_on_one_band_is_an_attack(band: str) -> None:
    results = _results(time_s=[0.0, 1.0, 2.0], spoofed=[0, 0, 0], found=[1.0] * 3, **{band: [0.0, 3.0, 3.0]})
    found = report(results)
    assert found is not None
    assert (found.first_s, found.epochs) == (1.0, 2)


def test_of_a_sky_epochs_with_recs_count() -> None:
    status = ["NOT_AVAILABLE", "AUTHENTIC", "NOT_AVAILABLE", "AUTHENTIC"]
    results = _results(time_s=[0.0, 1.0, 2.0, 3.0], found=[nan, 100.0, nan, 100.0], status=status)  # type: ignore[arg-type]
    found = report(results.assign(recs=("epoch", [False, True, False, True])))
    assert found is not None
    assert (found.first_s, found.epochs, found.shares[DetectedSignal.SPOOFER]) == (0.0, 2, 1.0)


def test_forged_chips_are_nobody() -> None:
    results = _results(time_s=[0.0], found=[100.0]).assign_coords(forged=("attack", [True]))
    assert outcomes(results).item() == DetectedSignal.TRUE


@pytest.mark.parametrize("svids", [(), (11,)])
def test_forged_chips_are_known_whichever_satellite_they_are_for(svids: tuple[int, ...]) -> None:
    scenario = load_scenario(SCENARIOS / "quick.toml", ["epochs=5"])
    assert isinstance(scenario, CampaignScenario)
    spoofer = Spoofer(attacks=(LiftOff(delay_m=9.0, power_db=3.0), Forgery(power_db=9.0, svids=svids)))
    coords = attack_coords(replace(scenario.simulation(), spoofer=spoofer))
    assert coords["forged"].values.tolist() == [False, True]
    assert coords["attack"].values.tolist() == ["0 lift-off", "1 forgery"]


def test_outcomes_of_a_run(tmp_path: Path) -> None:
    """Before the attack all is TRUE; after 1050 s the detectors differ, as the flags say."""
    scenario = load_scenario(SCENARIOS / "liftoff_sudden.toml", ['fidelity="correlators"', "epochs=1300"])
    assert isinstance(scenario, CampaignScenario)
    results = run(ScenarioPlan(scenario=scenario), tmp_path / "liftoff")
    found = outcomes(results)
    assert found.attrs["flag_meanings"] == "NONE TRUE SPOOFER MIXED"
    before, after = found.isel(epoch=slice(0, 500)), found.isel(epoch=slice(1050, 1300))
    assert np.isin(before, [DetectedSignal.TRUE, DetectedSignal.NONE]).all()
    assert np.mean(after.sel(detector="early") == DetectedSignal.TRUE) > 0.95
    assert np.mean(after.sel(detector="maximum") == DetectedSignal.SPOOFER) > 0.8
    early, maximum = report(results, "early"), report(results, "maximum")
    assert early is not None
    assert maximum is not None
    assert 300 < early.time_to_mitigate_s < 550  # "after some minutes"
    # never for good; that it found the true signal in the last epoch of a run by chance is no mitigation
    assert not maximum.time_to_mitigate_s < 790
    assert early.e1_captured == 0
    quick = load_scenario(SCENARIOS / "quick.toml", ["epochs=200"])
    assert isinstance(quick, CampaignScenario)
    undisturbed = run(ScenarioPlan(scenario=quick), tmp_path / "quick")
    assert report(undisturbed) is None
    assert np.isin(outcomes(undisturbed), [DetectedSignal.TRUE, DetectedSignal.NONE]).all()
