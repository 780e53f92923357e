"""`vestige check`: parse scenario files and print what they describe, without running them."""

from __future__ import annotations

from pathlib import Path

import click


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
        resolved[str(path)] = scenario.model_dump(by_alias=True)
        if not as_json:
            receiver = scenario.receiver
            click.echo(
                f"{path}: {len(scenario.satellites)} satellites, {scenario.duration_s:g} s from {scenario.start_time}, "
                f"E1 and E6 at {receiver.sample_rate_hz / 1e6:g} MHz, seed {scenario.seed}"
            )
            for one in scenario.satellites:
                click.echo(
                    f"  E{one.svid:02d}  range {one.range_m / 1e3:.3f} km  rate {one.range_rate_mps:+.1f} m/s  "
                    f"C/N0 E1-C {one.cn0_e1_dbhz:g}, E6-C {one.cn0_e6_dbhz:g} dBHz"
                )
    if as_json:
        click.echo(json.dumps(resolved))
    for earlier in errors[:-1]:
        click.echo(f"vestige: {earlier}", err=True)
    if errors:
        raise errors[-1]
