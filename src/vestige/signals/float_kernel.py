"""Provide float32 operations for compiled kernels: conversion to and from bits, and fused multiply-add.

A compiler that may fuse a product and a sum fuses them only on some machines. Without `fma`, the bits of a result would
therefore depend on the machine. `fma` is fused on every machine. On a CPU without an instruction for fused
multiply-add, `fma` calls the C library, which is slow but exact.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from vestige.kernel_cache import njit


@njit(inline="always")
def bits_of(value):
    """Return the bits of a float32 as int32."""
    return np.float32(value).view(np.int32)


@njit(inline="always")
def float_of(bits):
    """Return the float32 that has the bits of an int32."""
    return np.int32(bits).view(np.float32)


def _fused(_context, x, y, z):
    if not x == y == z == types.float32:
        return None  # None makes numba report that the operation does not exist for these types

    def code(_context, builder, _signature, arguments):
        return builder.fma(*arguments)

    return types.float32(types.float32, types.float32, types.float32), code


# `fma` returns x y + z of three float32, rounded once, and works in compiled code only
fma: Any = intrinsic(_fused)
