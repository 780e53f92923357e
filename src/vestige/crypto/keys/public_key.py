"""Define the public keys that verify OSNMA's root keys, and the basis of the trust in each public key.

A key from a public key file or a Merkle tree file is a `ClaimedPublicKey`, which cannot verify signatures. A claimed
key becomes a `PublicKey` in either of two ways. `merkle_tree.verify_public_key` shows that the key is a leaf of the
Merkle tree whose root the user trusts. With `trusted_by_user`, a user without a Merkle tree takes the responsibility
for the key. For a key from a signal, `merkle_tree.verify_broadcast_key` verifies the DSM-PKR and returns a `PublicKey`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature

from vestige.crypto.keys.signature_scheme import scheme_of_curve, scheme_of_point
from vestige.errors import AuthenticationError


class Trust(Enum):
    """Basis of the trust in a public key."""

    MERKLE_TREE = "verified against the Merkle tree root"
    USER = "trusted because it was given; not checked against a Merkle tree"


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimedPublicKey:
    """A public key that is not yet verified, for example from a file."""

    pkid: int | None  # number of the key, PKID 0 to 15; None if the source does not give it (PEM)
    leaf: int | None  # index 0 to 15 of the leaf in the Merkle tree; None if the source does not give it
    point: bytes  # compressed point on P-256, 33 bytes, or on P-521, 67 bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicKey:
    """A public key that may be used, made by the functions of `merkle_tree` or by `trusted_by_user`."""

    pkid: int | None  # number of the key; None for a PEM key without a Merkle tree, which fits any PKID
    point: bytes
    trust: Trust
    message: bytes = field(default=b"", compare=False, repr=False)  # DSM-PKR with the key; empty without a DSM-PKR

    def verify(self, message: bytes, signature: bytes) -> None:
        """Verify the signature of a message with this key; the signature consists of r and s.

        The function raises `AuthenticationError` if `signature` is not a signature of `message` with this key.
        """
        scheme = scheme_of_point(self.point)
        if len(signature) != scheme.signature_bytes:
            raise AuthenticationError(
                f"the signature has {len(signature)} bytes; {self} signs with {scheme.signature_bytes}, {scheme.name}"
            )
        half = scheme.coordinate_bytes
        r, s = int.from_bytes(signature[:half], "big"), int.from_bytes(signature[half:], "big")
        try:
            load_point(self.point).verify(encode_dss_signature(r, s), message, ec.ECDSA(scheme.hash))
        except InvalidSignature:
            raise AuthenticationError(f"the signature does not verify with {self}") from None

    def __str__(self) -> str:
        number = "public key" if self.pkid is None else f"public key PKID {self.pkid}"
        return f"{number} ({self.point.hex()[:16]}…, {self.trust.value})"


def load_point(point: bytes) -> ec.EllipticCurvePublicKey:
    """Return the key of a compressed point, whose length determines the curve.

    The function raises `AuthenticationError` if the bytes are not a point on P-256 or P-521.
    """
    scheme = scheme_of_point(point)
    try:
        return ec.EllipticCurvePublicKey.from_encoded_point(scheme.curve, point)
    except ValueError:
        raise AuthenticationError(f"{point.hex()} is not a point on the curve {scheme.curve_name}") from None


def compressed_point(key: ec.EllipticCurvePublicKey) -> bytes:
    """Return the compressed point of a P-256 or P-521 key, 33 or 67 bytes."""
    scheme = scheme_of_curve(key.curve)
    if scheme is None:
        raise ValueError(f"{key.curve.name} is no curve of OSNMA")
    x, y = key.public_numbers().x, key.public_numbers().y
    return bytes([2 + (y & 1)]) + x.to_bytes(scheme.coordinate_bytes, "big")


def trusted_by_user(claim: ClaimedPublicKey) -> PublicKey:
    """Accept a claimed public key without a Merkle tree, because the user trusts the key, and return the accepted key.

    The function raises `AuthenticationError` if the key is not a point on the curve.
    """
    load_point(claim.point)
    return PublicKey(pkid=claim.pkid, point=claim.point, trust=Trust.USER)
