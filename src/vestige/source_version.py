"""Return the version of vestige and the kind of CPU, which both affect the bits of results."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from llvmlite.binding import get_host_cpu_name

from vestige import __version__

PACKAGE = Path(__file__).resolve().parent


@cache
def vestige_version() -> str:
    """Return version and source digest of vestige, such as `0.2.0+source.1f2e3d4c5b6a`.

    The source digest is equal for equal source code.
    """
    return f"{__version__}+source.{source_digest(PACKAGE)}"


def source_digest(package: Path) -> str:
    """Return 12 hexadecimal digits of the SHA-256 of names and contents of all Python files of a package."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py"), key=lambda path: path.relative_to(package).as_posix()):
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(package).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()[:12]


def processor_name() -> str:
    """Return LLVM's name of this CPU, such as `znver3`.

    The kernels are compiled for this CPU. The vector instructions of the CPU determine the order in which the terms of
    a sum are added. So sums over samples can differ between kinds of CPU in the last digits of single precision.
    """
    return str(get_host_cpu_name())
