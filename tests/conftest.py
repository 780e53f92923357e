"""What every test may use. Array shapes and dtypes of all annotated functions are checked while the tests run."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings
from jaxtyping import install_import_hook

# Kernels are compiled by numba, which must see the plain functions; their callers are checked.
CHECKED = (
    "records",
    "time",
    "streams",
    "signals.codes",
    "signals.definitions",
    "signals.pulse",
    "crypto",
    "navigation",
    "recording",
    "acas_processor",
    "signal_generator.keystream",
    "signal_generator.range_model",
    "signal_generator.synthesis",
    "signal_generator.waveform",
    "receiver",
    "campaign",
    "plots",
    "sample_processor.correlator",
    "sample_processor.acquisition",
    "sample_processor.cn0",
    "sample_processor.e1_snapshot",
    "sample_processor.search.e1_search",
    "sample_processor.search.engine",
    "sample_processor.search.exact_cell",
    "sample_processor.search.exhaustive_search",
    "sample_processor.search.handover_search",
    "sample_processor.search.peak",
    "sample_processor.search.sample_source",
    "sample_processor.search.segment_engine",
    "sample_processor.search.speed",
)
_hook = install_import_hook([f"vestige.{name}" for name in CHECKED], "strict_types.check")

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
