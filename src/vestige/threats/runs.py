"""Read and write the file with the runs of the threat table: a line per run and level, added when the run ends."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import asdict, fields
from io import StringIO
from pathlib import Path

from vestige.campaign.run_outcome import RunOutcome
from vestige.crypto.file_bytes import read_bytes
from vestige.errors import InputFileError
from vestige.output import replacement

RUNS = "runs.csv"
_MAX_BYTES = 1 << 30  # largest size in bytes of a file that is read; a line has about 200 bytes
RunKey = tuple[str, ...]  # threat, scene, seed, attack or no attack, level, digest of the scenario

_KEY = ("threat", "scene", "seed", "attacked", "level", "digest")
_COLUMNS = tuple(field.name for field in fields(RunOutcome))
_HEADER = ",".join((*_KEY, *_COLUMNS))
_READ: dict[str, Callable[[str], object]] = {
    "int": int,
    "bool": lambda text: bool(int(text)),
    "float": float,
    "str": str,
}


def read_runs(path: Path) -> dict[RunKey, RunOutcome]:
    """Return the outcomes of the runs in a file by key of the run; the result is empty if there is no file.

    An incomplete last line, which an interruption has cut off, is left out.

    The function raises `InputFileError` if the file is not a file of runs.
    """
    if not path.exists():
        return {}
    try:
        content = read_bytes(path, at_most=_MAX_BYTES)
        if _HEADER.encode().startswith(content):
            return {}  # the file is empty, or an interruption has cut off its first line
        whole = content[: content.rfind(b"\n") + 1].decode().splitlines()
        lines = list(csv.reader(whole[1:]))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputFileError(path, "file", error, "the runs of a threat table") from error
    if not whole or whole[0] != _HEADER:
        raise InputFileError(path, "line 1", whole[0][:80] if whole else "no whole line", _HEADER)
    runs: dict[RunKey, RunOutcome] = {}
    for number, cells in enumerate(lines, start=2):
        try:
            key, values = tuple(cells[: len(_KEY)]), cells[len(_KEY) :]
            runs[key] = RunOutcome(
                **{
                    field.name: _READ[str(field.type)](value)
                    for field, value in zip(fields(RunOutcome), values, strict=True)
                }  # type: ignore[arg-type]
            )
        except ValueError as error:
            raise InputFileError(path, f"line {number}", ",".join(cells)[:80], "a run of a threat table") from error
    return runs


def write_runs(path: Path, runs: dict[RunKey, RunOutcome]) -> None:
    """Write the outcomes of all runs to a file; if writing fails, no incomplete file remains."""
    with replacement(path) as part:
        part.write_text(_HEADER + "\n" + "".join(line_of(key, run) for key, run in runs.items()), encoding="utf-8")


def line_of(key: RunKey, run: RunOutcome) -> str:
    """Return the line of `runs.csv` with the key and the outcome of a run."""
    text = StringIO()
    values = [int(value) if isinstance(value, bool) else value for value in asdict(run).values()]
    csv.writer(text, lineterminator="\n").writerow([*key, *values])
    return text.getvalue()
