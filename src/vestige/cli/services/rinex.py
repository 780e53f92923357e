"""`vestige rinex`: write the E1 observations and navigation data of a simulated sky, for any receiver software."""

from __future__ import annotations

from pathlib import Path

import click

from vestige.cli.options import PATH, parts_option
from vestige.cli.terminal import echo, note
from vestige.errors import InputFileError, VestigeError, satellite_names


@click.command()
@click.argument("results_path", metavar="RESULTS", type=PATH)
@click.option("-o", "--output", required=True, type=PATH, help="Folder to write; must not exist.")
@parts_option
def command(results_path: Path, output: Path) -> None:
    """Write the E1 observations and the ephemerides of RESULTS as RINEX 3.05, and print the files.

    RESULTS is the store of `vestige run` of a scenario with [constellation]. The observations are pseudorange, Doppler
    and C/N0 of the tracked satellites at every epoch. The observations belong to the signal that the receiver tracked,
    which may be the spoofing signal during an attack.
    """
    from vestige.campaign.rinex_export import COMMAND, export_rinex
    from vestige.campaign.store.results import open_results

    results = open_results(results_path).dataset
    try:
        written = export_rinex(results, output)
    except InputFileError:
        raise
    except VestigeError as error:
        raise VestigeError(f"{results_path}: {error}") from error
    for path in written.files:
        echo(str(path))
    satellites = satellite_names(written.svids)
    note(f"{written.n_epochs} epochs of {satellites}; {written.n_ephemerides} ephemerides")
    note(f"positions by RTKLIB, with RAIM: cd {output} && {COMMAND}")
