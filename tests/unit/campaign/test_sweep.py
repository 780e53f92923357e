from __future__ import annotations

import csv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sky_builder import sky_scenario
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.range_errors import window_of, worst_range_m
from vestige.campaign.run import RunProgress
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_interval
from vestige.campaign.store.results import open_results
from vestige.campaign.sweep.sweep import SWEEP_TABLE, Row, Width, run_sweep
from vestige.cli.campaigns.campaign_report import sweep_table
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.theory.thresholds import probability_of_detection
from vestige.threats.matrix import measure_scenes

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
EPOCHS, CHUNK = 1500, 250


def scenario(*settings: str) -> CampaignScenario:
    loaded = load_scenario(QUICK, (f"epochs={EPOCHS}", "processor.p_fa=1e-4", *settings))
    assert isinstance(loaded, CampaignScenario)
    return loaded


CAMPAIGNS = [({"receiver.cn0_dbhz": value}, scenario(f"receiver.cn0_dbhz={value}")) for value in (27, 29, 36)]


def swept(folder: Path, width: Width | None = None, **how: Any) -> list[Row]:
    folder.mkdir(exist_ok=True)
    return list(run_sweep(CAMPAIGNS, folder, width=width, **{"chunk_epochs": CHUNK, **how}))


def files(folder: Path) -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Row]]:
    folder = tmp_path_factory.mktemp("whole")
    return folder, swept(folder)


def test_a_row_is_what_its_campaign_says(whole: tuple[Path, list[Row]]) -> None:
    folder, rows = whole
    for (_, one), row in zip(CAMPAIGNS, rows, strict=True):
        alone = direct_results(ScenarioPlan(scenario=one))
        kept = open_results(folder / row.store).dataset
        assert all(alone[name].values.tobytes() == kept[name].values.tobytes() for name in alone.data_vars)
        detected = int((alone["tap_index"].sel(detector="early") >= 0).sum())
        found = row.detections["early"]
        assert (found.successes, found.trials, row.epochs) == (detected, EPOCHS, EPOCHS)
        assert (found.low, found.high) == binomial_interval(detected, EPOCHS)
        assert row.p_d_theory == probability_of_detection(row.cn0_dbhz, 0.016, 1e-4)


def test_the_table_has_the_rows(whole: tuple[Path, list[Row]]) -> None:
    folder, rows = whole
    with (folder / SWEEP_TABLE).open() as file:
        table = list(csv.DictReader(file))
    for row, cells in zip(rows, table, strict=True):
        assert float(cells["cn0_dbhz"]) == float(cells["receiver.cn0_dbhz"]) == row.cn0_dbhz
        assert int(cells["detections_maximum"]) == row.detections["maximum"].successes
        assert float(cells["high_early"]) == row.detections["early"].high
        assert (folder / cells["store"]).is_dir()


@pytest.mark.slow
def test_a_row_of_an_attack_says_what_came_of_it_at_the_level(tmp_path: Path) -> None:
    """A copy on both bands, 600 m late, 6 dB over the true signal: level 1 takes it, level 2 sees it at once."""
    attack = 'attack=[{kind="meaconing", start_s=120, delay_s=2e-6, power_db=6.0, acquired=true}]'
    campaigns = [
        ({"processor.level": level}, sky_scenario(attack, "epochs=240", f"processor.level={level}")) for level in (1, 2)
    ]
    rows = list(run_sweep(campaigns, tmp_path, chunk_epochs=CHUNK))
    first, second = (row.outcome for row in rows)
    assert first is not None
    assert second is not None
    assert (first.word, first.detected, first.worst_range_m) == ("missed", False, pytest.approx(600, abs=5))
    assert (second.detected, second.missed, second.time_to_detect_s) == (True, False, 0.0)
    for (_, scenario), row in zip(campaigns, rows, strict=True):
        all_columns = scenario.processor.model_copy(update={"level": 3})
        threat = measure_scenes(scenario.replaced(processor=all_columns), window_of(scenario))
        assert repr(row.outcome) == repr(threat[row.level - 1])  # NaN is not equal to itself
        assert repr(worst_range_m(open_results(tmp_path / row.store).dataset)) == repr(row.outcome.worst_range_m)
    with (tmp_path / SWEEP_TABLE).open() as file:
        table = list(csv.DictReader(file))
    assert [(cells["level"], cells["word"], cells["detected"]) for cells in table] == [
        ("1", "missed", "0"), ("2", second.word, "1"),
    ]  # fmt: skip
    assert float(table[0]["worst_range_m"]) == first.worst_range_m
    assert table[1]["time_to_detect_s"] == "0.0"
    text = sweep_table(rows, tmp_path / SWEEP_TABLE).splitlines()
    assert "outcome" in text[0]
    assert text[1].split()[:4] == ["1", "1", "missed", "none"]
    assert "after 0 s" in text[2]


def test_a_row_without_attack_or_cut_short_has_no_outcome(whole: tuple[Path, list[Row]], tmp_path: Path) -> None:
    assert {row.outcome for row in whole[1]} == {None}
    attack = 'attack=[{kind="meaconing", start_s=0, delay_s=2e-6, power_db=6.0}]'
    campaigns = [({"seed": 0}, scenario(attack, "receiver.cn0_e1_dbhz=45"))]
    (row,) = run_sweep(campaigns, tmp_path, chunk_epochs=CHUNK, width=Width(width=0.5))
    assert (row.epochs, row.outcome) == (CHUNK, None)


# tests/cli/test_run.py has a quick campaign that ends by a relative width
@pytest.mark.parametrize(
    "width", [Width(width=0.085), pytest.param(Width(width=0.5, relative=True), marks=pytest.mark.slow)]
)
def test_a_campaign_ends_with_the_first_chunk_that_is_enough(
    tmp_path: Path, width: Width, whole: tuple[Path, list[Row]]
) -> None:
    folder, rows = whole[0], swept(tmp_path / "a", width)
    assert [row.epochs for row in rows] != [EPOCHS] * 3
    for row in rows:
        detected = open_results(folder / row.store).dataset["tap_index"].sel(detector="early").values >= 0
        counts = [(int(detected[:n].sum()), n) for n in range(CHUNK, EPOCHS + 1, CHUNK)]

        def narrow(hits: int, trials: int) -> bool:
            low, high = binomial_interval(hits, trials)
            rarer = min(hits, trials - hits) / trials
            return high - low <= width.width * (rarer if width.relative else 1) and (rarer > 0 or not width.relative)

        expected = next((n for hits, n in counts if narrow(hits, n)), EPOCHS)
        assert (row.epochs, row.detections["early"].trials) == (expected, expected)
        assert row.detections["early"].successes == counts[expected // CHUNK - 1][0]


@pytest.mark.slow
def test_nothing_depends_on_workers_or_interruptions(tmp_path: Path) -> None:
    """Ended early, by two threads, by someone else's executor, and stopped in the second campaign and resumed."""
    width = Width(width=0.085)
    expected = swept(tmp_path / "one", width)
    assert swept(tmp_path / "two", width, workers=2) == expected
    with ThreadPoolExecutor(3) as pool:
        assert swept(tmp_path / "three", width, workers=3, executor=pool) == expected

    def stop(name: str, progress: RunProgress) -> None:
        if "29" in name and progress.epochs_done == 2 * CHUNK:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path / "again", width, progress=stop)
    assert swept(tmp_path / "again", width) == expected
    for other in ("two", "three", "again"):
        assert files(tmp_path / other) == files(tmp_path / "one")


@pytest.mark.slow
def test_a_narrower_width_goes_on_and_a_wider_one_counts_less(tmp_path: Path) -> None:
    wide = swept(tmp_path / "a", Width(width=0.14))
    narrow = swept(tmp_path / "a", Width(width=0.07))
    assert [row.epochs for row in narrow] > [row.epochs for row in wide]
    assert narrow == swept(tmp_path / "b", Width(width=0.07))
    assert swept(tmp_path / "a", Width(width=0.14)) == wide


def test_relative_width_needs_both_outcomes() -> None:
    assert not Width(width=10.0, relative=True).reached(0, 1000)
    assert not Width(width=10.0, relative=True).reached(1000, 1000)
    assert not Width(width=0.01).reached(0, 0)
    assert Width(width=0.01).reached(1000, 1000)


def test_without_signal_every_detection_is_a_false_alarm(tmp_path: Path) -> None:
    """P_fa 1e-2 on the three taps of eleven that are a chip apart; binomial limits at 1e-6."""
    silent = scenario("receiver.signal=false", "processor.p_fa=1e-2")
    (row,) = run_sweep([({"receiver.signal": False}, silent)], tmp_path)
    assert row.false_alarms.trials == 3 * EPOCHS
    low, high = binomial_interval(row.false_alarms.successes, 3 * EPOCHS, confidence=1 - 1e-6)
    assert low < 0.01 < high
    assert np.isnan(row.p_d_theory)
    assert "detections" not in (tmp_path / SWEEP_TABLE).read_text()
