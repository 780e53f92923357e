"""`vestige demo`: show in a minute what vestige does.

The demo authenticates a small recording three times: unchanged, with a wrong key, and with a delayed E6. Then the demo
tracks and authenticates four simulated satellites, makes statistics, and shows an attack.

The demo makes all its data: the recording (`first_light.toml`), an OSNMA key chain, and the RECS. The demo also
simulates a few seconds of the signals of four satellites, with message, keys and RECS (`night.toml`). The statistics
come from `quick.toml`, a short campaign in the paper's harsh conditions.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import click

from vestige.cli.options import PATH
from vestige.cli.terminal import echo
from vestige.output import check_new_folder

# The demo uses four of the eight satellites of `night.toml`, about half of its sampling rate, and the RECS of second 8.
SKY_EPOCHS = "5:9"
SKY_SETTINGS = ("receiver.sample_rate_hz=6.2e6", "constellation.svids=[7,8,13,14]", "recs.every=8")


@click.command()
@click.option(
    "-o",
    "--output",
    "folder",
    type=PATH,
    default="vestige_demo",
    help="Folder to write; must not exist.",
)
def command(folder: Path) -> None:
    """Show in a minute what vestige does, with every command as you would type it.

    A recording is simulated and authenticated. The same recording is authenticated again, first with a wrong key and
    then with a delayed E6. Then the demo tracks and authenticates four simulated satellites, makes statistics, and
    shows an attack.
    """
    check_new_folder(folder)
    scenarios, night, sky = folder / "scenarios", folder / "recording", folder / "sky"
    wrong_key, late, statistics = folder / "wrong_key", folder / "late_e6", folder / "quick.zarr"
    keys = ("--keys", night / "osnma" / "keys.csv", "--public-key", night / "osnma" / "public_key.pem")

    _run("init", folder)
    echo("", "1. A recorder took 130 ms of E1 and E6 from five satellites.")
    _run("simulate", scenarios / "first_light.toml", "-o", night)
    echo("", "2. The server published the E6-C chips of 16 ms, encrypted under a key that was still secret: the RECS.")
    _run("recs", "make", "--from-recording", night, *keys, "-o", night / "assistance")
    echo("", "3. The key has arrived over E1-B. Decrypt, correlate, compare with E1.")
    _run("process", night, "--calibrate", "--write-bias", night / "assistance")

    echo(
        "",
        "4. The RECS are encrypted under the key of the next subframe, but name the key of this one: nothing "
        "correlates.",
    )
    _encrypt_under_the_next_key(night / "assistance", wrong_key)
    _run("process", night, "--assistance", wrong_key)

    echo("", "5. E6 is two samples (48 m) late, as if replayed: the signal is there, but not where E1 predicts it.")
    _delay_e6(night, late, samples=2)
    _run("process", late, "--assistance", night / "assistance")

    echo("", "6. A sky: 3 s of E1 and E6 from four satellites, with their message, OSNMA keys and one RECS of each.")
    _run("simulate", scenarios / "night.toml", "--epochs", SKY_EPOCHS, "-o", sky, *_set(SKY_SETTINGS))
    echo("", "7. E1 is tracked in the samples; the RECS is correlated in E6 at the delay that E1 predicts.")
    _run("process", sky, "--track", "--public-key", sky / "assistance" / "public_key.pem")
    echo(
        "All four are AUTHENTIC: the encrypted signal is far above the noise of E6 (σ), and its range differs by a",
        "metre from the E1 range. Nobody could know the chips before the key was sent, at the time after 'known from'.",
    )
    echo(
        "", "8. How often does it work? 20,000 RECS in the paper's harsh conditions: 35 dBHz, multipath, solar maximum."
    )
    _run("run", scenarios / "quick.toml", "-o", statistics)
    _run("plot", "all", statistics, "-o", folder / "figures")
    _run("report", statistics, "-o", folder / "quick.html")
    echo("", "9. A replay of both bands, which level 1 does not detect: six runs, at each mitigation level.")
    _run("threats", "--quick", "--only", "A3", "-j", "2")
    echo("", f"Files: {folder}/; figures: {folder / 'figures'}/; a page for a browser: {folder / 'quick.html'}")
    echo("Next: all attacks: vestige threats --quick -j 2 -o threats; options: vestige threats --help")
    echo(f"      vestige inspect {night}; vestige theory --paper; vestige run {scenarios / 'harsh.toml'} -o harsh.zarr")


def _run(*arguments: object) -> None:
    """Print a command as a user would type it, and run it."""
    from vestige.cli.main import vestige

    line = ["vestige", *(str(argument) for argument in arguments)]
    echo("", "$ " + " ".join(line))
    sys.stdout.flush()
    vestige.main(args=line[1:], prog_name="vestige", standalone_mode=False)
    sys.stdout.flush()


def _set(settings: Iterable[str]) -> list[str]:
    """Return the options `--set` of a command for settings `table.key=value` of a scenario."""
    return [part for setting in settings for part in ("--set", setting)]


def _delay_e6(recording: Path, output: Path, *, samples: int) -> None:
    """Write a copy of a recording with E6 delayed by a number of samples."""
    from vestige.recording.recording import open_recording
    from vestige.recording.samples.sigmf_writer import write_collection, write_sigmf

    opened = open_recording(recording)
    output.mkdir()
    metas = []
    both = [reader for reader in (opened.e1, opened.e6) if reader is not None]
    for reader, delay in zip(both, (0, samples), strict=True):
        batch = reader.read(0, reader.n_samples)
        late = replace(batch, first_sample=delay, start=batch.start + delay / batch.sample_rate_hz)
        metas.append(
            write_sigmf(output / batch.band.value.lower(), [late], form=reader.file.form, time_uncertainty_s=1.0)
        )
    write_collection(output / "recording", metas)


def _encrypt_under_the_next_key(assistance: Path, output: Path) -> None:
    """Write a copy of an assistance folder, with the RECS encrypted under the key of the next subframe."""
    from vestige.crypto.recs.recs_segment import decrypt, encrypt
    from vestige.recording.assistance.assistance_writer import write_assistance
    from vestige.recording.assistance.folder import read_assistance
    from vestige.records import Assistance

    folder = read_assistance(assistance).assistance
    keys = {key.time: key for key in folder.keys}
    segments = tuple(
        encrypt(decrypt(segment, keys[segment.key_time]), keys[segment.key_time + 30].data)
        for segment in folder.segments
    )
    output.mkdir()
    for path in assistance.iterdir():
        if not re.search(r"\.(bin|RCS)$", path.name):
            shutil.copy(path, output)
    write_assistance(output, Assistance(segments=segments))
