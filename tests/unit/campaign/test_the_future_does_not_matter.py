"""A receiver knows nothing of later epochs: a run is the beginning of every longer run of the same scenario."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import columns_of, sky_scenario
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.records.checks import CheckName

PUSH = 'attack=[{kind="position-push", svids=[7, 13], start_s=20, power_db=6, delay_m=90}]'
HALF_DAY = ("interval_s=60.0", "recs.every=1")  # five of eight satellites set


@pytest.mark.parametrize(
    ("settings", "whole", "parts"),
    [
        (("recs.every=5",), 300, (1, 31, 150)),
        (("recs.every=5", PUSH), 90, (40, 60)),
        (HALF_DAY, 720, (1, 60, 240)),
    ],
    ids=["an hour's sky", "attacked", "half a day"],
)
def test_a_run_is_the_beginning_of_a_longer_one(settings: tuple[str, ...], whole: int, parts: tuple[int, ...]) -> None:
    """All columns have the same bits: what is measured, what the processor says, and the truth."""
    settings = ("processor.level=3", "constellation.svids=[6, 7, 8, 12, 13, 14, 23, 24]", *settings)
    longer = sky_scenario(*settings, f"epochs={whole}")
    columns, dims = columns_of(longer), {name: one.dims for name, one in ScenarioPlan(scenario=longer).columns.items()}
    for epochs in parts:
        for name, values in columns_of(sky_scenario(*settings, f"epochs={epochs}")).items():
            first = np.take(columns[name], np.arange(epochs), axis=dims[name].index("epoch"))
            assert values.tobytes() == first.tobytes(), (epochs, name)


def cn0_check(name: CheckName, *settings: str) -> tuple[np.ndarray, np.ndarray]:
    """Return statistic and threshold of a check of C/N0 in the epochs in which it was run."""
    scenario = sky_scenario("processor.level=2", "epochs=120", "recs.every=5", *settings)
    columns, plan = columns_of(scenario), ScenarioPlan(scenario=scenario)
    place = plan.coords["check"].values.tolist().index(name)
    statistic, threshold = columns["check_statistic"][place], columns["check_threshold"][place]
    run = np.isfinite(statistic)
    assert run.any()
    return statistic[run], threshold[run]


@pytest.mark.parametrize(
    ("setting", "check"),
    [("expected_cn0_e1_dbhz=57", CheckName.E1_CN0), ("expected_cn0_e6_dbhz=33", CheckName.E6_CN0)],
)
def test_a_receiver_that_is_wrong_about_its_antenna_fails_its_check_of_cn0(setting: str, check: CheckName) -> None:
    """12 dB: more than the 8 dB that the check allows for on E1, and on E6 in the direction of too strong a signal."""
    statistic, threshold = cn0_check(check)
    assert np.all(np.abs(statistic) <= threshold)
    statistic, threshold = cn0_check(check, f"processor.{setting}")
    assert np.mean(np.abs(statistic) > threshold) > 0.8


def test_an_antenna_that_is_3_db_worse_than_expected_shows_as_3_db() -> None:
    """The check allows for 1.5 dB (1 sigma) of what nobody knows about an antenna: 3 dB alone raise no alarm."""
    known, threshold = cn0_check(CheckName.E1_CN0)
    wrong, same_threshold = cn0_check(CheckName.E1_CN0, "processor.expected_cn0_e1_dbhz=48")
    np.testing.assert_allclose(wrong, known - 3, atol=1e-4)
    assert threshold.tobytes() == same_threshold.tobytes()
    assert 7 < float(np.mean(threshold)) < 9
