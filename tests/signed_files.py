"""Signed RECS and BGD files: a server signs each of its files, and a receiver looks for signatures beside a file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec

from vestige.crypto.file_bytes import read_bytes
from vestige.crypto.recs.file_signature import SignatureStatus, signatures_in, verify_data
from vestige.crypto.recs.recs_file import MAX_RECS_FILE_BYTES

HASHES = {"p256": hashes.SHA256(), "p384": hashes.SHA384(), "p521": hashes.SHA512()}


def sign(path: Path, private_key: ec.EllipticCurvePrivateKey, *, certificate: int = 1) -> Path:
    """Write the signature of a file beside it, and return its path; `certificate` is KN, 0 … 99."""
    curve = f"p{private_key.curve.key_size}"
    beside = path.with_name(f"{path.name}_{certificate:02d}.{curve}")
    beside.write_bytes(private_key.sign(path.read_bytes(), ec.ECDSA(HASHES[curve])))
    return beside


def sign_files(paths: Iterable[Path], private_key: ec.EllipticCurvePrivateKey) -> None:
    """Sign those of the files that a server signs."""
    for path in paths:
        if path.suffix in {".bin", ".RCS", ".BGD"}:
            sign(path, private_key)


def verify_file(path: Path, public_keys: Sequence[ec.EllipticCurvePublicKey] = ()) -> SignatureStatus:
    """Return the status of a file from the signatures beside it."""
    data = read_bytes(path, at_most=MAX_RECS_FILE_BYTES)
    return verify_data(data, path, signatures_in(path.parent).get(path.name, ()), public_keys)
