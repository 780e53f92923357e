"""`vestige check`: parse scenario files and print what they describe, without running them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vestige.cli.options import parts_option
from vestige.cli.terminal import echo, raise_last

if TYPE_CHECKING:
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.load import Scenario


@click.command()
@click.argument("files", nargs=-1, type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="One JSON object with the resolved scenarios.")
@click.option("--schema", "as_schema", is_flag=True, help="Print the JSON schema of scenario files, for editors.")
@parts_option
def command(files: tuple[Path, ...], as_json: bool, as_schema: bool) -> None:
    """Parse scenario FILES, fill in the defaults, and print what each of them will do.

    Every file is checked; if one is bad, the exit code is 1 and its error is printed after the good ones.
    """
    import json

    from vestige.errors import VestigeError
    from vestige.scenario.load import load_scenario, scenario_schema
    from vestige.scenario.warnings import scenario_warnings

    if bool(files) == as_schema:
        raise click.UsageError("expected scenario FILES, or --schema alone")
    if as_schema:
        echo(*json.dumps(scenario_schema(), indent=2, allow_nan=False).split("\n"))
        return
    resolved: dict[str, object] = {}
    errors: list[VestigeError | OSError] = []
    for path in files:
        try:
            scenario = load_scenario(path)
        except (VestigeError, OSError) as error:
            errors.append(error)
            continue
        for warning in scenario_warnings(scenario):
            echo(f"vestige: {path}: {warning}", err=True)
        resolved[str(path)] = json.loads(scenario.model_dump_json(by_alias=True))  # JSON has no infinity: null
        if not as_json:
            echo(*_lines(path, scenario))
    if as_json:
        echo(json.dumps(resolved))
    raise_last(errors)


def _lines(path: Path, scenario: Scenario) -> list[str]:
    from vestige.scenario.recording import RecordingScenario

    receiver = scenario.receiver
    if isinstance(scenario, RecordingScenario):
        return [
            f"{path}: recording, {len(scenario.satellites)} satellites, {scenario.duration_s:g} s from "
            f"{scenario.start_time}, E1 and E6 at {receiver.sample_rate_hz / 1e6:g} MHz, seed {scenario.seed}",
            *(
                f"  E{one.svid:02d}  range {one.range_m / 1e3:.3f} km  rate {one.range_rate_mps:+.1f} m/s  "
                f"C/N0 E1-C {one.cn0_e1_dbhz:g}, E6-C {one.cn0_e6_dbhz:g} dBHz"
                for one in scenario.satellites
            ),
        ]
    front_end = scenario.receiver.front_end.front_end(receiver.sample_rate_hz)
    models = ("clock", "ionosphere", "multipath", "e1_tracking", "bias")
    return [
        f"{path}: campaign, {scenario.epochs} epochs of {scenario.interval_s:g} s from {scenario.start_time}, "
        f"{scenario.recs.duration_ms} ms each, C/N0 {scenario.receiver.cn0_dbhz:g} dBHz, {scenario.fidelity}, "
        f"seed {scenario.seed}",
        f"  front_end: {'none' if front_end.transparent else front_end}",
        *_sky_lines(scenario),
        *(f"  {name}: {getattr(scenario.receiver, name) or 'none'}" for name in models),
        f"  processing: {scenario.processor}",
        *(f"  attack.{number}: {attack}" for number, attack in enumerate(scenario.attack)),
    ]


def _sky_lines(scenario: CampaignScenario) -> list[str]:
    if scenario.constellation is None:
        return []
    svids = ", ".join(f"E{one.svid:02d}" for one in scenario.simulations)
    return [
        f"  constellation: {scenario.constellation}",
        f"  in view at some time: {svids}; a RECS every {scenario.interval_s * scenario.recs.every:g} s",
        f"  trajectory: {scenario.trajectory}",
        f"  position: {scenario.position}",
    ]
