"""Compile kernels (functions for numba), and recompile them after a change of inlined functions.

With `cache=True`, numba stores the machine code of a function on disk, and recompiles the function if its own module
has changed. numba ignores changes in modules whose functions are inlined. After an update of vestige, a kernel could
silently use old inlined functions on tables of a new layout. Old machine code once made E1 tracking lose its
satellites. numba recognises old code by a mark that is stored with the code. So this module computes the mark of a
kernel from its own file and from the files that match `KERNELS`. The mark consists of the time of the newest change and
the total size of the files.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba

from vestige.source_version import PACKAGE

# Patterns of the names of modules whose functions or table layouts other modules inline. A kernel in any other module
# is used only in that module.
KERNELS = ("packed_chips.py", "*_kernel.py", "*_vectors.py", "vector_ir.py", "vector_code.py")


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function by `numba.njit`, and marks its stored machine code by `source_mark`.

    Parameters
    ----------
    options
        Options of `numba.njit`. Without `cache=True` no machine code is stored on disk.

    Examples
    --------
    >>> @njit(nogil=True)
    ... def twice(x):
    ...     return 2 * x
    >>> twice(3)
    6
    """

    def compiled(function: Callable[..., Any]) -> Any:
        kernel = numba.njit(**options)(function)
        kept = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
        if kept is not None:  # `kept` is None if no cache was requested, or if numba is disabled
            kept._source_stamp = source_mark(PACKAGE, function.__code__.co_filename)
        return kernel

    return compiled


@cache
def source_mark(package: Path, module: str) -> tuple[int, int]:
    """Return the time of the newest change in ns and the total size in bytes of a module and the files of `KERNELS`."""
    stats = [path.stat() for path in _kernels(package) | {Path(module)}]
    return max(one.st_mtime_ns for one in stats), sum(one.st_size for one in stats)


@cache
def _kernels(package: Path) -> frozenset[Path]:
    """Return the files of a package that match `KERNELS`. The folders are listed only once."""
    return frozenset(path for pattern in KERNELS for path in package.rglob(pattern))
