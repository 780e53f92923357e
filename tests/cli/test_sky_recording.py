"""A whole sky as a recording: `vestige process` says of its files what `vestige run` says of the same epochs."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from vestige.campaign.execution.direct import results_of
from vestige.campaign.plan import judged
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.cli.recordings.inspect import command as inspect
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.services.osnma import verify_command
from vestige.recording.doctor import e1_signals
from vestige.records import Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
AT = 50  # epoch of the RECS
NEXT = 60  # epoch of the next RECS
# four satellites, so that there is a fix; at 6.2 MHz, for the sake of time
SETTINGS = (
    "receiver.sample_rate_hz=6.2e6", "constellation.svids=[7, 8, 13, 14]", "recs.every=10", 'fidelity="samples"',
)  # fmt: skip
ATTACKS = {
    "honest": "[]",
    "A1": '[{kind="e1-asynchronous", start_s=20, delay_m=300000.0, power_db=10}]',
    "A3": '[{kind="meaconing", start_s=20, delay_s=1e-6, power_db=6}]',
    "A5": '[{kind="lift-off", start_s=5, bands=["E6"], delay_m=75, power_db=4.5}]',
    "A8": '[{kind="jamming", start_s=20, j_over_n_db=15, bands=["E6"], waveform={kind="chirp", bandwidth_hz=4e6}}]',
    "A12": '[{kind="position-push", svids=[7, 13], bands=["E1"], start_s=10, power_db=6, '
    'delay_m={kind="ramp", first=0, last=300, start_s=12, stop_s=45}}]',
}  # fmt: skip

# What `vestige run` says at levels 1, 2 and 3. Level 1 sees the repeater of A3 by the true signal of E6, which is 300 m
# earlier. It does not see the late signal of A5, which is not in use.
SAID = {
    "honest": (["AUTHENTIC"], ["AUTHENTIC"], ["AUTHENTIC"]),
    "A1": (["NOT_DETECTED"], ["SPOOFED"], ["SPOOFED"]),
    "A3": (["SPOOFED"], ["SPOOFED"], ["SPOOFED"]),
    "A5": (["AUTHENTIC"], ["SPOOFED"], ["SPOOFED"]),
    "A8": (["NOT_DETECTED"], ["NOT_DETECTED"], ["NOT_DETECTED"]),
    "A12": (["AUTHENTIC", "SPOOFED"], ["SPOOFED", "SUSPECT"], ["SPOOFED", "SUSPECT"]),
}
# A quiet recorder sends both bands again 5 ms later, and nulls the true signals in both.
REPLAY = (
    '[{kind="meaconing", delay_s=5e-3, power_db=3, reception_gain_db=20}, '
    '{kind="nulling", gain_db=-0.5, phase_error_rad=0.07, bands=["E1", "E6"]}]'
)
# Checks that compare with earlier epochs, or with levels that have to be learned. The recording holds one RECS.
NEED_A_PAST = {"E1 received power", "E6 received power", "C/N0", "E6 C/N0", "clock slope"}


def written(command: click.Command, *arguments: object) -> str:
    result = CliRunner().invoke(command, [str(one) for one in arguments], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout


def recorded(folder: Path, attack: str, n_epochs: int = 2, first: int = AT) -> Path:
    settings = [item for one in (*SETTINGS, f"attack={attack}") for item in ("--set", one)]
    written(simulate, NIGHT, "-o", folder / "sky", "--epochs", f"{first}:{first + n_epochs}", *settings)
    return folder / "sky"


@dataclass(frozen=True)
class Said:
    """What was said of a satellite: its verdict, the checks that were run and those that failed, the range offset."""

    status: str
    run: frozenset[str]
    failed: frozenset[str]
    range_offset_m: float


def plan_of(attack: str, level: int) -> ScenarioPlan:
    scenario = load_scenario(NIGHT, (*SETTINGS, f"attack={attack}", f"processor.level={level}", f"epochs={NEXT + 1}"))
    assert isinstance(scenario, CampaignScenario)
    return ScenarioPlan(scenario=scenario)


@cache
def measured(attack: str) -> dict[str, np.ndarray]:
    """Return what the receiver measured, on which every level judges: level 3 asks for the most."""
    plan = plan_of(attack, 3)
    return dict(plan.measure(0, plan.prepare().advance(0, plan.n_epochs)))


def said_by_run(attack: str, level: int, epoch: int = AT) -> dict[int, Said]:
    plan = plan_of(attack, level)
    _, columns = judged(plan, None, 0, dict(measured(attack)))
    results = results_of(plan, columns)
    names, result = results["check"].values, results["check_result"].values[:, epoch]
    offset_m = results["range_offset_m"].sel(detector="early").values[epoch]
    return {
        svid: Said(
            status=list(Status)[results["status"].values[epoch, column]].name,
            run=frozenset(map(str, names[result[:, column] >= 0])),
            failed=frozenset(map(str, names[result[:, column] == 1])),
            range_offset_m=float(offset_m[column]),
        )
        for column, svid in enumerate(results["svid"].values.tolist())
    }


def said_by_process(folder: Path, level: int, *options: object) -> list[dict[int, Said]]:
    """Return what `vestige process` says of each RECS in turn, by SVID."""
    words = [*options, "--level", level, "--navigation", folder / "rinex" / "navigation.rnx"]
    words += ["--search-window", "1e-4", "--search-ms", "16"] if level > 1 else []
    found: dict[int, dict[int, Said]] = {}
    for one in json.loads(written(process, folder, "--json", *words))["verdicts"]:
        found.setdefault(one["snapshot"], {})[one["svid"]] = Said(
            status=one["status"],
            run=frozenset(check["name"] for check in one["checks"] if check["outcome"] != "NOT_RUN"),
            failed=frozenset(check["name"] for check in one["checks"] if check["outcome"] == "FAIL"),
            range_offset_m=math.nan if one["range_offset_m"] is None else one["range_offset_m"],
        )
    return [found[snapshot] for snapshot in sorted(found)]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return the recording of a case, which is written once for all levels."""
    return cache(lambda name: recorded(tmp_path_factory.mktemp(name), ATTACKS[name]))


@pytest.mark.slow  # the quick test of this comparison, on a line of sight, is in test_simulate_and_run
@pytest.mark.parametrize(
    ("name", "level"),
    [(name, level) for name in ATTACKS for level in (1, 2, 3)],
)
def test_process_says_what_run_says(folders: Callable[[str], Path], name: str, level: int) -> None:
    """Every satellite of one RECS, honest and under attack: the samples are the same, but for int8 in the recording.

    Only a check that the recording has too little past for can make `run` suspicious where `process` is not.
    """
    (of_files,) = said_by_process(folders(name), level)
    simulated = said_by_run(ATTACKS[name], level)
    assert sorted({one.status for one in simulated.values()}) == SAID[name][level - 1]
    # quantised to 20 levels a unit of noise: 0.02 m (1σ) or so, measured
    assert_same(of_files, simulated, within_m=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("epoch", [20, 30, 40])
def test_the_ranges_are_the_same_while_a12_pulls(tmp_path: Path, epoch: int) -> None:
    """The delay grows by 9.1 m/s. In the 86 ms before the observation, or in the travel time, it grows by 0.78 m."""
    folder = recorded(tmp_path, ATTACKS["A12"], first=epoch)
    for level in (1, 3):
        (of_files,) = said_by_process(folder, level)
        simulated = said_by_run(ATTACKS["A12"], level, epoch)
        assert {svid for svid, one in simulated.items() if one.status == "SPOOFED"} == {7, 13}
        assert_same(of_files, simulated, within_m=0.1)


def assert_same(of_files: dict[int, Said], simulated: dict[int, Said], within_m: float) -> None:
    """Compare the verdicts of a recording with those of a campaign."""
    assert of_files.keys() == simulated.keys()
    for svid, one in simulated.items():
        other = of_files[svid]
        assert other.failed == one.failed & other.run, svid
        if one.status != other.status:
            assert (one.status, other.status) == ("SUSPECT", "AUTHENTIC"), svid
            assert one.failed
            assert one.failed <= NEED_A_PAST - other.run
        assert other.range_offset_m == pytest.approx(one.range_offset_m, abs=within_m, nan_ok=True), svid


@pytest.fixture(scope="module")
def trusted(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[Path, Path]]:
    """Return a recording with two RECS, and its Merkle tree, which lies elsewhere: nothing in the folder is trusted."""

    @cache
    def made(name: str) -> tuple[Path, Path]:
        # tracking takes two seconds before the first RECS
        folder = recorded(tmp_path_factory.mktemp(name), ATTACKS[name], NEXT + 2 - (AT - 2), AT - 2)
        tree = (folder / "assistance" / "merkle_tree.xml").rename(folder.parent / "tree.xml")
        for key in folder.glob("assistance/public_key.*"):
            key.unlink()
        return folder, tree

    return made


@pytest.mark.slow
@pytest.mark.parametrize("tracked", [False, True])
@pytest.mark.parametrize("name", ["honest", "A12"])
def test_two_recs_with_a_trust_anchor(trusted: Callable[[str], tuple[Path, Path]], name: str, tracked: bool) -> None:
    """With `--merkle-tree`, and with E1 of the observations or of the samples, each RECS has the verdicts of `run`.

    E1 that is tracked from samples has another noise than the E1 observations of the campaign. The true signals, 300 m
    earlier than those of A12, pull the tracked ranges by 3 m or so, measured.
    """
    folder, tree = trusted(name)
    options = ("--merkle-tree", tree, *(("--track",) if tracked else ()))
    of_files = said_by_process(folder, 1, *options)
    assert len(of_files) == 2
    for epoch, one in zip((AT, NEXT), of_files, strict=True):
        simulated = said_by_run(ATTACKS[name], 1, epoch)
        assert sorted({said.status for said in simulated.values()}) == SAID[name][0]
        assert_same(one, simulated, within_m=6.0 if tracked else 0.1)


def test_a_recording_of_one_epoch_has_a_verdict(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its observation file has one epoch; each public key of its assistance is named once."""
    monkeypatch.setattr(e1_signals, "SVIDS", (7, 9))  # tests/unit/recording/doctor looks for all
    written(
        simulate, NIGHT, "-o", tmp_path / "sky", "--epochs", f"{AT}:{AT + 1}", *(f"--set={one}" for one in SETTINGS)
    )
    found = json.loads(written(process, tmp_path / "sky", "--json"))["verdicts"]
    assert [one["status"] for one in found] == ["AUTHENTIC"] * 4
    text = written(inspect, tmp_path / "sky")
    assert text.count("public key PKID 1") == 1
    assert text.count("    public_key.xml: the same key as in public_key.pem") == 1
    assert text.count("    merkle_tree.xml: the same key as in public_key.pem") == 1


@pytest.mark.slow
def test_a_recorded_replay_fails_the_clock_limit_and_nothing_else(tmp_path: Path) -> None:
    """The check is the only one that sees it: with a limit above the delay all satellites are AUTHENTIC."""
    folder = recorded(tmp_path, REPLAY, 1)
    words = ("--json", "--level", 2, "--navigation", folder / "rinex" / "navigation.rnx", "--search-window", 1e-4)
    for limit_s, status, outcome in ((1e-3, "SUSPECT", "FAIL"), (1e-2, "AUTHENTIC", "PASS")):
        verdicts = json.loads(written(process, folder, *words, "--time-uncertainty", limit_s))["verdicts"]
        assert [one["status"] for one in verdicts] == [status] * 4
        for one in verdicts:
            checks = {check["name"]: check for check in one["checks"]}
            assert checks["clock limit"]["outcome"] == outcome
            assert checks["clock limit"]["statistic"] == pytest.approx(5e-3, abs=1e-6)
            assert limit_s + 1.7e-6 < checks["clock limit"]["threshold"] < limit_s + 3e-6
            others = {check["outcome"] for name, check in checks.items() if name != "clock limit"}
            assert others == {"PASS", "NOT_RUN"}


def test_a_sky_gives_a_position_and_a_message(folders: Callable[[str], Path]) -> None:
    folder = folders("honest")
    orbits = folder / "rinex" / "navigation.rnx"
    (position,) = json.loads(written(process, folder, "--level", 2, "--navigation", orbits, "--json"))["positions"]
    assert position["latitude_deg"] == pytest.approx(48.1, abs=5e-4)
    assert position["longitude_deg"] == pytest.approx(11.6, abs=5e-4)
    tree = folder / "assistance" / "merkle_tree.xml"
    report = json.loads(written(verify_command, folder / "inav_pages.csv", "--merkle-tree", tree, "--json"))
    assert report["tags"]["0"]["failed"] == 0
    assert report["tags"]["0"]["ok"] > 100
