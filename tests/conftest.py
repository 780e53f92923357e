"""What every test may use. Array shapes and dtypes of annotated functions are checked while tests run."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest
from hypothesis import settings

import strict_types

# Modules whose arrays are checked. What numba compiles must be plain functions; their callers are checked.
SOURCE = Path(__file__).resolve().parents[1] / "src"
UNIT = Path(__file__).parent / "unit"
# Folders of which every test is slow; elsewhere a mark says so: `make test` leaves the slow ones to `make test-slow`.
SLOW = tuple(Path(__file__).parent / folder for folder in ("agreement", "browser", "golden", "paper", "statistical"))
UNCHECKED = ("cli", "scenario", "spoofer")  # no arrays in the first; pydantic checks the fields of the others


def _modules_with_arrays() -> list[str]:
    found = []
    for path in sorted((SOURCE / "vestige").rglob("*.py")):
        module, text = path.relative_to(SOURCE).with_suffix(""), path.read_text(encoding="utf-8")
        if module.parts[1] not in UNCHECKED and "jaxtyping" in text and "njit" not in text and "numba" not in text:
            found.append(".".join(module.parts))
    return found


def pytest_configure() -> None:
    gc.disable()  # what is imported and collected lives as long as the process
    strict_types.install(_modules_with_arrays())


def pytest_collection_finish() -> None:
    """Exclude modules and test items from garbage collection: each full collection of them takes 0.3 s."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Begin to check arrays anew, and choose the engine of searches that name none.

    In a unit test that is the reference engine, in longer tests a faster one. No test asks for a GPU but those of its
    engine.
    """
    from vestige.sample_processor.search.engines import choice

    choice.FASTEST_FIRST = ("fft",) if UNIT in item.path.parents else ("segment", "fft")
    strict_types.begin_test()


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.parent in SLOW:
            item.add_marker("slow")


settings.register_profile("vestige", deadline=None, derandomize=True)
settings.load_profile("vestige")

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


def _shared(folder: str) -> Path:
    path = SHARED / folder
    if not path.is_dir():
        pytest.skip(f"needs the real data in shared/data/{folder}, which is not part of the source distribution")
    return path


@pytest.fixture(scope="session")
def osnma_data() -> Path:
    """Folder with the official OSNMA test vector and the recorded OSNMA messages."""
    return _shared("osnma")


@pytest.fixture(scope="session")
def recording_data() -> Path:
    """Folder with the real simultaneous E1 and E6 samples."""
    return _shared("recording")


@pytest.fixture(scope="session")
def code_tables() -> Path:
    """Folder with the published code tables as text."""
    return _shared("codes")
