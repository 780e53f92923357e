"""What every test may use. Array shapes and dtypes of all annotated functions are checked while the tests run."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings
from jaxtyping import install_import_hook

# What numba compiles must be plain functions; their callers are checked.
SOURCE = Path(__file__).resolve().parents[1] / "src"
UNCHECKED = ("cli", "scenario", "spoofer")  # no arrays in the first; pydantic checks the fields of the others
CHECKED = tuple(
    ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    for path in sorted((SOURCE / "vestige").rglob("*.py"))
    if path.relative_to(SOURCE / "vestige").parts[0] not in UNCHECKED
    and path.stem != "__init__"
    and "numba" not in path.read_text(encoding="utf-8")
)
_hook = install_import_hook(list(CHECKED), "strict_types.check")

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
