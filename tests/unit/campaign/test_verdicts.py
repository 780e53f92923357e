from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
import xarray

from report_builder import LIFT_OFF, SKY, made
from vestige.campaign.outcomes import DetectedSignal, due_verdicts, report
from vestige.campaign.store.results import open_results
from vestige.campaign.verdicts import range_limit_m, results_digest, verdict_counts
from vestige.records import Status


@pytest.fixture(scope="module")
def lift_off(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return open_results(made(tmp_path_factory.mktemp("verdicts") / "a", "liftoff_sudden", *LIFT_OFF)).dataset.load()


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return open_results(made(tmp_path_factory.mktemp("verdicts") / "a", "sky", *SKY)).dataset.load()


def with_status(results: xarray.Dataset, *changes: tuple[slice, Status]) -> xarray.Dataset:
    """Return the results with all verdicts AUTHENTIC but some."""
    status = np.zeros_like(results["status"].values)
    for where, one in changes:
        status[where] = list(Status).index(one)
    return results.assign(status=(results["status"].dims, status))


def test_false_alarms_are_alarms_without_an_attack(lift_off: xarray.Dataset) -> None:
    """Epochs 100 to 299 are under attack; NOT_AVAILABLE decides nothing."""
    counts = verdict_counts(
        with_status(
            lift_off,
            (slice(0, 3), Status.SPOOFED),
            (slice(10, 12), Status.NOT_DETECTED),
            (slice(20, 30), Status.NOT_AVAILABLE),
            (slice(95, 120), Status.SUSPECT),
        )
    )
    assert (counts.due, counts.attacked) == (300, 200)
    assert [counts.of[status] for status in Status] == [300 - 3 - 2 - 10 - 25, 25, 3, 2, 10]
    assert (counts.false_alarms.successes, counts.false_alarms.trials) == (3 + 2 + 5, 90)
    assert counts.recs_a_day == 86_400
    assert counts.false_alarms_a_day[0] == pytest.approx(86_400 * 10 / 90)


def test_a_verdict_is_due_where_a_recs_was_sent_by_a_satellite_in_view(sky: xarray.Dataset) -> None:
    down = sky.copy(deep=True)
    down["elevation_deg"].values[:, 2] = np.nan
    due = due_verdicts(down)
    assert due.sum() == 24 * 4
    assert set(np.flatnonzero(due[:, 0])) == set(range(0, 240, 10))
    assert verdict_counts(sky).due == 24 * 5
    assert verdict_counts(sky).recs_a_day == 8640


def test_epochs_without_recs_are_no_part_of_an_attack(tmp_path: Path) -> None:
    """One epoch in ten has RECS, and in each of them something is found."""
    attack = 'attack=[{kind="lift-off", start_s=60, svids=[6], delay_m=90.0, power_db=6.0, bands=["E6"]}]'
    results = open_results(made(tmp_path / "a", "sky", *SKY, attack)).dataset.load()
    found = report(results, satellite=0)
    assert found is not None
    assert found.shares[DetectedSignal.NONE] == 0
    assert sum(found.shares.values()) == pytest.approx(1)
    down = results.copy(deep=True)
    down["elevation_deg"].values[60:, 0] = np.nan
    assert report(down, satellite=0) is None


def test_the_limit_of_the_range_check(lift_off: xarray.Dataset) -> None:
    assert range_limit_m(lift_off) == pytest.approx(3 * 8.85, abs=0.01)  # [SASLIB], uncorrected


def test_the_digest_is_of_values_alone(lift_off: xarray.Dataset, tmp_path: Path) -> None:
    again = open_results(made(tmp_path / "again", "liftoff_sudden", *LIFT_OFF)).dataset
    assert results_digest(again) == results_digest(lift_off)
    changed = lift_off.copy(deep=True)
    changed["time_s"].values[7] += 1e-9
    assert results_digest(changed) != results_digest(lift_off)
    assert results_digest(lift_off.drop_vars("time_s")) != results_digest(lift_off)


def test_the_digest_written_out() -> None:
    values = np.array([1.0, 2.0])
    results = xarray.Dataset({"b": ("x", values), "a": ("y", np.array(["ü"]))})
    text = b"a <U1 (1,)\n" + "ü".encode("utf-32-le") + b"b float64 (2,)\n" + values.tobytes()
    assert results_digest(results) == hashlib.sha256(text).hexdigest()
