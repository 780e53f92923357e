"""`make demo`: authenticate a small recording, see what a wrong key and a shifted E6 do, then a sky, then statistics.

Everything is made here: the recording (`scenarios/first_light.toml`), an OSNMA key chain, the RECS, some seconds of a
sky with its message, keys and RECS (`scenarios/night.toml`), and the simulated measurements of `scenarios/quick.toml`,
the paper's harsh conditions in short.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from vestige.cli.main import vestige
from vestige.crypto.recs.recs_segment import decrypt, encrypt
from vestige.recording.assistance.assistance_writer import write_assistance
from vestige.recording.assistance.folder import read_assistance
from vestige.recording.recording import open_recording
from vestige.recording.samples.sigmf_writer import write_collection, write_sigmf
from vestige.records import Assistance

ROOT = Path(__file__).resolve().parents[1]
FOLDER, WRONG_KEY, LATE = Path("build/demo"), Path("build/demo_wrong_key"), Path("build/demo_late")
SKY = Path("build/demo_sky")
# four of the night's eight satellites at half its rate, and the RECS that is sent in second 8
SKY_EPOCHS = "5:9"
SKY_SETTINGS = ("receiver.sample_rate_hz=6.2e6", "constellation.svids=[7,8,13,14]", "recs.every=8")


def run(*arguments: object) -> None:
    """Print a command as one would type it, and run it."""
    line = ["vestige", *(str(argument) for argument in arguments)]
    print("\n$", " ".join(line), flush=True)
    vestige.main(args=line[1:], prog_name="vestige", standalone_mode=False)
    sys.stdout.flush()


def main() -> None:
    """Run the demonstration."""
    os.chdir(ROOT)
    for folder in (FOLDER, WRONG_KEY, LATE, SKY):
        shutil.rmtree(folder, ignore_errors=True)
    keys = ("--keys", FOLDER / "osnma" / "keys.csv", "--public-key", FOLDER / "osnma" / "public_key.pem")

    print("1. A recorder took 130 ms of E1 and E6 from five satellites.")
    run("simulate", "scenarios/first_light.toml", "-o", FOLDER)
    print("\n2. The server published the E6-C chips of 16 ms, encrypted under a key that was still secret: the RECS.")
    run("recs", "make", "--from-recording", FOLDER, *keys, "-o", FOLDER / "assistance")
    print("\n3. The key has arrived over E1-B. Decrypt, correlate, compare with E1.")
    run("process", FOLDER, "--calibrate", "--write-bias", FOLDER / "assistance")

    print("\n4. RECS under the key of the next subframe that claim to be under this one's: nothing correlates.")
    _encrypt_under_the_next_key(FOLDER / "assistance", WRONG_KEY)
    run("process", FOLDER, "--assistance", WRONG_KEY)

    print("\n5. E6 two samples (48 m) late against E1, as if replayed: the signal is there, but not where E1 says.")
    _delay_e6(FOLDER, LATE, samples=2)
    run("process", LATE, "--assistance", FOLDER / "assistance")

    print("\n6. A sky: 3 s of E1 and E6 from four satellites, with their message, the OSNMA keys and a RECS of each.")
    run("simulate", "scenarios/night.toml", "--epochs", SKY_EPOCHS, "-o", SKY, *_set(SKY_SETTINGS))
    print("\n7. E1 is tracked in the samples; the RECS is looked for in E6 where E1 says it must be.")
    run("process", SKY, "--track", "--public-key", SKY / "assistance" / "public_key.pem")
    print(
        "All four are AUTHENTIC: the encrypted signal stands far above the noise of E6 (σ), and its range differs by\n"
        "a metre from that of E1. Nobody could know the chips before the key was sent, at the time after 'known from'."
    )
    print(
        "\n8. How often does it work? 20,000 RECS in the paper's harsh conditions: 35 dBHz, multipath, solar maximum."
    )
    run("run", "scenarios/quick.toml", "-o", FOLDER / "quick.zarr")
    run("plot", "all", FOLDER / "quick.zarr", "-o", FOLDER / "figures")
    run("report", FOLDER / "quick.zarr", "-o", FOLDER / "quick.html")
    print("\n9. A replay of both bands, which level 1 cannot see: six runs, at each mitigation level.")
    run("threats", "--quick", "--only", "A3", "-j", "2")
    print(f"\nFiles: {FOLDER}/, {SKY}/, figures: {FOLDER}/figures/, a page for a browser: {FOLDER}/quick.html")
    print("Next: all attacks: vestige threats --quick -j 2 -o threats; one of your own: docs/your_own_attack.md")
    print(
        f"      vestige inspect {FOLDER}; vestige theory --paper; vestige run scenarios/harsh.toml -o harsh.zarr -j 2"
    )


def _set(settings: Iterable[str]) -> list[str]:
    """Return the options that change values of a scenario."""
    return [part for setting in settings for part in ("--set", setting)]


def _delay_e6(recording: Path, output: Path, *, samples: int) -> None:
    """Write a copy of a recording whose E6 is some samples late on the counter that both bands share."""
    opened = open_recording(recording)
    output.mkdir()
    metas = []
    for reader, delay in ((opened.e1, 0), (opened.e6, samples)):
        batch = reader.read(0, reader.n_samples)
        late = replace(batch, first_sample=delay, start=batch.start + delay / batch.sample_rate_hz)
        metas.append(
            write_sigmf(output / batch.band.value.lower(), [late], form=reader.file.form, time_uncertainty_s=1.0)
        )
    write_collection(output / "recording", metas)


def _encrypt_under_the_next_key(assistance: Path, output: Path) -> None:
    """Write a copy of an assistance folder whose RECS were encrypted under the next key."""
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


if __name__ == "__main__":
    main()
