"""Readers of scenarios and of results: TOML, settings, tables, stores. Most of it vestige wrote, and disks spoil it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import xarray

from fuzz.authority import files_of
from fuzz.engine import Files, Special, Target, WrongAcceptanceError, spoil_files
from fuzz.mutation import NUMBERS, WRONG_VALUES, json_of, spoil_tree, toml_value
from report_builder import made, threat_folder
from toy_plan import ToyPlan
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.run import run
from vestige.campaign.run_outcome import RunOutcome
from vestige.campaign.store.results import open_results
from vestige.campaign.store.store import kept_chunk_epochs, open_store
from vestige.campaign.store.store_skeleton import PROGRESS, WORK, work_digest
from vestige.campaign.sweep.sweep import _check_folder as check_folder
from vestige.campaign.sweep.sweep_axes import grid, parse_axis, store_name
from vestige.plots.curves.sweep import read_sweep
from vestige.receiver.errors.empirical_ionosphere import IONOSPHERE_COLUMN, read_residuals
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.recording.numeric_csv import WAYPOINTS
from vestige.report import Page, is_report, run_page, threat_page, write_page
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.warnings import scenario_warnings
from vestige.spoofer.profile_table import read_profile_table
from vestige.threats.runs import RUNS, read_runs, write_runs
from vestige.threats.table import STORE, read_threat_dataset
from vestige.time import GalileoTime

_SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"

# --- scenarios


def _scenarios() -> Sequence[Files]:
    """Each scenario; the settings that go with it; files that it names."""
    found: list[Files] = [
        {"scenario.toml": path.read_bytes(), "settings.txt": b"seed=2\n"} for path in sorted(_SCENARIOS.glob("*.toml"))
    ]
    settings = (
        'receiver.ionosphere={kind="empirical",path="residuals.csv"}\nreceiver.multipath=none\nepochs=20\n'
        'attack.0.delay_m={kind="table",path="profile.csv"}\nconstellation={kind="rinex",path="day.rnx"}\n'
        'trajectory={kind="waypoints",path="waypoints.csv"}\nline_of_sight=none\nposition={}\n'
    )
    liftoff = {"scenario.toml": (_SCENARIOS / "liftoff.toml").read_bytes(), "settings.txt": settings.encode()}
    toe = GalileoTime.parse("2026-11-21T12:00:00 GST")
    waypoints = f"{','.join(WAYPOINTS)}\n-100,48.1,11.6,500\n100,48.1001,11.6,500\n".encode()
    sky = files_of(lambda folder: write_rinex_navigation(folder / "day.rnx", walker_ephemerides(toe)))
    return [*found, liftoff | sky | {"waypoints.csv": waypoints} | _RESIDUALS | _PROFILE]


_RESIDUALS = {"residuals.csv": f"{IONOSPHERE_COLUMN}\n1.5\n-0.25\n0.75\n".encode()}
_PROFILE = {"profile.csv": b"time_s,value\n# a remark\n0,1.5\n10,2e1\n"}


def _spoil_scenario(rng: Random, files: Files) -> Files:
    """Spoil files; or set a key to something, with `--set`."""
    data, settings = files["scenario.toml"], files["settings.txt"]
    assert isinstance(data, bytes)
    assert isinstance(settings, bytes)
    if rng.random() < 0.4:
        return spoil_files(rng, files)
    keys = _keys(tomllib.loads(data.decode()))
    values = (*NUMBERS, *(toml_value(value) for value in WRONG_VALUES))
    lines = [
        f"{rng.choice((*keys, *keys, rng.choice(_KEYS)))}={rng.choice(values)}" for _ in range(rng.choice((1, 1, 2)))
    ]
    return dict(files) | {"settings.txt": settings + "\n".join(lines).encode("utf-8", "surrogatepass")}


def _keys(tables: Any, prefix: str = "") -> list[str]:
    """Return the dotted names of all keys of tables."""
    places = tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ()
    return [name for key, value in places for name in (f"{prefix}{key}", *_keys(value, f"{prefix}{key}."))]


_KEYS = (
    "seed", "epochs", "interval_s", "start", "attack", "attack.0", "attack.0.kind", "attack.9.kind", "receiver", "",
    "receiver.clock.kind", "constellation.svids", "recs.every", "processor.level", "x", "a" + ".a" * 3000, "kind", ".",
    "receiver.multipath", "receiver.ionosphere", "trajectory", "line_of_sight.v_mps", "\x1b[31m", "attack.-1.kind",
)  # fmt: skip


def _read_scenario(folder: Path) -> None:
    """What is taken can be written again, and its scenario_warnings are lines."""
    settings = (folder / "settings.txt").read_bytes().decode("utf-8", "surrogateescape").splitlines()
    scenario = load_scenario(folder / "scenario.toml", settings)
    json.loads(scenario.model_dump_json())
    if isinstance(scenario, CampaignScenario) and any(
        len(line.splitlines()) != 1 for line in scenario_warnings(scenario)
    ):
        raise WrongAcceptanceError("a warning that is not one line")


def _tables() -> Sequence[Files]:
    return [_RESIDUALS | _PROFILE]


def _read_tables(folder: Path) -> None:
    if not np.isfinite(read_residuals(folder / "residuals.csv")).all():
        raise WrongAcceptanceError("residuals that are not finite")
    times_s, values = read_profile_table(folder / "profile.csv")
    if not (np.isfinite(values).all() and np.all(np.diff(times_s) > 0)):
        raise WrongAcceptanceError("a profile that is not finite, or in no order")


def _axes() -> Sequence[Files]:
    return [{"axes.txt": b"receiver.cn0_dbhz=28:32:1\n"}, {"axes.txt": b'seed=1,2\nfidelity="samples","correlators"\n'}]


def _read_axes(folder: Path) -> None:
    lines = (folder / "axes.txt").read_bytes().decode("utf-8", "surrogateescape").splitlines()
    for settings in grid([parse_axis(line) for line in lines]):
        if "/" in store_name(settings):
            raise WrongAcceptanceError(f"{settings} is no name of a file")


# --- results

_STORE = "run.zarr"
_LOST = ("taps/zarr.json", "svid/c/0")


def _stores() -> Sequence[Files]:
    """A finished run, and one that lacks its last chunk."""
    whole = files_of(lambda folder: run(ToyPlan(n_epochs=6), folder / _STORE, chunk_epochs=3))
    return [whole, {name: data for name, data in whole.items() if not name.endswith("digest/c/1")}]


@cache
def _true_values() -> Mapping[str, np.ndarray]:
    return {str(name): column.values for name, column in direct_results(ToyPlan(n_epochs=6)).data_vars.items()}


def _read_store(folder: Path) -> None:
    kept_chunk_epochs(folder / _STORE, 3)
    _check_values(folder / _STORE)


def _damaged_stores() -> Sequence[Files]:
    """A finished run that lost metadata, and one that lost a label."""
    (whole, _) = _stores()
    return [{name: data for name, data in whole.items() if name != f"{_STORE}/{lost}"} for lost in _LOST]


def _read_again(folder: Path) -> None:
    """The same run goes on from what there is, and mends it, or refuses."""
    open_store(folder / _STORE, ToyPlan(n_epochs=6), chunk_epochs=3)
    _check_values(folder / _STORE)


def _check_values(path: Path) -> None:
    """Epochs that count have the values that were written."""
    results = open_results(path, partial=True, damaged="leave out").load()
    for name, true in _true_values().items():
        found = results.dataset[name]
        if not np.array_equal(found.values, np.take(true, results.epochs, found.dims.index("epoch")), equal_nan=True):
            raise WrongAcceptanceError(f"{name} has other values than those that were written")


def _reports() -> Sequence[Files]:
    def write(folder: Path) -> None:
        made(folder / _STORE, "quick", "epochs=8")

    return [files_of(write)]


def _read_report(folder: Path) -> None:
    """A page about a run."""
    results = open_results(folder / _STORE, partial=True, damaged="leave out")
    run_page(results.dataset.load(), "run")


def _spoil_report(rng: Random, files: Files) -> Files:
    """Spoil what a store says of itself and repair the digests of it, so that it is believed; or spoil any file."""
    root, progress = f"{_STORE}/{_METADATA}", f"{_STORE}/{PROGRESS}/{_METADATA}"
    group, own = (json.loads(_bytes(files[name])) for name in (root, progress))
    if rng.random() < 0.2:
        return spoil_files(rng, files)
    attributes = group["attributes"]
    if rng.random() < 0.7:
        attributes["scenario"] = json_of(spoil_tree(rng, json.loads(attributes["scenario"]))).decode()
    else:
        name = rng.choice(sorted(attributes))
        attributes[name] = rng.choice(WRONG_VALUES)
    if isinstance(attributes["scenario"], str):
        attributes["scenario_digest"] = hashlib.sha256(attributes["scenario"].encode()).hexdigest()
    with contextlib.suppress(ValueError, RecursionError):  # what is no JSON has no digest
        own["attributes"][WORK] = work_digest(json.loads(json_of(attributes)))
    return dict(files) | {root: json_of(group), progress: json_of(own)}


_METADATA = "zarr.json"


def _bytes(content: bytes | Special) -> bytes:
    assert isinstance(content, bytes)
    return content


def _threat_folders() -> Sequence[Files]:
    key = ("A1", "one", "1", "1", "1", "abc")
    outcome = RunOutcome(
        duration_s=600.0, alarms=3, budget_alarms=0.5, budget_range_alarms=0.4, failures=0, budget_failures=0.1,
        exact_failures=0, budget_exact_failures=0.05, range_failures=0, budget_range_failures=0.4, detected=True,
        mitigated=True, protected=True, missed=False, denied=False, time_to_detect_s=90.0, checks="C/N0 2; RAIM 30",
        budgets="C/N0 2 0.5; RAIM 1 0.02", worst_range_m=28.3, worst_position_m=1.0,
    )  # fmt: skip
    other = {"scene": "two", "expected_level_1": "miss", "note": "é; <b>", "time_to_detect_s": ""}
    table = xarray.Dataset(
        {"detected": (("scene", "level"), np.ones((2, 3)))},
        coords={"level": [1, 2, 3], "scene": ("scene", np.array(["one", "two"], dtype=np.dtypes.StringDType()))},
    )

    def write(folder: Path) -> None:
        threat_folder(folder, {}, other)
        write_runs(folder / RUNS, {key: outcome, (*key[:2], "2", *key[3:]): outcome})
        table.to_zarr(folder / STORE, consolidated=False)

    return [files_of(write)]


def _threat_stores() -> Sequence[Files]:
    return [{name: data for name, data in files.items() if name.startswith(STORE)} for files in _threat_folders()]


def _read_threats(folder: Path) -> None:
    threat_page(folder / "threats.csv", "threats")
    runs = read_runs(folder / RUNS)
    write_runs(folder / "again.csv", runs)
    if repr(read_runs(folder / "again.csv")) != repr(runs):
        raise WrongAcceptanceError("runs are not what was read of them")


def _read_threat_store(folder: Path) -> None:
    read_threat_dataset(folder)


def _sweeps() -> Sequence[Files]:
    rows = "receiver.multipath,cn0_dbhz,integration_s,p_fa,trials,detections_early,false_alarm_trials,false_alarms\n"
    rows += "".join(f"none,{cn0},0.016,1e-7,1000,{10 * cn0},5000,{cn0 % 3}\n" for cn0 in range(28, 33))
    page = Page(title="a", question="b", body=(), version="1")
    return [files_of(lambda folder: write_page(page, folder / "old.html")) | {"sweep.csv": rows.encode()}]


def _read_sweeps(folder: Path) -> None:
    is_report(folder / "old.html")
    check_folder(folder, {"receiver.multipath"})
    read_sweep(folder / "sweep.csv")


TARGETS = (
    Target(name="scenario", make=_scenarios, read=_read_scenario, spoil=_spoil_scenario, share=60),
    Target(name="scenario-tables", make=_tables, read=_read_tables, share=30),
    Target(name="sweep-axes", make=_axes, read=_read_axes, share=30),
    Target(name="store", make=_stores, read=_read_store, share=4),
    Target(name="store-again", make=_damaged_stores, read=_read_again, share=3),
    Target(name="report", make=_reports, read=_read_report, spoil=_spoil_report, share=2),
    Target(name="threats", make=_threat_folders, read=_read_threats, share=30),
    Target(name="threat-store", make=_threat_stores, read=_read_threat_store, share=3),
    Target(name="sweep", make=_sweeps, read=_read_sweeps, share=30),
)
