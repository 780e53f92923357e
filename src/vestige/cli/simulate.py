"""`vestige simulate`: write the recording of a scenario, and the OSNMA keys of its time."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder to write; must not exist.")
def command(scenario: Path, output: Path) -> None:
    """Write E1 and E6 samples of SCENARIO as a SigMF collection, and a simulated OSNMA key chain.

    The E6-C of the recording carries its open codes; `vestige recs make` makes RECS for it.
    """
    from vestige.errors import InputFileError, VestigeError
    from vestige.scenario.load import load_scenario
    from vestige.scenario.recording import RecordingScenario, write_recording

    loaded = load_scenario(scenario)
    if not isinstance(loaded, RecordingScenario):
        raise VestigeError(f"{scenario}: kind: found {loaded.kind!r}, expected 'recording'; `vestige run` runs it")
    if output.exists():
        raise InputFileError(output, "output folder", "something there already", "a name that is not taken")
    for path in write_recording(loaded, output, progress=lambda text: click.echo(text, err=True)):
        click.echo(str(path))
