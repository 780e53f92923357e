"""Make named streams of random numbers; equal seed and labels give equal streams, in any order of use.

There is no global generator and no seed per worker. The first label gives the purpose of the numbers. Further labels
can give an epoch or a satellite, as in `stream(seed, "multipath", epoch)`.
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

    Philox is a counter-based generator, whose streams with different keys are statistically independent.
    """
    key = np.frombuffer(stream_key(seed, *labels)[:16], dtype="<u8")
    return np.random.Generator(np.random.Philox(key=key))
