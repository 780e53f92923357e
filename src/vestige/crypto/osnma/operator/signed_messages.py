"""Make the digital signature messages (DSM) of an operator: signed root keys, public keys and alert notices.

The signature of a DSM-KROOT also covers the NMA header that is broadcast with the DSM-KROOT. The signature is
deterministic, so the same seed gives the same bits [RFC6979].

A DSM-PKR is `NB 4 | leaf 4 | siblings 4 x 256 | type 4 | PKID 4 | point | padding` [OSNMA-ICD, DSM-PKR]. The padding of
a DSM-PKR is the start of SHA-256 of the root of the Merkle tree and the leaf's content. An alert notice fills the
DSM-PKR up to its end.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature

from vestige.constants import HOUR_S, SUBFRAME_S
from vestige.crypto.keys.merkle_tree import LEAF_AT
from vestige.crypto.keys.signature_scheme import scheme_of_curve, scheme_of_point
from vestige.crypto.osnma.messages.alert_message import ALERT_TYPE
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.dsm import DSM_BLOCK_BYTES, KROOT_BLOCKS, PKR_BLOCKS, DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.tesla import Key
from vestige.errors import VestigeError

_MIN_BLOCKS = min(KROOT_BLOCKS.values())
_WEEKS = 4096  # week numbers are sent modulo this number [OSNMA-ICD, DSM-KROOT]
_ALERT_NB = 7  # code of 13 blocks, which have room for a notice of `NOTICE_BYTES` bytes
NOTICE_BYTES = PKR_BLOCKS[_ALERT_NB] * DSM_BLOCK_BYTES - LEAF_AT - 1


def unsigned_kroot(root: Key, parameters: ChainParameters, *, chain_id: int, pkid: int) -> DsmKroot:
    """Return the DSM-KROOT of a root key, without signature and padding.

    Parameters
    ----------
    root
        Root key with a time that is 30 s before a full hour [OSNMA-ICD, DSM-KROOT].
    parameters
        Parameters of the key's chain.
    chain_id
        CIDKR, the number of the chain, 0 to 3.
    pkid
        PKID 0 to 15 of the public key for the verification of the signature.

    Raises
    ------
    ValueError
        If the time of the key is not 30 s before a full hour.
    """
    hour = root.time + SUBFRAME_S
    if hour.second % HOUR_S:
        raise ValueError(f"the time of a root key is 30 s before a full hour, not {root.time}")
    return DsmKroot(
        n_blocks=_MIN_BLOCKS,
        public_key_id=pkid,
        chain_id=chain_id,
        parameters=parameters,
        root_week=hour.week % _WEEKS,
        root_hour=hour.second // HOUR_S,
        root_key=root.data,
        signature=b"",
        padding=b"",
    )


def sign_kroot(kroot: DsmKroot, header: NmaHeader, private_key: ec.EllipticCurvePrivateKey) -> DsmKroot:
    """Return the DSM-KROOT with signature and padding, in the required number of blocks [OSNMA-ICD, 6.3].

    Parameters
    ----------
    kroot
        DSM-KROOT, whose own signature and padding are replaced.
    header
        NMA header that is broadcast with the DSM-KROOT. The signature covers the header, too.
    private_key
        Private key on P-256 or P-521.
    """
    scheme = scheme_of_curve(private_key.curve)
    assert scheme is not None  # noqa: S101  (ours)
    algorithm = ec.ECDSA(scheme.hash, deterministic_signing=True)
    numbers = decode_dss_signature(private_key.sign(kroot.signed_message(header), algorithm))
    signature = b"".join(number.to_bytes(scheme.coordinate_bytes, "big") for number in numbers)
    signed = replace(kroot, signature=signature, padding=b"")
    length = len(signed.serialise())
    n_blocks = max(_MIN_BLOCKS, -(-length // DSM_BLOCK_BYTES))
    signed = replace(signed, n_blocks=n_blocks, padding=bytes(n_blocks * DSM_BLOCK_BYTES - length))
    return replace(signed, padding=signed.expected_padding(header))


def public_key_dsm(point: bytes, pkid: int, leaf: int, siblings: Sequence[bytes], root: bytes) -> bytes:
    """Return all blocks of the DSM-PKR of a public key.

    Parameters
    ----------
    point
        Compressed point of the key, 33 bytes (P-256) or 67 bytes (P-521).
    pkid
        PKID of the key, 0 to 15.
    leaf
        Index of the key's leaf in the tree, 0 to 15.
    siblings
        Four siblings on the way from the leaf to the root, 32 bytes each, the lowest first.
    root
        Root of the tree, 32 bytes.
    """
    content = bytes([scheme_of_point(point).key_type << 4 | pkid]) + point
    length = LEAF_AT + len(content)
    code, n_blocks = min((code, n) for code, n in PKR_BLOCKS.items() if n * DSM_BLOCK_BYTES >= length)
    padding = hashlib.sha256(root + content).digest()[: n_blocks * DSM_BLOCK_BYTES - length]
    return bytes([code << 4 | leaf]) + b"".join(siblings) + content + padding


def alert_dsm(notice: bytes, leaf: int, siblings: Sequence[bytes]) -> bytes:
    """Return all blocks of the DSM-PKR of an alert message.

    Parameters
    ----------
    notice
        Notice of at most `NOTICE_BYTES` bytes. Spaces are added up to this length.
    leaf, siblings
        Arguments of `public_key_dsm`.
    """
    return bytes([_ALERT_NB << 4 | leaf]) + b"".join(siblings) + _alert_content(notice)


def alert_leaf(notice: bytes) -> bytes:
    """Return the leaf of an alert notice in the tree, 32 bytes.

    Raises
    ------
    VestigeError
        If the notice has more than `NOTICE_BYTES` bytes.

    Examples
    --------
    >>> len(alert_leaf(b"see the web site of the operator"))
    32
    """
    return hashlib.sha256(_alert_content(notice)).digest()


def _alert_content(notice: bytes) -> bytes:
    if len(notice) > NOTICE_BYTES:
        raise VestigeError(f"OSNMA alert notice: {len(notice)} bytes, expected {NOTICE_BYTES} at most")
    return bytes([ALERT_TYPE << 4]) + notice.ljust(NOTICE_BYTES, b" ")
