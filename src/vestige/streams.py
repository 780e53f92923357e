"""Make named streams of random numbers; equal seed and labels give equal streams, in any order of use.

There is no global generator and no seed per worker. Labels give the purpose of the numbers, and the epoch or satellite,
as in `stream(seed, "multipath", epoch)`.
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream_key(seed: int, *labels: str | int) -> bytes:
    """Return the 32-byte key of a stream, which is the SHA-256 of seed and labels."""
    text = "\x1f".join(f"{type(label).__name__}:{label}" for label in (seed, *labels))
    return hashlib.sha256(text.encode()).digest()


def stream(seed: int, *labels: str | int) -> np.random.Generator:
    """Return the random generator of the stream with `seed` and `labels`.

    Philox is counter based, so streams with different keys do not overlap.
    """
    key = np.frombuffer(stream_key(seed, *labels)[:16], dtype="<u8")
    return np.random.Generator(np.random.Philox(key=key))
