from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray

from report_builder import LIFT_OFF, QUICK, SCENARIOS, SKY, data_of, made, rows_of, unpacked
from results_builder import campaign_results, stored
from vestige.campaign.levels import failures, level_verdicts
from vestige.campaign.store.results import open_results
from vestige.campaign.verdicts import results_digest
from vestige.errors import VestigeError
from vestige.records import Status
from vestige.report import run_page
from vestige.scenario.load import load_scenario

RUNS = {"quick": QUICK, "liftoff_sudden": LIFT_OFF, "sky": SKY}
BODY = [status.value for status in Status]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, xarray.Dataset]:
    folder = tmp_path_factory.mktemp("runs")
    return {name: open_results(made(folder / name, name, *settings)).dataset.load() for name, settings in RUNS.items()}


@pytest.fixture(scope="module")
def pages(results: dict[str, xarray.Dataset]) -> dict[str, str]:
    return {name: run_page(one, name).html() for name, one in results.items()}


def due(results: xarray.Dataset) -> np.ndarray:
    n, m = results.sizes["epoch"], results.sizes["satellite"]
    if "elevation_deg" not in results:
        return np.ones((n, m), dtype=bool)
    return results["recs"].values[:, None] & np.isfinite(results["elevation_deg"].values)


@pytest.mark.parametrize("name", RUNS)
def test_verdicts_are_counted(name: str, results: dict[str, xarray.Dataset], pages: dict[str, str]) -> None:
    status, mask = results[name]["status"].values, due(results[name])
    rows = rows_of(pages[name], f"{mask.sum():,} verdicts were due".replace(",", "\u202f"))
    for place, word in enumerate(BODY):
        (count,) = (cells[0] for heading, cells in rows.items() if heading.startswith(word))
        assert int(count.replace("\u202f", "")) == np.count_nonzero(mask & (status == place))


@pytest.mark.parametrize("name", RUNS)
def test_the_drawings_are_those_of_the_results(
    name: str, results: dict[str, xarray.Dataset], pages: dict[str, str]
) -> None:
    data, one = data_of(pages[name]), results[name]
    for place, drawn in enumerate(data["satellites"]):
        at = np.flatnonzero(due(one)[:, place])
        assert drawn["name"] == f"E{one['svid'].values[place]:02d}"
        np.testing.assert_array_equal(unpacked(drawn["time_s"]), one["time_s"].values[at])
        np.testing.assert_array_equal(unpacked(drawn["status"]), one["status"].values[at, place])
        taps, power = one["taps"].values[at, place], one["noise_power"].values[at, place]
        expected = np.abs(taps) / np.sqrt(power / 2)[:, None]
        found = unpacked(drawn["taps"]).reshape(expected.shape) * data["top_sigma"] / 0xFFFE
        np.testing.assert_allclose(found, expected, atol=data["top_sigma"] / 1e5 + 1e-3)
        for row, detector in enumerate(data["detectors"]):
            offset_m = one["range_offset_m"].values[row, at, place]
            np.testing.assert_array_equal(unpacked(drawn["offset_m"][detector]), offset_m)
    counts = data["histogram"]["counts"]
    for row, detector in enumerate(data["detectors"]):
        offset_m = one["range_offset_m"].values[row][due(one)]
        assert sum(counts[detector]) == np.count_nonzero(np.isfinite(offset_m))


@pytest.mark.parametrize("name", RUNS)
def test_steps_1_and_2_are_those_of_the_processor(
    name: str, results: dict[str, xarray.Dataset], pages: dict[str, str]
) -> None:
    rows = rows_of(pages[name], "Checks of steps 1 and 2")
    for check, row in (("E6 power", rows["E6 power"]), ("E1-E6 range", rows["E1–E6 range"])):
        stored = results[name]["check_result"].sel(check=check).values[due(results[name])]
        assert row[2:] == [str(np.count_nonzero(stored == value)) for value in (1, 0, -1)]
    assert rows["E6 power"][0] == "0"
    assert "above 5.678 σ" in rows["E6 power"][1]  # sqrt(-2 ln 1e-7)
    assert rows["E1–E6 range"][0] == "±26.55 m"  # 3 times 8.85 m of the uncorrected budget


def test_a_miss_that_e1_predicts_is_no_failure(tmp_path: Path) -> None:
    """At 26 dBHz E1 predicts most misses, so the check of E6 power is not run on them."""
    store = made(tmp_path / "weak", "quick", "epochs=200", "receiver.cn0_dbhz=26")
    weak = open_results(store).dataset.load()
    detected = np.count_nonzero(weak["tap_index"].sel(detector="early").values >= 0)
    assert 0 < detected < 30
    row = rows_of(run_page(weak, "weak").html(), "Checks of steps 1 and 2")["E6 power"]
    assert row[2:] == ["0", str(detected), str(200 - detected)]


def test_the_range_threshold_is_that_of_the_false_alarms_a_day(tmp_path: Path) -> None:
    """With `alarms_per_day` κ is no setting: the page and its drawings have the threshold that was applied."""
    store = made(tmp_path / "rare", "quick", "epochs=30", "processor.alarms_per_day=1")
    rare = open_results(store)
    limit_m = rare.check("E1-E6 range").threshold[0, 0]
    assert limit_m > 27
    page = run_page(rare.dataset.load(), "rare").html()
    assert rows_of(page, "Checks of steps 1 and 2")["E1–E6 range"][0] == f"±{limit_m:.4g} m"
    assert data_of(page)["limit_m"] == limit_m


def test_both_detectors_and_the_truth_of_an_attack(pages: dict[str, str]) -> None:
    page, data = pages["liftoff_sudden"], data_of(pages["liftoff_sudden"])
    assert "under attack (lift-off)" in page
    assert {"E11, early", "E11, maximum"} <= set(rows_of(page, "Outcome of the attack"))
    (attack,) = data["satellites"][0]["spoofing_signals"]
    power_db = unpacked(attack["power_db"])
    assert attack["name"] == "0 lift-off"
    assert np.isnan(power_db[:100]).all()
    assert power_db[-1] == pytest.approx(4.5)
    assert "spoofing_signals" not in data_of(pages["quick"])["satellites"][0]


def test_false_alarms_are_those_without_the_attack(results: dict[str, xarray.Dataset], pages: dict[str, str]) -> None:
    status = results["liftoff_sudden"]["status"].values[:100, 0]
    alarms = np.count_nonzero((status != 0) & (status != BODY.index("not available")))
    row = rows_of(pages["liftoff_sudden"], "Counted in this run, exact 95 % intervals")["verdicts without an attack"]
    assert row[1:3] == [str(alarms), "100"]


def test_the_checks_of_a_sky(results: dict[str, xarray.Dataset], pages: dict[str, str]) -> None:
    page, (found_at_3,) = pages["sky"], level_verdicts(results["sky"], (3,))
    budgets, alarms = (
        rows_of(page, "Thresholds of the monitors"),
        rows_of(page[page.index('id="false-alarms"') :], "Monitors"),
    )
    assert set(budgets) == set(alarms) == {name.value for name in found_at_3.checks}
    lanes = {lane["name"]: unpacked(lane["ratio"]) for lane in data_of(page)["checks"]["lanes"]}
    for name, check in found_at_3.checks.items():
        found = failures(check)
        assert alarms[name][1:3] == [f"{count:,}".replace(",", " ") for count in (found.successes, found.trials)]
        assert (np.nanmax(lanes[name], initial=0.0) > 1) == (found.successes > 0)
    assert 'data-figure="position"' in page
    assert 'data-figure="position"' not in pages["quick"]


@pytest.mark.parametrize("name", RUNS)
def test_the_scenario_in_the_page_makes_the_same_run(name: str, pages: dict[str, str], tmp_path: Path) -> None:
    from urllib.parse import unquote

    (link,) = re.findall(r'href="data:application/toml;charset=utf-8,([^"]*)"', pages[name])
    (tmp_path / "scenario.toml").write_text(unquote(link), encoding="utf-8")
    text = load_scenario(tmp_path / "scenario.toml").model_dump_json()
    expected = load_scenario(SCENARIOS / f"{name}.toml", RUNS[name]).model_dump_json()
    assert text == expected
    assert hashlib.sha256(text.encode()).hexdigest() in pages[name]


@pytest.mark.parametrize("name", RUNS)
def test_nothing_is_fetched(name: str, pages: dict[str, str]) -> None:
    addresses = re.findall(r'\b(?:src|href|action|poster|srcset)="([^"]*)"', pages[name])
    assert all(address.startswith(("#", "data:")) for address in addresses)
    assert "://" not in pages[name].replace("data:", "")


@pytest.mark.parametrize("name", RUNS)
def test_who_does_not_see_it_is_told(name: str, pages: dict[str, str]) -> None:
    page = pages[name]
    for canvas in re.findall(r"<canvas[^>]*>", page):
        assert re.search(r'role="img" aria-label="[^"]{20,}"', canvas)
    for control in re.findall(r'<(?:input type="range"|button)[^>]*>', page):
        assert "aria-label=" in control
    targets, anchors = set(re.findall(r'href="#([^"]+)"', page)), set(re.findall(r'\bid="([^"]+)"', page))
    assert targets <= anchors
    assert len(re.findall(r'\bid="', page)) == len(anchors)


def test_text_of_a_scenario_is_escaped(results: dict[str, xarray.Dataset]) -> None:
    one = results["quick"].copy()
    scenario = json.loads(one.attrs["scenario"]) | {"attack": [{"kind": "</pre><script>x</script>"}]}
    text = json.dumps(scenario)
    one.attrs |= {"scenario": text, "scenario_digest": hashlib.sha256(text.encode()).hexdigest()}
    page = run_page(one, "<i>name</i>", question="<img src=x>").html()
    assert "<script>x" not in page
    assert "<i>" not in page
    assert "<img" not in page


def test_long_runs_are_thinned_honestly(results: dict[str, xarray.Dataset], monkeypatch: pytest.MonkeyPatch) -> None:
    from vestige.report import run_drawings

    monkeypatch.setattr(run_drawings, "ROWS", 120)
    monkeypatch.setattr(run_drawings, "_OUTERMOST", 4)
    one = results["quick"]
    page = run_page(one, "long").html()
    data = data_of(page)
    (drawn,) = data["satellites"]
    missed = one["time_s"].values[(one["tap_index"].values < 0).any(axis=0)[:, 0]]
    assert 0 < missed.size <= 20
    time_s = unpacked(drawn["time_s"])
    assert set(missed) <= set(time_s)
    assert time_s.size <= 120
    offsets = one["range_offset_m"].sel(detector="early").values
    assert np.nanmax(unpacked(drawn["offset_m"]["early"])) == np.nanmax(offsets)
    assert "E11: every 7th of the epochs; besides, all misses, all alarms, all outermost offsets." in page
    bits = np.bitwise_or.reduce(unpacked(drawn["statuses"]))
    assert {place for place in range(8) if bits >> place & 1} == set(np.unique(one["status"].values).tolist())


def test_misses_are_kept_whatever_the_verdict(
    results: dict[str, xarray.Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    from vestige.report import run_drawings

    monkeypatch.setattr(run_drawings, "ROWS", 120)
    one = results["quick"].copy(deep=True)
    one["status"].values[:] = 0
    one["tap_index"].values[1, 123] = -1
    one["range_offset_m"].values[1, 123] = np.nan
    (drawn,) = data_of(run_page(one, "long").html())["satellites"]
    missed = one["time_s"].values[(one["tap_index"].values < 0).any(axis=0)[:, 0]]
    assert 123 in missed
    assert set(missed) <= set(unpacked(drawn["time_s"]))


def test_a_run_that_has_not_ended_says_so(results: dict[str, xarray.Dataset]) -> None:
    part = results["quick"].isel(epoch=slice(0, 60)).assign_coords(epoch=np.arange(60))
    assert "This run has not ended: 60 of 400 epochs are stored." in run_page(part, "part").html()


def test_noise_alone(tmp_path: Path) -> None:
    store = made(tmp_path / "noise", "quick", "epochs=50", "receiver.signal=false", "processor.p_fa=0.01")
    page = run_page(open_results(store).dataset.load(), "noise").html()
    assert "How often is noise alone taken for the signal?" in page
    assert "detected in noise by the early detector" in page


def test_nothing_detected_at_all(tmp_path: Path) -> None:
    store = made(tmp_path / "weak", "quick", "epochs=20", "receiver.cn0_dbhz=0", "receiver.multipath=none")
    page = run_page(open_results(store).dataset.load(), "weak").html()
    assert data_of(page)["histogram"] == {}
    assert 'data-figure="histogram"' not in page


def test_what_is_no_run_is_one_line(results: dict[str, xarray.Dataset], tmp_path: Path) -> None:
    good = results["quick"]
    bad = {
        "found no status": open_results(stored(campaign_results(5), tmp_path / "foreign")).dataset,
        "found threshold_sigma nan, expected": good.assign_attrs(threshold_sigma=float("nan")),
        "scenario: found no text that agrees with its digest": good.assign_attrs(scenario="{}"),
        "found no epoch with a verdict": good.isel(epoch=slice(0, 0)),
        "found time_s of 400, expected ascending": good.assign(time_s=("epoch", np.zeros(400))),
    }
    for place, key in ((None, "recs"), ("receiver", "signal")):
        tables = json.loads(good.attrs["scenario"])
        del (tables[place] if place else tables)[key]
        text = json.dumps(tables)
        old = good.assign_attrs(scenario=text, scenario_digest=hashlib.sha256(text.encode()).hexdigest())
        bad[f"scenario: found no {place}.{key}, expected" if place else f"scenario: found no {key}, expected"] = old
    for message, one in bad.items():
        with pytest.raises(VestigeError, match=message) as caught:
            run_page(one, "bad")
        assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def at_level_2(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    """A lift-off of 300 s, judged by level 2."""
    store = made(tmp_path_factory.mktemp("level") / "two", "liftoff_sudden", *LIFT_OFF, "processor.level=2")
    return open_results(store).dataset.load()


def test_the_verdicts_are_those_of_the_level(at_level_2: xarray.Dataset) -> None:
    """Every RECS has the gravest of what its level says; here each epoch is one."""
    (found,) = level_verdicts(at_level_2, (2,))
    page = run_page(at_level_2, "two").html()
    np.testing.assert_array_equal(found.status, at_level_2["status"].values)
    (minimum,) = level_verdicts(at_level_2, (1,))
    assert (found.status != minimum.status).any()  # steps 1 and 2 alone see less
    rows = rows_of(page, "300 verdicts were due")
    for place, word in enumerate(BODY):
        (count,) = (cells[0] for heading, cells in rows.items() if heading.startswith(word))
        assert int(count) == np.count_nonzero(found.status == place)
    drawn = data_of(page)["satellites"][0]
    np.testing.assert_array_equal(unpacked(drawn["status"]), found.status[:, 0])
    assert results_digest(at_level_2) in page  # of the store, not of what was made of it


def test_every_check_of_the_level_is_there(at_level_2: xarray.Dataset) -> None:
    (found,) = level_verdicts(at_level_2, (2,))
    page = run_page(at_level_2, "two").html()
    rows = rows_of(page, "Checks of mitigation level 2, and when they first failed")
    assert set(rows) == {name for name, tests in found.tests.items() if tests.any()}
    failed = found.failed["E6 C/N0"]
    assert rows["E6 C/N0"][2:] == [str(failed.sum()), f"T = {np.flatnonzero(failed.any(axis=1))[0]} s"]
    assert "Not run, because the results do not hold what the check needs: clock innovation" in page
    assert f"<dt>alarms that a user saw</dt><dd>{found.begins.sum()}" in page
