"""Machine code of kernels on disk is used as long as no kernel has changed, and no longer."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import vestige.kernel_cache
from vestige.kernel_cache import KERNELS, PACKAGE, source_mark

TWO_MODULES = """\
import sys
from pathlib import Path
import vestige.kernel_cache as kernel_cache
kernel_cache.PACKAGE = Path({folder!r})
sys.path.insert(0, {folder!r})
from caller import outer
print(outer(1), len(outer.stats.cache_hits))
"""
INNER = "from vestige.kernel_cache import njit\n@njit(cache=True)\ndef inner(x):\n    return x + {term}\n"
OUTER = """\
from inner_kernel import inner
from vestige.kernel_cache import njit
@njit(cache=True)
def outer(x):
    return 10 * inner(x)
"""


def printed(folder: Path) -> list[str]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kept")}
    environment.pop("NUMBA_DISABLE_JIT", None)
    program = TWO_MODULES.format(folder=str(folder))
    return subprocess.run(  # noqa: S603
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    ).stdout.split()


def test_a_change_in_a_function_that_is_built_in_is_compiled(tmp_path: Path) -> None:
    inner, outer = tmp_path / "inner_kernel.py", tmp_path / "caller.py"
    inner.write_text(INNER.format(term=1))
    outer.write_text(OUTER)
    assert printed(tmp_path) == ["20", "0"]
    assert printed(tmp_path) == ["20", "1"]  # from the disk
    inner.write_text(INNER.format(term=2))
    assert printed(tmp_path) == ["30", "0"]


def test_the_mark_is_that_of_all_kernels(tmp_path: Path) -> None:
    kernel, module = tmp_path / "a_kernel.py", tmp_path / "b.py"
    for path, time_ns in ((kernel, 2_000), (module, 1_000)):
        path.write_text("four")
        os.utime(path, ns=(time_ns, time_ns))
    assert source_mark(tmp_path, str(module)) == (2_000, 8)


def test_code_that_is_written_for_llvm_counts_as_a_kernel() -> None:
    """Kernels inline it, so a change must make their stored machine code invalid."""
    written = [path for path in PACKAGE.rglob("*.py") if "from llvmlite import ir" in path.read_text()]
    assert written
    assert [path for path in written if not any(path.match(pattern) for pattern in KERNELS)] == []


def test_every_kernel_has_this_decorator() -> None:
    """No module takes the decorator from numba itself."""
    sources = [path for path in PACKAGE.rglob("*.py") if path != Path(vestige.kernel_cache.__file__)]
    assert [
        path for path in sources if "numba import njit" in path.read_text() or "numba.njit" in path.read_text()
    ] == []
