"""`vestige recs make`: make an assistance folder for a recording whose E6-C is not encrypted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vestige.cli.options import PATH, FiniteRange, cipher_mode_option, json_option, start_option
from vestige.cli.terminal import echo, warn


@click.command()
@click.option("--from-recording", "recording_path", required=True, type=PATH, help="Recording with open E6-C.")
@click.option("--keys", "keys_path", required=True, type=PATH, help="Key file, or navigation pages (SBF, CSV).")
@click.option("--public-key", type=PATH, help="OSNMA public key (XML, PEM).")
@click.option("--merkle-tree", type=PATH, help="OSNMA Merkle tree (XML).")
@click.option("-o", "--output", required=True, type=PATH, help="Assistance folder to write.")
@click.option(
    "--length-ms", type=click.Choice(["1", "2", "4", "8", "16"]), default="16", help="Duration of each RECS in ms."
)
@click.option(
    "--interval",
    "interval_s",
    type=FiniteRange(0.1, 1e6),
    default=30.0,
    help="Time between RECS in s.",
)
@click.option(
    "--kdi",
    type=click.IntRange(0, 1),
    default=0,
    help="Key delay indicator: the key is sent in the same subframe (0) or the next one (1).",
)
@cipher_mode_option
@click.option(
    "--svids", default="", show_default=False, help="Satellites, for example 2,3,7-9. [default: those found on E1]"
)
@start_option
@json_option
def command(recording_path: Path, output: Path, length_ms: str, as_json: bool, **options: Any) -> None:
    """Make RECS for a recording with open E6-C, from the chips of the open code and validated OSNMA keys.

    The command writes all files that `vestige process --assistance` needs: RECS, BGD (zero, because the true values are
    not known), the keys and their trust anchor. RECS that are made in this way contain the open code, which everybody
    knows and which repeats after 100 ms. RECS with the open code test all steps of the processing, but prove nothing
    against a spoofer. The exhaustive search of level 3 does not use RECS with the open code, unless `--search-window`
    is below 0.5 ms. The hand-over search counts peaks that are whole multiples of 100 ms apart as a single peak.
    """
    import json

    from vestige.cli.options import cipher_mode, parse_svids
    from vestige.cli.progress import progress
    from vestige.recording.assistance.made_recs import OPEN_CODE, make_assistance
    from vestige.recording.recording import open_recording

    recording = open_recording(recording_path, start=options["start"])
    wanted = parse_svids(options["svids"])
    with progress() as report:
        made = make_assistance(
            recording,
            keys_path=options["keys_path"],
            public_key=options["public_key"],
            merkle_tree=options["merkle_tree"],
            output=output,
            duration_ms=int(length_ms),
            interval_s=options["interval_s"],
            key_delay=options["kdi"],
            cipher_mode=cipher_mode(options),
            svids=wanted,
            progress=lambda done, total: report("E1 search", done, total),
        )
    if as_json:
        echo(
            json.dumps(
                {
                    "folder": str(output),
                    "svids": sorted({segment.svid for segment in made.segments}),
                    "transmit_times": sorted({str(segment.transmit_time) for segment in made.segments}),
                    "key_times": sorted({str(segment.key_time) for segment in made.segments}),
                    "note": OPEN_CODE,
                    "files": [str(path) for path in made.files],
                }
            )
        )
        return
    echo(f"{output}: {len(made.segments)} RECS of {length_ms} ms")
    warn(OPEN_CODE)
    for time in sorted({segment.transmit_time for segment in made.segments}):
        names = " ".join(f"E{segment.svid:02d}" for segment in made.segments if segment.transmit_time == time)
        echo(f"  sent {time}: {names}")
