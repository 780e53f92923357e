"""Signatures of assistance files, which prove the origin of a RECS or BGD file.

A server writes `<file>_KN.pXXX` beside each file: KN is the number of its certificate (01, 02 …) and pXXX the curve
(p256, p384, p521) [SASLIB]. After a key's disclosure anybody can make a RECS that decrypts to chosen chips. So only the
signature proves a RECS that was downloaded late.

Assumptions, since neither the signed bytes nor the certificate chain are public:

* ECDSA over the whole file, with the hash that FIPS 186-5 pairs with the curve (SHA-256, SHA-384, SHA-512).
* The signature is the DER of X9.62, or r || s at the curve's length. vestige reads both and writes DER.
* The user vouches for the certificates: their chain, purpose and period of validity are not checked.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from vestige.crypto.recs.recs_file import MAX_RECS_FILE_BYTES
from vestige.errors import AuthenticationError, InputFileError

_NAME = re.compile(r"(?P<signed>.+)_(?P<certificate>\d{2})\.(?P<curve>p256|p384|p521)", re.ASCII | re.DOTALL)

# suffix -> hash [FIPS 186-5] and bytes of r and of s [SEC 2]
_CURVES: dict[str, tuple[hashes.HashAlgorithm, int]] = {
    "p256": (hashes.SHA256(), 32),
    "p384": (hashes.SHA384(), 48),
    "p521": (hashes.SHA512(), 66),
}
_SUFFIX = {"secp256r1": "p256", "secp384r1": "p384", "secp521r1": "p521"}
_LONGEST_CERTIFICATE = 1 << 20


class SignatureStatus(Enum):
    """Status of a file's signature. A wrong signature is an `AuthenticationError`, not a status."""

    VERIFIED = "verified"
    NOT_SIGNED = "not signed"
    NO_CERTIFICATE = "signed, not verified: no certificate or public key for the signature was given"


@dataclass(frozen=True, slots=True, kw_only=True)
class SignatureName:
    """Name of a signature file: name of the signed file, number of the certificate, and curve (`p256` …)."""

    signed: str
    certificate: int
    curve: str

    def __str__(self) -> str:
        return f"{self.signed}_{self.certificate:02d}.{self.curve}"


def parse_signature_name(name: str) -> SignatureName | None:
    """Return the fields of a signature's file name; None if the name has another form."""
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    return SignatureName(signed=match["signed"], certificate=int(match["certificate"]), curve=match["curve"])


def signatures_in(folder: Path) -> Mapping[str, tuple[Path, ...]]:
    """Return the signatures in `folder`, sorted by name, by the name of the signed file.

    Raises `InputFileError` if the folder cannot be listed.
    """
    found: dict[str, tuple[Path, ...]] = {}
    for path in list_folder(folder):
        if name := parse_signature_name(path.name):
            found[name.signed] = (*found.get(name.signed, ()), path)
    return found


def load_public_key(path: Path) -> ec.EllipticCurvePublicKey:
    """Return the public key in a PEM public key file or an X.509 certificate (PEM or DER).

    Raises `InputFileError` if the file is neither, or its key is not on P-256, P-384 or P-521.
    """
    data = read_bytes(path, at_most=_LONGEST_CERTIFICATE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CryptographyDeprecationWarning)  # concerns fields that are not used here
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


def sign(path: Path, private_key: ec.EllipticCurvePrivateKey, *, certificate: int = 1) -> Path:
    """Sign the file `path` as a server does, write the signature beside the file, and return its path.

    `certificate` is KN, the number of the certificate, 0 … 99.
    """
    curve = _SUFFIX[private_key.curve.name]
    name = SignatureName(signed=path.name, certificate=certificate, curve=curve)
    signature = private_key.sign(path.read_bytes(), ec.ECDSA(_CURVES[curve][0]))
    (path.parent / str(name)).write_bytes(signature)
    return path.parent / str(name)


def verify_file(path: Path, public_keys: Sequence[ec.EllipticCurvePublicKey] = ()) -> SignatureStatus:
    """Return the signature status of the file `path`, from the signatures beside the file.

    See `verify_data` for parameters and errors.
    """
    data = read_bytes(path, at_most=MAX_RECS_FILE_BYTES)
    return verify_data(data, path, signatures_in(path.parent).get(path.name, ()), public_keys)


def verify_data(
    data: bytes, path: Path, signatures: Sequence[Path], public_keys: Sequence[ec.EllipticCurvePublicKey]
) -> SignatureStatus:
    """Return whether the signatures of a file prove the origin of its `data`.

    A single signature that verifies with any key that the user trusts is enough. Messages name `path`.

    Raises `AuthenticationError` if there are signatures of a curve for which a key is given, and none of them verifies.
    Raises `InputFileError` if a signature cannot be read.
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
        raise AuthenticationError(f"{path}: the signature {names} is not one of this file by a given key")
    return SignatureStatus.NO_CERTIFICATE


def _verifies(key: ec.EllipticCurvePublicKey, curve: str, signature: bytes, data: bytes) -> bool:
    algorithm, size = _CURVES[curve]
    forms = [signature]
    if len(signature) == 2 * size:  # r || s has this length; a DER signature rarely has it too
        r, s = (int.from_bytes(half, "big") for half in (signature[:size], signature[size:]))
        forms.append(encode_dss_signature(r, s))
    for form in forms:
        try:
            key.verify(form, data, ec.ECDSA(algorithm))
        except InvalidSignature:
            continue
        return True
    return False
