"""Draw secrets of an operator from one seed, so that a run can be repeated bit for bit."""

from __future__ import annotations

import hashlib

from cryptography.hazmat.primitives.asymmetric import ec

from vestige.crypto.keys.signature_scheme import P256

_P256_ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551  # [FIPS 186-4, D.1.2.3]
_MAX_BYTES = 32


def draw_bytes(seed: bytes, name: str, n_bytes: int) -> bytes:
    """Return bytes that follow from a seed and from the name of their purpose.

    Parameters
    ----------
    seed
        Any bytes. The result is secret only if the seed is secret.
    name
        Purpose of the bytes. Different names give independent bytes.
    n_bytes
        Number of bytes, 0 to 32.

    Raises
    ------
    ValueError
        If `n_bytes` is outside 0 to 32.

    Examples
    --------
    >>> draw_bytes(b"seed", "alpha", 6) == draw_bytes(b"seed", "alpha", 6)
    True
    >>> draw_bytes(b"seed", "alpha", 6) == draw_bytes(b"seed", "last key", 6)
    False
    """
    if not 0 <= n_bytes <= _MAX_BYTES:
        raise ValueError(f"{n_bytes} bytes cannot be drawn at once, {_MAX_BYTES} at most")
    return hashlib.sha256(b"vestige simulated OSNMA chain\0" + name.encode() + b"\0" + seed).digest()[:n_bytes]


def draw_private_key(seed: bytes, name: str) -> ec.EllipticCurvePrivateKey:
    """Return a private key on P-256 that follows from a seed and from the name of its purpose.

    Parameters
    ----------
    seed
        Any secret bytes.
    name
        Purpose of the key.

    Examples
    --------
    >>> draw_private_key(b"seed", "private key").curve.name
    'secp256r1'
    """
    secret = 1 + int.from_bytes(draw_bytes(seed, name, 32), "big") % (_P256_ORDER - 1)
    return ec.derive_private_key(secret, P256.curve)
