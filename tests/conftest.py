"""What every test may use. Array shapes and dtypes of annotated functions are checked while the quick tests run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import jaxtyping
import pytest
from hypothesis import settings

# Modules whose arrays are checked. What numba compiles must be plain functions; their callers are checked.
SOURCE = Path(__file__).resolve().parents[1] / "src"
# Tests of whole commands and campaigns: the arrays of the parts are checked in the tests of the parts.
WHOLE = tuple(Path(__file__).parent / folder for folder in ("cli", "unit/campaign", "unit/threats", "unit/report"))
UNIT = Path(__file__).parent / "unit"
UNCHECKED = ("cli", "scenario", "spoofer")  # no arrays in the first; pydantic checks the fields of the others


def _modules_with_arrays() -> list[str]:
    found = []
    for path in sorted((SOURCE / "vestige").rglob("*.py")):
        module, text = path.relative_to(SOURCE).with_suffix(""), path.read_text(encoding="utf-8")
        if module.parts[1] not in UNCHECKED and "jaxtyping" in text and "numba" not in text:
            found.append(".".join(module.parts))
    return found


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--unchecked-arrays", action="store_true", help="Do not check array shapes and dtypes.")


def pytest_configure(config: pytest.Config) -> None:
    if not config.getoption("--unchecked-arrays"):
        jaxtyping.install_import_hook(_modules_with_arrays(), "strict_types.check")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Check the arrays in a test and its fixtures, but not in one that simulates many epochs or runs commands.

    Searches of a unit test use the reference engine where they name none; those of longer tests a faster one. No test
    asks for a GPU but those of its engine.
    """
    from vestige.sample_processor.search.engines import choice

    choice.FASTEST_FIRST = ("fft",) if UNIT in item.path.parents else ("segment", "fft")
    many = item.get_closest_marker("many_epochs") is not None
    jaxtyping.config.update("jaxtyping_disable", many or item.path.parent in WHOLE)
    return (yield)


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
