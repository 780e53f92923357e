from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from signed_files import sign, verify_file
from vestige.crypto.recs import file_signature
from vestige.crypto.recs.file_signature import SignatureStatus
from vestige.errors import AuthenticationError, InputFileError, VestigeError

CURVES: dict[str, ec.EllipticCurve] = {"p256": ec.SECP256R1(), "p384": ec.SECP384R1(), "p521": ec.SECP521R1()}
PRIVATE = {name: ec.derive_private_key(0x1234567, curve) for name, curve in CURVES.items()}
OTHER = ec.derive_private_key(0x7654321, CURVES["p256"])
SIZE = {"p256": 32, "p384": 48, "p521": 66}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "GSCX01_232280500160_11_0_0_01.RCS"
    path.write_bytes(b"any content" * 100)
    return path


def certificate(private_key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey) -> x509.Certificate:
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "assistance server")])
    start = datetime(2023, 8, 16, tzinfo=UTC)
    builder = x509.CertificateBuilder(name, name, private_key.public_key(), 1, start, start.replace(year=2024))
    return builder.sign(private_key, hashes.SHA256())


A_CERTIFICATE = certificate(PRIVATE["p256"]).public_bytes(Encoding.DER)


@pytest.mark.parametrize("curve", CURVES)
def test_signed_file_is_verified(file: Path, curve: str) -> None:
    signature = sign(file, PRIVATE[curve], certificate=2)
    assert signature.name == f"{file.name}_02.{curve}"
    assert verify_file(file, [PRIVATE[curve].public_key()]) is SignatureStatus.VERIFIED


@pytest.mark.parametrize("curve", CURVES)
def test_signature_as_two_plain_integers(file: Path, curve: str) -> None:
    signature = sign(file, PRIVATE[curve])
    r, s = decode_dss_signature(signature.read_bytes())
    signature.write_bytes(r.to_bytes(SIZE[curve], "big") + s.to_bytes(SIZE[curve], "big"))
    assert verify_file(file, [PRIVATE[curve].public_key()]) is SignatureStatus.VERIFIED
    signature.write_bytes(bytes(2 * SIZE[curve]))
    with pytest.raises(AuthenticationError):
        verify_file(file, [PRIVATE[curve].public_key()])


def test_what_is_said_without_signature_or_key(file: Path) -> None:
    key = PRIVATE["p256"].public_key()
    assert verify_file(file, [key]) is SignatureStatus.NOT_SIGNED
    sign(file, PRIVATE["p256"])
    assert verify_file(file) is SignatureStatus.NO_CERTIFICATE
    assert verify_file(file, [PRIVATE["p384"].public_key()]) is SignatureStatus.NO_CERTIFICATE


@pytest.mark.parametrize("damage", ["file", "signature", "key", "empty"])
def test_anything_wrong_is_an_authentication_error(file: Path, damage: str) -> None:
    signature = sign(file, PRIVATE["p256"])
    key = (OTHER if damage == "key" else PRIVATE["p256"]).public_key()
    if damage == "file":
        file.write_bytes(file.read_bytes()[:-1] + b"?")
    elif damage == "signature":
        signature.write_bytes(signature.read_bytes()[:-1] + bytes([signature.read_bytes()[-1] ^ 1]))
    elif damage == "empty":
        signature.write_bytes(b"")
    with pytest.raises(AuthenticationError, match="no given key verifies the signature"):
        verify_file(file, [key])


def test_one_of_several_signatures_is_enough(file: Path) -> None:
    sign(file, OTHER, certificate=1)
    sign(file, PRIVATE["p384"], certificate=1)
    sign(file, PRIVATE["p256"], certificate=2)
    assert verify_file(file, [PRIVATE["p256"].public_key()]) is SignatureStatus.VERIFIED
    names = [path.name for path in file_signature.signatures_in(file.parent)[file.name]]
    assert names == [f"{file.name}_01.p256", f"{file.name}_01.p384", f"{file.name}_02.p256"]


@pytest.mark.parametrize("signed", ["a.bin", "a\nb", "a.bin_01.p256", "_", "\u0661_é"])
def test_a_signature_names_its_file(tmp_path: Path, signed: str) -> None:
    (tmp_path / f"{signed}_00.p521").touch()
    assert file_signature.signatures_in(tmp_path) == {signed: (tmp_path / f"{signed}_00.p521",)}


@pytest.mark.parametrize(
    "name", ["a.bin", "a.bin_1.p256", "a.bin_01.p224", "_01.p256", "a.bin_01.p256.txt", "a_\u0661\u0661.p256"]
)
def test_other_names_are_no_signatures(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    assert file_signature.signatures_in(tmp_path) == {}


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("form", ["public key", "PEM certificate", "DER certificate"])
def test_public_key_is_read_from(tmp_path: Path, curve: str, form: str) -> None:
    public, path = PRIVATE[curve].public_key(), tmp_path / "key"
    forms = {
        "public key": lambda: public.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo),
        "PEM certificate": lambda: certificate(PRIVATE[curve]).public_bytes(Encoding.PEM),
        "DER certificate": lambda: certificate(PRIVATE[curve]).public_bytes(Encoding.DER),
    }
    path.write_bytes(forms[form]())
    assert file_signature.load_public_key(path).public_numbers() == public.public_numbers()


def test_other_kinds_of_key_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "key.pem"
    path.write_bytes(certificate(rsa.generate_private_key(65537, 2048)).public_bytes(Encoding.PEM))
    with pytest.raises(InputFileError, match="found RSAPublicKey, expected an elliptic curve key"):
        file_signature.load_public_key(path)
    key = ec.generate_private_key(ec.SECP256K1()).public_key()
    path.write_bytes(key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    with pytest.raises(InputFileError, match="found secp256k1"):
        file_signature.load_public_key(path)


PEM_HEADS = (b"", b"-----BEGIN PUBLIC KEY-----\n", b"-----BEGIN CERTIFICATE-----\n")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(head=st.sampled_from(PEM_HEADS), data=st.binary(max_size=200))
def test_garbage_is_no_key(tmp_path: Path, head: bytes, data: bytes) -> None:
    path = tmp_path / "key"
    path.write_bytes(head + data)
    with pytest.raises(InputFileError) as caught:
        file_signature.load_public_key(path)
    assert "\n" not in str(caught.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=500)
@given(st.dictionaries(st.integers(0, 280), st.integers(0, 255), min_size=1, max_size=3), st.integers(0, 20))
def test_damaged_certificate_is_read_or_refused(tmp_path: Path, changes: dict[int, int], lost: int) -> None:
    der = bytearray(A_CERTIFICATE)
    for offset, value in changes.items():
        der[offset] = value
    path = tmp_path / "key.der"
    path.write_bytes(der[: len(der) - lost])
    key, message = None, ""
    try:
        key = file_signature.load_public_key(path)
    except VestigeError as error:
        message = str(error)
    assert isinstance(key, ec.EllipticCurvePublicKey) or message.startswith(str(path))
    assert "\n" not in message


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=140))
def test_garbage_is_no_signature(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"content")
    (tmp_path / "a.bin_01.p256").write_bytes(data)
    with pytest.raises(AuthenticationError):
        verify_file(path, [PRIVATE["p256"].public_key()])


VERSION_3, SERIAL_1 = b"\xa0\x03\x02\x01\x02", b"\x02\x01\x01"  # as a certificate has them, one after the other


def test_a_certificate_of_an_unknown_version_is_refused_and_one_without_a_serial_number_is_read(tmp_path: Path) -> None:
    path = tmp_path / "server.der"
    assert VERSION_3 + SERIAL_1 in A_CERTIFICATE
    path.write_bytes(A_CERTIFICATE.replace(VERSION_3, VERSION_3[:-1] + b"\x06"))
    with pytest.raises(InputFileError, match="bytes that cannot be read as one"):
        file_signature.load_public_key(path)
    path.write_bytes(A_CERTIFICATE.replace(VERSION_3 + SERIAL_1, VERSION_3 + b"\x02\x01\x00"))
    key = file_signature.load_public_key(path)
    assert key.public_numbers() == PRIVATE["p256"].public_key().public_numbers()
