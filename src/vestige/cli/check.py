"""`vestige check`: parse scenario files and print what they describe, without running them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from vestige.scenario.load import Scenario


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="One JSON object with the resolved scenarios.")
def command(files: tuple[Path, ...], as_json: bool) -> None:
    """Parse scenario FILES, fill in the defaults, and print what each of them will do.

    Every file is checked; if one is bad, the exit code is 1 and its error is printed after the good ones.
    """
    import json

    from vestige.errors import VestigeError
    from vestige.scenario.load import load_scenario

    resolved: dict[str, object] = {}
    errors: list[VestigeError | OSError] = []
    for path in files:
        try:
            scenario = load_scenario(path)
        except (VestigeError, OSError) as error:
            errors.append(error)
            continue
        resolved[str(path)] = scenario.model_dump(mode="json", by_alias=True)
        if not as_json:
            click.echo("\n".join(_lines(path, scenario)))
    if as_json:
        click.echo(json.dumps(resolved))
    for earlier in errors[:-1]:
        click.echo(f"vestige: {earlier}", err=True)
    if errors:
        raise errors[-1]


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
    models = ("clock", "ionosphere", "multipath", "e1_tracking", "bias")
    return [
        f"{path}: campaign, {scenario.epochs} epochs of {scenario.interval_s:g} s from {scenario.start_time}, "
        f"{scenario.recs.duration_ms} ms each, C/N0 {scenario.receiver.cn0_dbhz:g} dBHz, {scenario.fidelity}, "
        f"seed {scenario.seed}",
        *(f"  {name}: {getattr(scenario.receiver, name) or 'none'}" for name in models),
        f"  processing: {scenario.processor}",
    ]
