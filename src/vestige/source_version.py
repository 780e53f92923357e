"""Version of vestige and kind of processor: both affect the bits of results beside the input."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from llvmlite.binding import get_host_cpu_name

from vestige import __version__

PACKAGE = Path(__file__).resolve().parent


@cache
def vestige_version() -> str:
    """Return version and digest of the source, `0.2.0+source.1f2e3d4c5b6a`: equal for equal code, wherever it lies."""
    return f"{__version__}+source.{source_digest(PACKAGE)}"


def source_digest(package: Path) -> str:
    """Return 12 hexadecimal digits of the SHA-256 of all Python files of a package, names included."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py"), key=lambda path: path.relative_to(package).as_posix()):
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(package).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()[:12]


def processor_name() -> str:
    """Return the name that LLVM has for this processor, `znver3`.

    The kernels are compiled for it: how many terms of a sum stand side by side depends on its vector instructions, so
    sums over samples differ in the last digits of single precision from one kind of processor to the other.
    """
    return str(get_host_cpu_name())
