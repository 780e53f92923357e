"""A whole sky as a recording: `vestige process` says of its files what `vestige run` says of the same epochs."""

from __future__ import annotations

import json
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.cli.recordings.inspect import command as inspect
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.services.osnma import verify_command
from vestige.records import Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
AT = 50  # epoch of the RECS
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

# a repeater of both bands is not seen, and the late counterfeit of A5 is not in use
SAID = {
    "honest": ["AUTHENTIC"],
    "A1": ["NOT_DETECTED"],
    "A3": ["AUTHENTIC"],
    "A5": ["AUTHENTIC"],
    "A8": ["NOT_DETECTED"],
    "A12": ["AUTHENTIC", "NOT_DETECTED"],
}


def written(command: click.Command, *arguments: object) -> str:
    result = CliRunner().invoke(command, [str(one) for one in arguments], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout


def recorded(folder: Path, attack: str) -> Path:
    settings = [item for one in (*SETTINGS, f"attack={attack}") for item in ("--set", one)]
    written(simulate, NIGHT, "-o", folder / "sky", "--epochs", f"{AT}:{AT + 2}", *settings)
    return folder / "sky"


def said_by_run(attack: str, level: int) -> dict[int, str]:
    scenario = load_scenario(NIGHT, (*SETTINGS, f"attack={attack}", f"processor.level={level}", f"epochs={AT + 1}"))
    assert isinstance(scenario, CampaignScenario)
    results = direct_results(ScenarioPlan(scenario=scenario))
    return {
        svid: list(Status)[status].name
        for svid, status in zip(results["svid"].values.tolist(), results["status"].values[AT], strict=True)
    }


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "honest" else pytest.mark.slow) for name in ATTACKS]
)
def test_process_says_what_run_says(tmp_path: Path, name: str) -> None:
    """Every satellite of one RECS at level 1, honest and under attack."""
    folder = recorded(tmp_path, ATTACKS[name])
    found = json.loads(written(process, folder, "--json"))["verdicts"]
    said = said_by_run(ATTACKS[name], 1)
    assert {one["svid"]: one["status"] for one in found} == said
    assert sorted(set(said.values())) == SAID[name]


def test_a_recording_of_one_epoch_has_a_verdict(tmp_path: Path) -> None:
    """Its observation file has one epoch; each public key of its assistance is named once."""
    written(
        simulate, NIGHT, "-o", tmp_path / "sky", "--epochs", f"{AT}:{AT + 1}", *(f"--set={one}" for one in SETTINGS)
    )
    found = json.loads(written(process, tmp_path / "sky", "--json"))["verdicts"]
    assert [one["status"] for one in found] == ["AUTHENTIC"] * 4
    text = written(inspect, tmp_path / "sky")
    assert text.count("public key PKID 1") == 1
    assert text.count("    public_key.xml: the key of public_key.pem") == 1
    assert text.count("    merkle_tree.xml: the key of public_key.pem") == 1


def test_a_sky_gives_a_position_and_a_message(tmp_path: Path) -> None:
    folder = recorded(tmp_path, "[]")
    orbits = folder / "rinex" / "navigation.rnx"
    (position,) = json.loads(written(process, folder, "--level", 2, "--navigation", orbits, "--json"))["positions"]
    assert position["latitude_deg"] == pytest.approx(48.1, abs=5e-4)
    assert position["longitude_deg"] == pytest.approx(11.6, abs=5e-4)
    tree = folder / "assistance" / "merkle_tree.xml"
    report = json.loads(written(verify_command, folder / "inav_pages.csv", "--merkle-tree", tree, "--json"))
    assert report["tags"]["0"]["failed"] == 0
    assert report["tags"]["0"]["ok"] > 100
