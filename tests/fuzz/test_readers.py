"""2,000 spoiled inputs for all readers of what comes from outside; `make fuzz` gives them 100,000 (`__main__.py`)."""

from __future__ import annotations

import ast
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType

import pytest
from jaxtyping import config

from fuzz.engine import Target, examine, place, save, shares
from fuzz.targets import TARGETS

N_INPUTS, SEED = 2000, 1
SOURCE = Path(__file__).resolve().parents[2] / "src" / "vestige"
KEPT = Path(__file__).resolve().parents[2] / "build" / "fuzz"

# Calls that get at bytes from outside: functions, and methods of a path.
FUNCTIONS = frozenset({
    "open", "os.open", "os.read", "read_bytes", "open_file", "list_folder", "numbered_lines", "GrowingLines",
    "np.fromfile", "np.load", "np.loadtxt", "np.genfromtxt", "np.memmap", "json.load", "json.loads", "tomllib.load",
    "tomllib.loads", "csv.reader", "csv.DictReader", "ElementTree.fromstring", "zarr.open_group", "xarray.open_zarr",
    "xarray.open_dataset",
})  # fmt: skip
METHODS = frozenset({"read_bytes", "read_text", "open", "iterdir", "glob", "rglob"})
# Functions with such a call that are no readers of what comes from outside, and why.
_PACKAGE = "a file of the package itself"
_OWN = "what the same call has just written"
_LEFT = "what a killed process of the same user left in a folder that nobody else can write"
INSIDE = {
    "cli/campaigns/threats.py: _begun_ids": _PACKAGE,
    "kernel_cache.py: _kernels": _PACKAGE,
    "source_version.py: source_digest": _PACKAGE,
    "cli/start/demo.py: _encrypt_under_the_next_key": "what the demonstration has just written",
    "cli/start/init.py: command": _PACKAGE,
    "cli/start/init.py: write_scenarios": _PACKAGE,
    "scenario/shipped.py: shipped_scenarios": _PACKAGE,
    "cli/recordings/process_options.py: check_named_inputs": "the readers of keys and trees, which other targets try",
    "cli/recordings/searches/search.py: _log": "`SearchLog.open`, which the target `search-log` tries",
    "cli/recordings/simulate.py: _to_pipe": "the null device, to write to",
    "own_parts.py: _digest": "a file that the user names with --parts, which is run as it is",
    "recording/assistance/made_recs.py: make_assistance": _OWN,
    "recording/outputs/position_file.py: PositionFile.__init__": "compares head and tail with its own",
    "recording/samples/sigmf_writer.py: SigmfWriter.__init__": _LEFT,
    "report/page.py: _part": _PACKAGE,
    "simulated/simulated_recording.py: SimulatedRecording.write": _OWN,
    "simulated/unfinished_recording.py: _remove_all_but_samples": _LEFT,
    "simulated/unfinished_recording.py: _samples_left": _LEFT,
    "signals/codes.py: _section": _PACKAGE,
}


@pytest.fixture(autouse=True)
def _as_users_have_it() -> Iterator[None]:
    """Array shapes are not checked here: a reader answers as it does outside of tests, and as fast."""
    config.update("jaxtyping_disable", True)
    yield
    config.update("jaxtyping_disable", False)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_spoiled_inputs_are_refused_in_one_line_or_taken_rightly(target: Target) -> None:
    for number in range(shares(TARGETS, N_INPUTS)[target.name]):
        finding = examine(target, target.input(SEED, number))
        if finding is not None:
            again = f"make fuzz REPLAY={save(finding, KEPT)}"
            pytest.fail(f"input {number}: {finding.kind}; again: {again}\n{finding.detail}", pytrace=False)


def test_every_function_that_reads_from_outside_is_tried(tmp_path: Path) -> None:
    """A new reader needs a target, or a reason in `INSIDE`. Inputs are right before they are spoiled."""
    called: dict[int, CodeType] = {}

    def note(frame: FrameType, _event: str, _argument: object) -> None:
        called[id(frame.f_code)] = frame.f_code  # and no more of this call

    for target in TARGETS:
        for number, files in enumerate(target.corpus):
            folder = tmp_path / f"{target.name} {number}"
            folder.mkdir()
            place(files, folder)
            before = sys.gettrace()
            threading.settrace(note)
            sys.settrace(note)
            try:
                target.read(folder)
            finally:
                sys.settrace(before)
                threading.settrace(before)  # type: ignore[arg-type]
    tried = {_name(code) for code in called.values()}
    readers = set(_readers())
    assert sorted(readers - tried - INSIDE.keys()) == [], "these read, and no target gives them an input"
    assert sorted(INSIDE.keys() - readers) == [], "these read nothing any more"


def _name(code: CodeType) -> str:
    path = Path(code.co_filename)
    inside = path.relative_to(SOURCE).as_posix() if path.is_relative_to(SOURCE) else ""
    return f"{inside}: {code.co_qualname.replace('.<locals>', '')}"


def _readers() -> Iterator[str]:
    """Yield each function of vestige that gets at bytes from outside."""
    for path in sorted(SOURCE.rglob("*.py")):
        for name, node in _functions(ast.parse(path.read_text(encoding="utf-8")), ()):
            if any(_reads(call) for call in ast.walk(node) if isinstance(call, ast.Call)):
                yield f"{path.relative_to(SOURCE).as_posix()}: {name}"


def _functions(node: ast.AST, names: tuple[str, ...]) -> Iterator[tuple[str, ast.AST]]:
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, ast.FunctionDef | ast.ClassDef):
            if isinstance(inner, ast.FunctionDef):
                yield ".".join((*names, inner.name)), inner
            yield from _functions(inner, (*names, inner.name))


def _reads(call: ast.Call) -> bool:
    name, _, method = ast.unparse(call.func).rpartition(".")
    modes = [one.value for one in call.args if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    if method == "open" and any(mode[:1] in {"w", "a", "x"} for mode in modes):
        return False
    return f"{name}.{method}".lstrip(".") in FUNCTIONS or (bool(name) and method in METHODS)
