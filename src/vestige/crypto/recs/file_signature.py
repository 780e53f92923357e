"""Verify the signatures of assistance files, which prove the origin of a RECS or BGD file.

A server writes a signature file `<file>_KN.pXXX` beside each file [SASLIB]. KN is the number of the server's
certificate (01, 02 …), and pXXX is the curve (p256, p384, p521). After a key's disclosure anybody can make a RECS that
decrypts to chosen chips. So only the signature proves the origin of a RECS that was downloaded after the disclosure.

The service has published neither the choice of the signed bytes nor the chain of the certificates. So vestige makes
these assumptions:

* The algorithm is ECDSA over the whole file, with the hash that FIPS 186-5 pairs with the curve (SHA-256, SHA-384,
  SHA-512).
* The signature has the DER form of X9.62, or is r || s, the two numbers of the signature, each at the curve's length.
  vestige reads either form.
* The user has checked the certificates. vestige does not check chain, purpose or period of validity of certificates.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature
from cryptography.hazmat.primitives.serialization import load_pem_public_key
from cryptography.utils import CryptographyDeprecationWarning

from vestige.crypto.file_bytes import list_folder, read_bytes
from vestige.errors import AuthenticationError, InputFileError

_NAME = re.compile(r"(?P<signed>.+)_\d{2}\.(?:p256|p384|p521)", re.ASCII | re.DOTALL)

# suffix -> hash [FIPS 186-5], and length of r and of s in bytes [SEC 2]
_CURVES: dict[str, tuple[hashes.HashAlgorithm, int]] = {
    "p256": (hashes.SHA256(), 32),
    "p384": (hashes.SHA384(), 48),
    "p521": (hashes.SHA512(), 66),
}
_SUFFIX = {"secp256r1": "p256", "secp384r1": "p384", "secp521r1": "p521"}
_LONGEST_CERTIFICATE = 1 << 20


class SignatureStatus(Enum):
    """Status of a file's signature; a wrong signature is an `AuthenticationError`, not a status."""

    VERIFIED = "verified"
    NOT_SIGNED = "not signed"
    NO_CERTIFICATE = "signed, not verified: no certificate or public key for the signature was given"


def signatures_in(folder: Path) -> Mapping[str, tuple[Path, ...]]:
    """Return the signature files in `folder` by the name of the signed file, each group sorted by name.

    The function raises `InputFileError` if the folder cannot be listed.
    """
    found: dict[str, tuple[Path, ...]] = {}
    for path in list_folder(folder):
        if name := _NAME.fullmatch(path.name):
            found[name["signed"]] = (*found.get(name["signed"], ()), path)
    return found


def load_public_key(path: Path) -> ec.EllipticCurvePublicKey:
    """Return the public key in a PEM public key file or an X.509 certificate (PEM or DER).

    The function raises `InputFileError` if the file cannot be read or has another form, or if its key is not on P-256,
    P-384 or P-521.
    """
    data = read_bytes(path, at_most=_LONGEST_CERTIFICATE)
    try:
        with warnings.catch_warnings():
            # these warnings are about fields of certificates that vestige does not use
            warnings.simplefilter("ignore", CryptographyDeprecationWarning)
            if b"-----BEGIN PUBLIC KEY-----" in data:
                key = load_pem_public_key(data)
            elif b"-----BEGIN" in data:
                key = x509.load_pem_x509_certificate(data).public_key()
            else:
                key = x509.load_der_x509_certificate(data).public_key()
    except (ValueError, TypeError, UnsupportedAlgorithm, x509.InvalidVersion) as error:
        expected = "a PEM public key or an X.509 certificate (PEM or DER)"
        raise InputFileError(path, "file", f"{len(data)} bytes that cannot be read as one", expected) from error
    if not isinstance(key, ec.EllipticCurvePublicKey) or key.curve.name not in _SUFFIX:
        found = key.curve.name if isinstance(key, ec.EllipticCurvePublicKey) else type(key).__name__
        raise InputFileError(path, "public key", found, "an elliptic curve key of P-256, P-384 or P-521")
    return key


def verify_data(
    data: bytes, path: Path, signatures: Sequence[Path], public_keys: Sequence[ec.EllipticCurvePublicKey]
) -> SignatureStatus:
    """Verify the signatures of a file's `data`, and return the status of the signatures.

    A single signature that verifies with any key that the user trusts is enough.

    The function raises `AuthenticationError` if a key for the curve of a signature is given, but no signature verifies.
    The message of the `AuthenticationError` names `path`. The function raises `InputFileError` if a signature file
    cannot be read.
    """
    if not signatures:
        return SignatureStatus.NOT_SIGNED
    tried = False
    for signature_path in signatures:
        curve = signature_path.suffix.removeprefix(".")
        signature = read_bytes(signature_path, at_most=_LONGEST_CERTIFICATE)
        for key in public_keys:
            if _SUFFIX.get(key.curve.name) == curve:
                if _verifies(key, curve, signature, data):
                    return SignatureStatus.VERIFIED
                tried = True
    if tried:
        names = ", ".join(signature.name for signature in signatures)
        raise AuthenticationError(f"{path}: no given key verifies the signature {names} of this file")
    return SignatureStatus.NO_CERTIFICATE


def _verifies(key: ec.EllipticCurvePublicKey, curve: str, signature: bytes, data: bytes) -> bool:
    algorithm, size = _CURVES[curve]
    forms = [signature]
    if len(signature) == 2 * size:  # length of r || s; a DER signature rarely has this length
        r, s = (int.from_bytes(half, "big") for half in (signature[:size], signature[size:]))
        forms.append(encode_dss_signature(r, s))
    for form in forms:
        try:
            key.verify(form, data, ec.ECDSA(algorithm))
        except InvalidSignature:
            continue
        return True
    return False
