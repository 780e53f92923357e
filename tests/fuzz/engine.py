"""Runs readers on spoiled inputs and says what is wrong with how they answer.

An input is a folder: its files by name. A reader may accept it or refuse it with one line. It must not end with any
other error, take longer than `LONGEST_S`, need more than `MOST_MEMORY_BYTES`, or accept what it has to refuse.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import resource
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from fuzz.mutation import by_suffix
from vestige.errors import VestigeError

LONGEST_S = 10.0
MOST_MEMORY_BYTES = 1 << 30
LONGEST_MESSAGE = 1200  # characters


class Special(Enum):
    """What may stand in a folder in place of a file."""

    FIFO = "a pipe that nobody writes"
    FOLDER = "an empty folder"
    LOOP = "a symbolic link to itself"
    NOWHERE = "a symbolic link to nothing"
    SPARSE = "a file of 1 TB without content"
    DEVICE = "a symbolic link to /dev/zero"


Files = Mapping[str, bytes | Special]


class WrongAcceptanceError(AssertionError):
    """A reader accepted what it has to refuse."""


class _HangError(BaseException):
    """The time is up; no `except Exception` may keep it."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """A reader and what to feed it.

    Attributes
    ----------
    make
        Returns inputs that the reader accepts.
    read
        Reads the folder of an input. Raises `VestigeError` to refuse it, `WrongAcceptanceError` if what was accepted
        must not be.
    spoil
        Returns a spoiled input; by default one or two of its files are, by what their names say of them.
    share
        How many of a thousand inputs are for this reader.
    """

    name: str
    make: Callable[[], Sequence[Files]]
    read: Callable[[Path], None]
    spoil: Callable[[Random, Files], Files] | None = None
    share: int = 20

    @cached_property
    def corpus(self) -> Sequence[Files]:
        """The inputs that the reader accepts, made once."""
        return self.make()

    def input(self, seed: int, number: int) -> Files:
        """Return a spoiled input: the same seed and number, the same input."""
        rng = Random(f"{self.name} {seed} {number}")  # noqa: S311  (not a secret)
        return (self.spoil or spoil_files)(rng, rng.choice(self.corpus))


def spoil_files(rng: Random, files: Files) -> Files:
    """Return an input with one or two files spoiled; now and then one is missing, renamed or something else.

    A `.txt` holds what is told on a command line: it is always there.
    """
    changed = dict(files)
    for _ in range(rng.choice((1, 1, 1, 2))):
        name = rng.choice(sorted(changed)) if changed else ""
        content = changed.get(name)
        choice = 1.0 if name.endswith(".txt") else rng.random()
        if choice < 0.02:
            changed.pop(name, None)
        elif choice < 0.05:
            changed[name] = rng.choice(list(Special))
        elif choice < 0.07 and changed:
            changed[rng.choice(sorted(changed))] = changed[name]
        elif isinstance(content, bytes):
            changed[name] = by_suffix(name)(rng, content)
    return changed


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What is wrong with the answer to an input.

    Attributes
    ----------
    kind
        In one line, the same for all inputs that show the same.
    detail
        All that is known.
    """

    target: str
    kind: str
    detail: str
    files: Files


def examine(target: Target, files: Files) -> Finding | None:
    """Return what is wrong with the answer of a reader to an input, or None."""
    wrong: tuple[str, str] | None = None
    with TemporaryDirectory(prefix="fuzz") as name:
        folder = Path(name)
        place(files, folder)
        before_s = time.process_time()
        try:
            with _limits():
                target.read(folder)
        except VestigeError as error:
            wrong = _wrong_message(error)
        except OSError as error:
            # `vestige` prints it in one line if it says of which file it is
            wrong = None if error.filename and error.strerror else _described(error)
        except (Exception, _HangError) as error:
            wrong = _described(error)
        if wrong is None and time.process_time() - before_s > LONGEST_S:  # where no alarm interrupts
            wrong = ("longer than allowed", f"{time.process_time() - before_s:.1f} s")
    return None if wrong is None else Finding(target=target.name, kind=wrong[0], detail=wrong[1], files=files)


def _wrong_message(error: VestigeError) -> tuple[str, str] | None:
    text = str(error)
    if len(text.splitlines()) != 1 or not text.strip():
        return f"{type(error).__name__} not in one line", repr(text)
    if not text.isprintable():
        return f"{type(error).__name__} that is not printable", repr(text)
    if len(text) > LONGEST_MESSAGE:
        return f"{type(error).__name__} of more than {LONGEST_MESSAGE} characters", repr(text)
    return None


def _described(error: BaseException) -> tuple[str, str]:
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "vestige" in Path(frame.filename).parts] or frames
    place = f"{Path(own[-1].filename).name}:{own[-1].lineno} {own[-1].name}"
    return f"{type(error).__name__} at {place}", "".join(traceback.format_exception(error))


@contextlib.contextmanager
def _limits() -> Iterator[None]:
    """Bound time and memory; warnings are errors. Outside the main thread there is no alarm."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_address_space_bytes() + MOST_MEMORY_BYTES, hard))
    alarms = _ALARMS if threading.current_thread() is threading.main_thread() else ()
    before = [signal.signal(number, _ring) for number, _, _ in alarms]
    for _, timer, times in alarms:
        signal.setitimer(timer, times * LONGEST_S)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
    finally:
        for (number, timer, _), handler in zip(alarms, before, strict=True):
            signal.setitimer(timer, 0)
            signal.signal(number, handler)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


# Signal, timer, how many times `LONGEST_S`: on a busy machine computing takes longer, and waiting does not.
_ALARMS = ((signal.SIGVTALRM, signal.ITIMER_VIRTUAL, 1), (signal.SIGALRM, signal.ITIMER_REAL, 6))


def _ring(_number: int, _frame: object) -> None:
    raise _HangError(f"longer than {LONGEST_S:g} s")


def _address_space_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def place(files: Files, folder: Path) -> None:
    """Write an input; a name that no file can have is left out."""
    for name, content in files.items():
        path = folder / name
        with contextlib.suppress(OSError, ValueError):
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, bytes):
                path.write_bytes(content)
            else:
                _place_special(path, content)


def _place_special(path: Path, special: Special) -> None:
    if special is Special.FIFO:
        os.mkfifo(path)
    elif special is Special.FOLDER:
        path.mkdir()
    elif special is Special.SPARSE:
        path.touch()
        os.truncate(path, 1 << 40)
    else:
        targets = {Special.LOOP: path.name, Special.NOWHERE: "nothing here", Special.DEVICE: "/dev/zero"}
        path.symlink_to(targets[special])


def save(finding: Finding, folder: Path) -> Path:
    """Write the input of a finding into a folder and return the file; `load` reads it."""
    content = {
        "target": finding.target,
        "kind": finding.kind,
        "files": {
            name: content.name if isinstance(content, Special) else {"base64": base64.b64encode(content).decode()}
            for name, content in finding.files.items()
        },
    }
    text = json.dumps(content, indent=1)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{finding.target}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.json"
    path.write_text(text + "\n", encoding="utf-8")
    return path


def load(path: Path) -> tuple[str, Files]:
    """Return the name of the reader and the input in a file of `save`."""
    content = json.loads(path.read_text(encoding="utf-8"))
    files = {
        name: Special[one] if isinstance(one, str) else base64.b64decode(one["base64"])
        for name, one in content["files"].items()
    }
    return content["target"], files


def shares(targets: Sequence[Target], n_inputs: int) -> Mapping[str, int]:
    """Return how many of `n_inputs` inputs, or a few more, each reader gets: at least one."""
    whole = sum(target.share for target in targets)
    return {target.name: -(-n_inputs * target.share // whole) for target in targets}
