"""The decorator of all kernels, whose machine code is compiled anew as soon as any kernel has changed.

numba keeps the machine code of a function on disk and compiles it again if the function's own module has changed. It
does not look at the modules whose functions it has built in. After an update of vestige such a function would go on
with old code for tables of a new layout, and say nothing: E1 tracking once lost its satellites that way. So the mark by
which numba knows old code is made of all kernels here: the newest change and the size of all of them together.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba

from vestige.source_version import PACKAGE

# Modules whose functions others build in; a kernel elsewhere is for its own module only.
KERNELS = ("*_kernel.py", "vector_ir.py")


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return `numba.njit` with these options, which keeps machine code no longer than all kernels stay as they are.

    Parameters
    ----------
    options
        Options of `numba.njit`. Without `cache=True` nothing is kept on disk.

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
        if kept is not None:  # no cache was asked for, or numba compiles nothing
            kept._source_stamp = source_mark(PACKAGE, function.__code__.co_filename)
        return kernel

    return compiled


@cache
def source_mark(package: Path, module: str) -> tuple[int, int]:
    """Return the time of the newest change in ns, and the size in bytes, of all kernels of a package and one module."""
    paths = {path for pattern in KERNELS for path in package.rglob(pattern)} | {Path(module)}
    stats = [path.stat() for path in paths]
    return max(one.st_mtime_ns for one in stats), sum(one.st_size for one in stats)
