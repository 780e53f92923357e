"""What the engine has to notice: readers that are wrong in each of the ways that count."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from fuzz import engine
from fuzz.__main__ import main
from fuzz.engine import Special, Target, WrongAcceptanceError, examine, load, save
from fuzz.targets import TARGETS
from vestige.errors import InputFileError, VestigeError

FILES = {"a.csv": b"1,2\n"}


def _target(read: Callable[[Path], object]) -> Target:
    return Target(name="recs", make=lambda: [FILES], read=lambda folder: read(folder) and None)


def _endless_match(_folder: Path) -> None:
    re.match(r"(a+)+b", "a" * 40)


def _raise(error: BaseException) -> Callable[[Path], object]:
    def read(_folder: Path) -> None:
        raise error

    return read


@pytest.mark.parametrize(
    ("read", "kind"),
    [
        (_raise(ValueError("x")), "ValueError at "),
        (_raise(RecursionError()), "RecursionError at "),
        (_raise(OSError("nothing says of which file")), "OSError at "),
        (_raise(WrongAcceptanceError("a false key")), "WrongAcceptanceError at "),
        (_raise(VestigeError("")), "VestigeError not in one line"),
        (lambda _: bytearray(2 * engine.MOST_MEMORY_BYTES), "MemoryError at "),
        (lambda _: warnings.warn("numbers that overflow", RuntimeWarning, stacklevel=1), "RuntimeWarning at "),
    ],
)
def test_a_wrong_answer_is_found(read: Callable[[Path], object], kind: str) -> None:
    finding = examine(_target(read), FILES)
    assert finding is not None
    assert finding.kind.startswith(kind)


@pytest.mark.parametrize("read", [lambda _: time.sleep(60), _endless_match, lambda folder: (folder / "b").open("rb")])
def test_a_hang_is_found(read: Callable[[Path], object], monkeypatch: pytest.MonkeyPatch) -> None:
    """Also in a regular expression, and where nobody writes into a pipe."""
    monkeypatch.setattr(engine, "LONGEST_S", 0.2)
    finding = examine(_target(read), FILES | {"b": Special.FIFO})
    assert finding is not None
    assert finding.kind.startswith("_HangError at ")


@pytest.mark.parametrize("read", [lambda _: None, _raise(InputFileError("a.csv", "line 1", "1", "2"))])
def test_a_right_answer_is_no_finding(read: Callable[[Path], object]) -> None:
    assert examine(_target(read), FILES) is None


def test_an_input_is_the_same_again() -> None:
    for target in TARGETS:
        if target.name in {"recs", "corrections", "observations"}:
            assert target.input(7, 3) == target.input(7, 3)
            assert len({repr(target.input(7, number)) for number in range(20)}) > 10


def test_a_finding_is_kept_and_run_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = FILES | {"b": Special.SPARSE, "c": b"\xff\x00"}
    finding = examine(_target(_raise(ValueError("x"))), files)
    assert finding is not None
    path = save(finding, tmp_path)
    assert load(path) == ("recs", files)
    assert main(["--replay", str(path)]) == 0  # the reader of RECS refuses it in one line
    assert "nothing wrong" in capsys.readouterr().out
