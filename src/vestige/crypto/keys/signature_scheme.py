"""Define the two signature schemes of OSNMA, ECDSA P-256/SHA-256 and ECDSA P-521/SHA-512.

A public key is broadcast and published as a compressed point. A signature is broadcast as r and s, each as long as a
coordinate of the curve. So the length of a point or signature determines the scheme [OSNMA-ICD, DSM-KROOT, DSM-PKR].
"""

from __future__ import annotations

from dataclasses import dataclass

from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec

from vestige.errors import AuthenticationError, UnsupportedError


@dataclass(frozen=True, slots=True, kw_only=True)
class SignatureScheme:
    """A signature scheme of OSNMA."""

    key_type: int  # NPKT, the type of a new public key in a DSM-PKR and in a leaf of the Merkle tree
    name: str  # name of the scheme as the European GNSS Service Centre writes it
    curve_name: str  # name of the curve as the European GNSS Service Centre writes it
    curve: ec.EllipticCurve
    hash: hashes.HashAlgorithm
    coordinate_bytes: int  # size of a coordinate of the curve in bytes

    @property
    def point_bytes(self) -> int:
        """Length of a compressed point in bytes: a byte for the sign of y, and the coordinate x."""
        return 1 + self.coordinate_bytes

    @property
    def signature_bytes(self) -> int:
        """Length of a signature in bytes; a signature consists of r and s."""
        return 2 * self.coordinate_bytes


P256 = SignatureScheme(
    key_type=1, name="ECDSA P-256/SHA-256", curve_name="P-256",
    curve=ec.SECP256R1(), hash=hashes.SHA256(), coordinate_bytes=32,
)  # fmt: skip
P521 = SignatureScheme(
    key_type=3, name="ECDSA P-521/SHA-512", curve_name="P-521",
    curve=ec.SECP521R1(), hash=hashes.SHA512(), coordinate_bytes=66,
)  # fmt: skip
SCHEMES = (P256, P521)
NAMES = " and ".join(scheme.name for scheme in SCHEMES)
_ALERT_TYPE = 4  # NPKT of an OSNMA alert message [OSNMA-ICD, DSM-PKR]


def scheme_of_type(key_type: int) -> SignatureScheme:
    """Return the signature scheme that belongs to a type of public key (NPKT).

    The function raises `UnsupportedError` if the type is reserved, or is the type of an alert message.
    """
    for scheme in SCHEMES:
        if scheme.key_type == key_type:
            return scheme
    reason = "OSNMA alert message: not a key" if key_type == _ALERT_TYPE else "reserved"
    known = ", ".join(f"{scheme.key_type} ({scheme.name})" for scheme in SCHEMES)
    raise UnsupportedError(f"public key type {key_type} ({reason}); supported are {known}")


def scheme_of_point(point: bytes) -> SignatureScheme:
    """Return the signature scheme to which a compressed point belongs; the length of the point determines the scheme.

    The function raises `AuthenticationError` if no curve has compressed points of this length.
    """
    for scheme in SCHEMES:
        if len(point) == scheme.point_bytes:
            return scheme
    lengths = " or ".join(f"{scheme.point_bytes} ({scheme.name})" for scheme in SCHEMES)
    raise AuthenticationError(f"{point.hex()[:16]}… is not a point: {len(point)} bytes, expected {lengths}")


def scheme_of_curve(curve: ec.EllipticCurve) -> SignatureScheme | None:
    """Return the signature scheme of OSNMA on a curve; None if OSNMA does not use the curve."""
    return next((scheme for scheme in SCHEMES if scheme.curve.name == curve.name), None)
