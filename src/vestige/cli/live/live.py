"""`vestige live`: authenticate a recording while it is being written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vestige.cli.live.follow import check_usage, follow_recording
from vestige.cli.live.live_input import stdin_options
from vestige.cli.option_groups import GroupedCommand
from vestige.cli.options import PATH, number_option
from vestige.cli.outputs.other_programs import OUTPUT_NAMES, output_options
from vestige.cli.recordings.process_options import PROCESSOR_GROUPS, processor_options
from vestige.cli.recordings.processor_from_options import processor_from_options
from vestige.cli.terminal import detail

LIVE_GROUPS = {
    "Output": (
        "output",
        "as_json",
        *OUTPUT_NAMES,
        "fail_on",
    ),
    "Waiting for samples and keys": (
        "poll_s",
        "idle_s",
        "wait_s",
        "observations",
    ),
    "Samples on standard input": (
        "description",
        "band",
        "sample_format",
        "layout",
        "sample_rate_hz",
        "center_frequency_hz",
        "buffer_mb",
        "real_time",
    ),
}


@click.command(cls=GroupedCommand, groups=LIVE_GROUPS | PROCESSOR_GROUPS)
@processor_options
@click.option(
    "-o", "--output", type=PATH, help="Keep verdicts and state in this folder. If the folder exists, continue from it."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON objects, one on each line.")
@output_options
@number_option("--poll-s", (0.001, 60), default=1.0, metavar="SECONDS", help="Time between two looks for new samples.")
@number_option(
    "--idle-s", (0, 1e7), metavar="SECONDS", help="End if nothing new arrives for this time. [default: never]"
)
@number_option("--wait-s", (0, 1e7), default=180.0, metavar="SECONDS", help="Time to wait for the key of a RECS.")
@click.option("--observations", type=PATH, help="File of E1 observations, if RECORDING does not name it.")
@stdin_options
@click.option(
    "--real-time", is_flag=True, help="Drop samples when the buffer is full, because the recorder cannot wait."
)
def command(recording_path: Path, **options: Any) -> None:
    """Authenticate RECORDING while it is being written.

    The verdicts of a RECS, and alarms that follow from these verdicts, are printed as soon as the key of the RECS is
    received. RECORDING is a folder or file as for `vestige process`. With `-`, samples of E6 or of both bands are read
    from standard input.
    """
    check_usage(recording_path, options)
    processor = processor_from_options(options)
    detail(processor.limits)
    follow_recording(recording_path, options, processor)
