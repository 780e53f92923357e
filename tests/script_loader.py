"""Scripts of the repository as modules: benchmarks, of which tests run short versions, and the parts of the site."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

REPOSITORY = Path(__file__).resolve().parents[1]
BENCHMARKS = REPOSITORY / "benchmarks"


def benchmark(name: str) -> ModuleType:
    """Return the script `benchmarks/NAME.py` as a module, which workers can import from, too."""
    return script(BENCHMARKS / f"{name}.py", f"benchmark_{name}")


def script(path: Path, name: str) -> ModuleType:
    """Return a Python file as a module of this name."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
