"""Readers of whole folders: the assistance of a receiver, and the command line on whatever it is given."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Sequence
from pathlib import Path
from random import Random

from fuzz.authority import (
    CHAIN,
    GROUP_DELAYS,
    KEYS,
    PAGES,
    SEGMENTS,
    SERVER_KEY,
    START,
    files_of,
    pem,
    require_genuine_keys,
)
from fuzz.engine import Files, Special, Target, WrongAcceptanceError, spoil_files
from fuzz.mutation import NUMBERS
from page_files import inav_block
from signed_files import sign_files
from vestige.cli.main import main
from vestige.errors import VestigeError
from vestige.recording.assistance.assistance_writer import write_assistance
from vestige.recording.assistance.folder import read_assistance
from vestige.recording.assistance.growing_assistance import GrowingAssistance
from vestige.records import Assistance

_ARGUMENTS = "arguments.json"
_TOLD = ("--reference", "--start", "--time-uncertainty")
_TIMES = (
    "99999:604799.999", "0:0", "1:604800", "9999-12-31T23:59:59 UTC", "1999-08-21T23:59:46 UTC", "2026-02-30T00:00:00",
    "2016-12-31T23:59:60 UTC", "2026-01-01", "9000-12-31T23:59:59.9999999999999999 GST", "1372:478800.\u0663",
)  # fmt: skip
_SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
_PUBLIC_KEY, _CERTIFICATE = "trusted/osnma.pem", "trusted/server.pem"  # the user's own, never spoiled


def _assistance_folders() -> Sequence[Files]:
    whole = Assistance(
        segments=SEGMENTS,
        group_delays=GROUP_DELAYS,
        keys=KEYS,
        hardware_bias_e1_e6_s=-6.87e-8,
        ionosphere_e1_m={3: 2.5, 11: 4.0},
    )
    trusted = {_PUBLIC_KEY: pem(CHAIN.private_key.public_key()), _CERTIFICATE: pem(SERVER_KEY.public_key())}
    files = files_of(lambda folder: sign_files(write_assistance(folder, whole, roots=[CHAIN.root]), SERVER_KEY))
    folder = {f"assistance/{name}": data for name, data in files.items()}
    pages = b"".join(map(inav_block, PAGES[:60]))
    return [trusted | folder, trusted | folder | {"assistance/osnma/pages.sbf": pages}]


def _spoil_folder(rng: Random, files: Files) -> Files:
    """Spoil files other than the user's own; or give a file the name of another, or put something beside them."""
    own = {name: content for name, content in files.items() if name.startswith("trusted/")}
    others = {name: content for name, content in files.items() if name not in own}
    choice = rng.random()
    if choice < 0.1:
        first, second = rng.choice(sorted(others)), rng.choice(sorted(others))
        others[first], others[second] = others[second], others[first]
    elif choice < 0.2:
        name = rng.choice(
            ("assistance/x.RCS", "assistance/new", "assistance/new/keys.csv", "assistance/\x1b[2J\u202e.bin")
        )
        others[name] = rng.choice((*Special, rng.choice(sorted(others.items()))[1]))
    else:
        others = dict(spoil_files(rng, others))
    return own | others


def _read_assistance(folder: Path) -> None:
    """With his public key and the server's certificate, the user gets genuine RECS, group delays and keys only."""
    found = read_assistance(
        folder / "assistance", public_key=folder / _PUBLIC_KEY, certificates=[folder / _CERTIFICATE], reference=START
    )
    _check_lines(found.problems)
    require_genuine_keys(found.assistance.keys)
    if not set(found.assistance.segments) <= set(SEGMENTS) or not set(found.assistance.group_delays) <= set(
        GROUP_DELAYS
    ):
        raise WrongAcceptanceError("RECS or group delays that the server did not sign")
    if found.assistance.hardware_bias_e1_e6_s or found.assistance.ionosphere_e1_m:
        raise WrongAcceptanceError("corrections that nobody signed")
    growing = GrowingAssistance(folder / "assistance", public_key=folder / _PUBLIC_KEY, warn=_check_line)
    growing.look(START, START + 100)
    growing.tell()
    require_genuine_keys(growing.found.assistance.keys)
    trusting = read_assistance(folder / "assistance", reference=START)  # on the folder's own word
    _check_lines(trusting.problems)


def _check_lines(problems: Sequence[VestigeError]) -> None:
    for problem in problems:
        _check_line(problem)


def _check_line(problem: VestigeError) -> None:
    if len(str(problem).splitlines()) != 1:
        raise WrongAcceptanceError(f"a problem that is not one line: {problem}")


def _command_lines() -> Sequence[Files]:
    """Arguments, and the files that they name."""
    (_, folder) = _assistance_folders()
    by_name = {Path(name).name: data for name, data in folder.items()}
    recs = next(name for name in by_name if name.startswith("01_"))
    signed = [recs, f"{recs}_01.p256", "server.pem"]
    scenario = {"scenario.toml": (_SCENARIOS / "sky.toml").read_bytes()}
    commands: Sequence[tuple[list[str], Sequence[str]]] = (
        (["recs", "info", recs, "--certificate", "server.pem", "--json"], signed),
        (["recs", "info", recs, "--reference", "2026-01-01T00:00:00 UTC"], signed),
        (["recs", "decrypt", recs, "--keys", "keys.csv", "--public-key", "osnma.pem"], [recs, "keys.csv", "osnma.pem"]),
        (["osnma", "verify", "pages.sbf", "--public-key", "osnma.pem", "--json"], ["pages.sbf", "osnma.pem"]),
        (["osnma", "verify", "pages.sbf", "--public-key", "osnma.pem", "--fill-gaps"], ["pages.sbf", "osnma.pem"]),
        (["inspect", ".", "--start", "1372:478800.5", "--public-key", "osnma.pem"], [recs, "keys.csv", "osnma.pem"]),
        (["inspect", ".", "--time-uncertainty", "2.5", "--json"], [*signed, "keys.csv", "osnma.pem"]),
    )
    return [
        {_ARGUMENTS: json.dumps(arguments).encode()} | {name: by_name[name] for name in names}
        for arguments, names in commands
    ] + [{_ARGUMENTS: b'["check", "scenario.toml", "--json"]'} | scenario]


def _spoil_command_line(rng: Random, files: Files) -> Files:
    """Spoil the files; or what an option is told, the names of files apart."""
    arguments = files[_ARGUMENTS]
    assert isinstance(arguments, bytes)
    others = {name: content for name, content in files.items() if name != _ARGUMENTS}
    words = json.loads(arguments)
    told = [place for place, word in enumerate(words) if words[place - 1] in _TOLD]
    if told and rng.random() < 0.5:
        words[rng.choice(told)] = rng.choice((*NUMBERS, *_TIMES))
    elif rng.random() < 0.1:
        words[rng.randrange(1, len(words))] = rng.choice((*sorted(others), "--json", "--level", "", "-"))
    else:
        others = dict(spoil_files(rng, others))
    return {_ARGUMENTS: json.dumps(words).encode()} | others


def _read_command_line(folder: Path) -> None:
    """It ends with 0; or with 1 or 2 and a line that says why. It prints only what is printable, and JSON as JSON."""
    words = json.loads((folder / _ARGUMENTS).read_bytes())
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace")
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(words)
        except SystemExit as stop:
            code = stop.code
        out.flush()
        err.flush()
    printed, told = (stream.buffer.getvalue().decode() for stream in (out, err))  # type: ignore[attr-defined]
    lines = told.splitlines()
    if code not in (0, 1, 2) or (code and not lines):
        raise WrongAcceptanceError(f"{words}: exit code {code}, {told!r}")
    if not all(line.isprintable() for line in (*printed.splitlines(), *lines)):
        raise WrongAcceptanceError(f"{words}: characters that a terminal obeys: {printed!r}, {told!r}")
    if code == 1 and not lines[-1].startswith("vestige: "):
        raise WrongAcceptanceError(f"{words}: the last line is {lines[-1]!r}")
    if "--json" in words and printed:
        json.loads(printed, parse_constant=_no_number)


def _no_number(text: str) -> None:
    raise WrongAcceptanceError(f"{text} in JSON")


TARGETS = (
    Target(name="assistance", make=_assistance_folders, read=_read_assistance, spoil=_spoil_folder, share=16),
    Target(name="command-line", make=_command_lines, read=_read_command_line, spoil=_spoil_command_line, share=30),
)
