"""[WFO, Sec. VI-B] at levels 2 and 3 over 20 seeds: which check sees the zero-delay lift-off, when, and what is in use.

scenarios/liftoff_sudden.toml: the spoofing signal is on air from T = 500 s at −10 dB, on top of the true signal at 600
s, then rises to +4.5 dB by 720 s and leaves. A single line of sight: no position, no OSNMA of several satellites.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray

from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import LevelVerdicts, level_verdicts
from vestige.campaign.outcomes import report
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import proportion
from vestige.records import Status
from vestige.scenario.load import load_scenario

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "liftoff_sudden.toml"
SEEDS = range(600, 620)
BEFORE, APPROACH, RISE, AFTER = slice(0, 500), slice(500, 600), slice(600, 720), slice(1100, 1500)
ALARMED_BY_S = 720


@cache
def run_of(seed: int, bands: str, epochs: int = 1500) -> tuple[xarray.Dataset, dict[int, LevelVerdicts]]:
    """Return a run and its verdicts at levels 2 and 3. The run itself has level 2, which judges it in less time."""
    level = "processor.level=2"
    settings = ('fidelity="correlators"', level, f"seed={seed}", f"attack.0.bands={bands}", f"epochs={epochs}")
    results = direct_results(ScenarioPlan(scenario=load_scenario(SCENARIO, settings)))
    return results, {one.level: one for one in level_verdicts(results, (2, 3))}


def first(found: LevelVerdicts, name: str, part: slice) -> int:
    """Return the first second of a part in which a check failed, −1 if none."""
    failed = np.flatnonzero(found.failed[name][part].any(axis=1))
    return part.start + int(failed[0]) if failed.size else -1


@pytest.mark.judged(
    by="the paper",
    what="faster lift-off (liftoff_sudden.toml) at mitigation levels 2 and 3",
    figure="the check E6 power (E6 missed) fails first between 605 s and 650 s in every run",
)
@pytest.mark.parametrize("level", [2, 3])
def test_the_rise_is_detected_in_every_run(level: int) -> None:
    """E6 power detects the fading from 611 s on; E6 C/N0 detects signals that are too weak or too strong."""
    strength, power = [], []
    for seed in SEEDS:
        found = run_of(seed, '["E6"]')[1][level]
        strength.append(first(found, "E6 C/N0", RISE))
        power.append(first(found, "E6 power", RISE))
        assert found.alarm[ALARMED_BY_S:900].all()
    assert min(power) >= 605
    assert max(power) <= 650
    assert min(strength) >= 640
    assert 680 <= np.median(strength) <= 700
    assert max(strength) < ALARMED_BY_S


def test_before_the_rise_it_is_seen_by_chance_only_and_not_by_the_checks_of_level_2() -> None:
    """At −10 dB the spoofing signal resembles multipath, which has −15.8 dB in the mean in harsh conditions.

    It fades the true signal by 3.3 dB at the most, which E6 power misses more often than without it, in less than one
    RECS of a hundred; at 35 dBHz a miss by chance is one in a thousand. No other check of level 2 sees anything. Of 60
    seeds 0.7 % of the RECS are missed; 40 of them, 4000 RECS, tell it from 1.2 % by three sigma.
    """
    missed, seeds = dict.fromkeys(("before", "approach"), 0), range(SEEDS.start, SEEDS.start + 40)
    for seed in seeds:
        # The other tests do not use the seeds beyond SEEDS, so those runs end with the approach.
        found = (run_of(seed, '["E6"]') if seed in SEEDS else run_of(seed, '["E6"]', APPROACH.stop))[1][3]
        for name, failed in found.failed.items():
            if name == "E6 power":
                missed["before"] += int(np.count_nonzero(failed[BEFORE]))
                missed["approach"] += int(np.count_nonzero(failed[APPROACH]))
            else:
                assert not failed[: APPROACH.stop].any(), name
    quiet, approach = (
        proportion(missed[part], rows * len(seeds)) for part, rows in (("before", 500), ("approach", 100))
    )
    assert quiet.high < 2.5e-3
    assert quiet.high < approach.value
    assert approach.high < 1.2e-2


def test_when_it_has_left_the_earlier_signal_is_used_and_the_other_one_is_declared_spoofing() -> None:
    """[WFO, Sec. VI-B]: from 1100 s on the spoofing signal lies 75 m late, at the last correlator, 4.5 dB stronger.

    The weaker signal is the earlier one, so the stronger one is no ray of it: level 2 says SPOOFED with nearly every
    RECS (398 of 400 with the seed of the scenario). The earlier signal is where E1 says, so E1 stays in use.
    """
    for seed in SEEDS:
        results, verdicts = run_of(seed, '["E6"]')
        attack = report(results, "early")
        assert attack is not None
        assert 430 < attack.time_to_mitigate_s < 450
        status = verdicts[2].status[AFTER, 0]
        assert np.mean(status == list(Status).index(Status.SPOOFED)) > 0.97
        offset_m = results["range_offset_m"].sel(detector="early").values[AFTER, 0]
        assert np.mean(np.abs(offset_m[np.isfinite(offset_m)]) < 26.5) > 0.99
        assert verdicts[2].alarm[AFTER].all()
        error_m = verdicts[2].range_error_m[AFTER, 0]
        assert np.mean(np.isfinite(error_m)) > 0.95
        assert np.nanmax(np.abs(error_m)) < 53  # 2 κσ


def test_no_wrong_range_is_in_use_where_e1_is_left_alone() -> None:
    for seed in SEEDS:
        for found in run_of(seed, '["E6"]')[1].values():
            assert np.nanmax(np.abs(found.range_error_m)) < 53  # 2 κσ


def test_with_both_bands_every_wrong_range_that_is_in_use_is_counted() -> None:
    """E1 follows by up to 75 m. A range in use is AUTHENTIC or that of the earlier signal, and never far off."""
    for seed in SEEDS:
        results, verdicts = run_of(seed, '["E1", "E6"]')
        assert np.max(results["truth_e1_error_m"].values) > 60
        for found in verdicts.values():
            assert first(found, "E1-E6 range", slice(700, 1000)) > 0
            wrong = np.abs(np.nan_to_num(found.range_error_m)) > 53
            assert not wrong.any()


def test_what_needs_more_than_one_satellite_is_said_not_to_run() -> None:
    verdicts = run_of(600, '["E6"]')[1]
    assert set(verdicts[2].not_run) == {
        "clock innovation",
        "clock consistency",
        "clock slope",
        "RAIM",
        "solution separation",
    }
    assert {"OSNMA availability", "OSNMA reception", "inertial range rate"} < set(verdicts[3].not_run)
