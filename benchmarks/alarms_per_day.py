"""Measure the false alarms of level 1 with the setting `alarms_per_day`, and its cost in time to detect.

python benchmarks/alarms_per_day.py [--hours 1000] [--alarms-per-day 1] [--runs 40]

The scene is A0 harsh of the threat table: eight satellites of 32 to 40 dBHz on both bands, multipath of −15.8 dB, the
ionosphere of 2014, and a RECS each 30 s. Each hour is a separate campaign at fidelity `correlators`. Level 1 judges
the same results without and with the setting. Alarms are counted as a user sees them (`LevelVerdicts.begins`): an alarm
begins if no satellite had an alarm before, and is kept for 90 s. The upper limit is the upper end of the exact
one-sided 95 % interval of a Poisson count. A series of misses ends with its hour.

The second table is for two attacks: E6 is jammed, or E1 of the middle satellite is pulled away. The table has the time
from the start of the attack to the first alarm of any satellite, and to the first alarm of each attacked satellite.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import chdtri

from vestige.acas_processor.levels import is_alarm
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import LevelVerdicts, level_verdicts
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.campaign import CampaignScenario
from vestige.threats.scenes import read_threats, scene_scenario

RECS_S, HOUR_S = 30.0, 3600.0
START_S = 600.0
ATTACKS = {
    "E6 jammed, J/N 10 dB": {"kind": "jamming", "start_s": START_S, "j_over_n_db": 10.0, "bands": ["E6"]},
    "E6 jammed, J/N 3 dB": {"kind": "jamming", "start_s": START_S, "j_over_n_db": 3.0, "bands": ["E6"]},
}
PULLS_M = (20.0, 30.0, 35.0, 40.0, 60.0)
PULLED = 7


def harsh_scene(seed: int, *settings: str, attacks: Sequence[dict[str, object]] = ()) -> CampaignScenario:
    """Return an hour of A0 harsh with a RECS at every epoch, 30 s apart."""
    threat = next(one for one in read_threats() if one.id == "A0")
    scene = next(one for one in threat.scene if one.name == "harsh")
    often = (f"interval_s={RECS_S}", f"epochs={round(HOUR_S / RECS_S)}", "recs.every=1")
    return scene_scenario(threat, scene, seed, settings=(*often, *settings), attacks=tuple(attacks))


def judged_hours(scenario: CampaignScenario, alarms: Sequence[float | None]) -> Iterator[LevelVerdicts]:
    """Yield the verdicts of level 1 on a campaign for each setting of `alarms_per_day`."""
    results = direct_results(ScenarioPlan(scenario=scenario), judge=False)
    for one in alarms:
        yield level_verdicts(results, (1,), alarms_per_day=one)[0]


@dataclass
class Counts:
    """Count of the alarms of several hours."""

    alarms: int = 0
    hours: float = 0.0
    tests: int = 0
    failures: dict[str, int] = field(default_factory=dict)
    budget: dict[str, float] = field(default_factory=dict)

    def add(self, found: LevelVerdicts) -> None:
        """Add the alarms and the tests of an hour."""
        self.alarms += int(np.count_nonzero(found.begins))
        self.hours += HOUR_S / 3600
        self.tests += found.status.size
        for name, failed in found.failed.items():
            tests = int(np.count_nonzero(found.tests[name]))
            self.failures[name] = self.failures.get(name, 0) + int(np.count_nonzero(failed))
            self.budget[name] = self.budget.get(name, 0.0) + tests * found.budget[name].confirmed_p_fa

    @property
    def a_day(self) -> float:
        """Alarms a day."""
        return self.alarms / self.hours * 24

    @property
    def bound(self) -> float:
        """Upper limit of the alarms a day, one-sided 95 %."""
        return float(chdtri(2 * self.alarms + 2, 0.05)) / 2 / self.hours * 24


def first_alarms_s(found: LevelVerdicts) -> np.ndarray:
    """Return the time in s from the start of the attack to each satellite's first alarm; ∞ without an alarm."""
    time_s = RECS_S * np.arange(found.status.shape[0])
    alarm = is_alarm(found.status) & (time_s >= START_S)[:, None]
    return np.where(alarm.any(axis=0), time_s[np.argmax(alarm, axis=0)] - START_S, np.inf)


def span(times_s: np.ndarray) -> str:
    """Return median and 90 % quantile of times as text, and the share of finite times."""
    middle, late = np.quantile(times_s, [0.5, 0.9], method="higher")
    return f"{middle:.0f} ({late:.0f}), {np.mean(np.isfinite(times_s)):.0%}"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="seed of the first hour")
    parser.add_argument("--alarms-per-day", type=float, default=1.0)
    parser.add_argument("--runs", type=int, default=40, help="runs of each attack")
    options = parser.parse_args()
    settings: tuple[float | None, ...] = (None, options.alarms_per_day)
    names = ("none", f"alarms_per_day = {options.alarms_per_day:g}")
    counts = [Counts() for _ in settings]
    for seed in range(options.first, options.first + options.hours):
        for count, found in zip(counts, judged_hours(harsh_scene(seed), settings), strict=True):
            count.add(found)
    print("| setting | hours | RECS | alarms | a day | at most (95 %) | failures of budget |")
    print("|---|---|---|---|---|---|---|")
    for name, count in zip(names, counts, strict=True):
        reasons = "; ".join(f"{key} {value} of {count.budget[key]:.3g}" for key, value in count.failures.items())
        counted = f"{count.hours:.0f} | {count.tests} | {count.alarms} | {count.a_day:.2f} | {count.bound:.2f}"
        print(f"| {name} | {counted} | {reasons} |", flush=True)
    pulls = {
        f"E1 of one satellite pulled by {pull_m:g} m": {
            "kind": "position-push", "svids": [PULLED], "bands": ["E1"], "start_s": START_S, "power_db": 12.0,
            "delay_m": {"kind": "ramp", "first": 0.0, "last": pull_m, "start_s": START_S, "stop_s": START_S + 60.0},
        }
        for pull_m in PULLS_M
    }  # fmt: skip
    head = " | ".join(f"{name}: {what}" for name in names for what in ("any satellite", "each attacked satellite"))
    print(f"\nSeconds to the first alarm: median (90 %), share with an alarm within {HOUR_S - START_S:.0f} s\n")
    print(f"| attack | {head} |")
    print("|---" * (1 + 2 * len(names)) + "|")
    for attack, table in (ATTACKS | pulls).items():
        times: list[list[np.ndarray]] = [[] for _ in settings]
        for seed in range(options.runs):
            scenario = harsh_scene(10_000 + seed, attacks=(table,))
            for place, found in enumerate(judged_hours(scenario, settings)):
                svids = found.measured.snapshots.svids
                attacked = [svids.index(PULLED)] if "svids" in table else slice(None)
                times[place].append(first_alarms_s(found)[attacked])
        cells = [text for one in times for text in (span(np.min(one, axis=1)), span(np.concatenate(one)))]
        print(f"| {attack} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
