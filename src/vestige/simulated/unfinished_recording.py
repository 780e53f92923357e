"""Manage the hidden folder in which a recording is written, so that a killed command can be resumed.

A recording `night` is written in `.night.unfinished`, in the same parent folder:

| file | content |
|---|---|
| `progress.json` | settings of the recording, and number of samples of each band that are certainly on disk |
| `night/` | the folder that is renamed at the end; the samples of a band are in `*.part` until the band is complete |

`progress.json` is replaced in one step, after all the counted samples are on the disk. So the process or the machine
may stop at any moment. The next call truncates the files to the counted samples and makes the missing samples. All
other files are made again. An error or Ctrl-C while the recording is written removes the hidden folder.
"""

from __future__ import annotations

import json
import os
import shutil
import stat
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from vestige.errors import InputFileError
from vestige.folder_lock import only_writer
from vestige.output import NAME_KEPT, check_new_folder, naming
from vestige.recording.samples.sigmf_file import DATA
from vestige.records import Band

_PROGRESS = "progress.json"
_BEGIN_AGAIN = "remove the folder to begin again"


@dataclass(slots=True)
class UnfinishedRecording:
    """Recording that is not yet complete.

    Attributes
    ----------
    folder
        Folder in which the files are written, and which is renamed to the output folder at the end.
    samples
        Number of samples of each band that are on the disk; empty for a new recording.
    """

    folder: Path
    samples: dict[Band, int]
    _identity: Mapping[str, str]
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def keep(self, band: Band, n_samples: int) -> None:
        """Store that the first `n_samples` of a band are on the disk, so that the next process continues after them."""
        with self._lock:
            self.samples[band] = n_samples
            counts = {band.value: count for band, count in self.samples.items()}
            text = json.dumps({"recording": dict(self._identity), "samples": counts}, indent=1)
            unfinished = self.folder.parent / f"{_PROGRESS}.part"
            with unfinished.open("w", encoding="utf-8") as stream:
                stream.write(text)
                stream.flush()
                os.fsync(stream.fileno())
            unfinished.replace(self.folder.parent / _PROGRESS)


def unfinished_folder(output: Path) -> Path:
    """Return the hidden folder in which `output` is written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from vestige.simulated.unfinished_recording import unfinished_folder
    >>> unfinished_folder(Path("build/night")).as_posix()
    'build/.night.unfinished'
    """
    return output.parent / f".{output.name[:NAME_KEPT]}.unfinished"


@contextmanager
def unfinished_recording(output: Path, identity: Mapping[str, str]) -> Iterator[UnfinishedRecording]:
    """Yield a recording with the samples that a killed process left, and rename its folder to `output` at the end.

    Parameters
    ----------
    output
        Folder of the recording, which must not exist.
    identity
        All values on which the samples depend, by name. A recording is resumed only if all these values are equal.

    Raises
    ------
    InputFileError
        If `output` exists or lies in the results of a campaign. If the hidden folder contains another recording, is in
        use by another process, or could have been prepared by another user.
    OSError
        If the folder cannot be written; the error names `output`.
    """
    check_new_folder(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    hidden = unfinished_folder(output)
    with naming(output, str(hidden)):
        _own_folder(hidden)
    with only_writer(hidden):
        check_new_folder(output)  # a process that has just ended may have written the folder
        samples = _samples_left(hidden, identity)
        with naming(output, str(hidden)):
            try:
                folder = hidden / output.name
                folder.mkdir(exist_ok=True)
                _remove_all_but_samples(hidden, folder, samples)
                yield UnfinishedRecording(folder, samples, identity)
                check_new_folder(output)
                folder.rename(output)
            finally:
                shutil.rmtree(hidden, ignore_errors=True)


def _own_folder(hidden: Path) -> None:
    """Make the folder, or check that only the current user could have written to an existing folder."""
    try:
        hidden.mkdir(mode=0o700)
    except FileExistsError:
        found = hidden.lstat()
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
            expected = f"your own folder that nobody else can write; {_BEGIN_AGAIN}"
            raise InputFileError(hidden, "unfinished recording", "something else", expected) from None


def _samples_left(hidden: Path, identity: Mapping[str, str]) -> dict[Band, int]:
    """Return the number of samples of each band that a killed process left in the hidden folder; {} if none."""
    progress = hidden / _PROGRESS
    try:
        text = progress.read_text(encoding="utf-8")
    except FileNotFoundError:
        return {}
    try:
        content = json.loads(text)
        before, samples = dict(content["recording"]), {Band(name): int(n) for name, n in content["samples"].items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputFileError(
            progress, "content", "something else", f"the progress of a recording; {_BEGIN_AGAIN}"
        ) from None
    other = [name for name in identity if before.get(name) != identity[name]]
    if other:
        found, expected = f"a recording with another {other[0]}", "the command that began this recording"
        raise InputFileError(hidden, "unfinished recording", found, f"{expected}; {_BEGIN_AGAIN}")
    return samples


def _remove_all_but_samples(hidden: Path, folder: Path, samples: Mapping[Band, int]) -> None:
    """Remove all files that are made again, which are all files except the kept samples and `progress.json`."""
    kept = {folder / f"{band.value.lower()}{suffix}" for band in samples for suffix in (DATA, f"{DATA}.part")}
    for path in (*hidden.iterdir(), *folder.iterdir()):
        if path in (folder, hidden / _PROGRESS) or path in kept:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
