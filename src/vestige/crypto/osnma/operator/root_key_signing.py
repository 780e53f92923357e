"""Signed root keys: the DSM-KROOT that a chain's operator broadcasts, with its signature and its padding.

The signature is deterministic, so the same seed gives the same bits [RFC 6979].
"""

from __future__ import annotations

from dataclasses import replace

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature

from vestige.constants import SUBFRAME_S
from vestige.crypto.keys.signature_scheme import scheme_of_curve
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.dsm import BLOCK_BYTES, KROOT_BLOCKS, DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.tesla import Key
from vestige.time import GalileoTime

HOUR_S = 3600
_MIN_BLOCKS = min(KROOT_BLOCKS.values())
_WEEKS = 4096  # weeks are counted modulo this [OSNMA-ICD, DSM-KROOT]


def root_key_time(time: GalileoTime) -> GalileoTime:
    """Return the subframe of the newest root key at a time: 30 s before the last full hour.

    That key has been disclosed, so the root key gives nothing away.

    Examples
    --------
    >>> root_key_time(GalileoTime(1400, 7325))
    GalileoTime(week=1400, second=7170, fraction=0.0)
    """
    return GalileoTime(time.week, time.second - time.second % HOUR_S) + -SUBFRAME_S


def unsigned_kroot(root: Key, parameters: ChainParameters, *, chain_id: int, pkid: int) -> DsmKroot:
    """Return the DSM-KROOT of a root key, still without signature and padding.

    Parameters
    ----------
    root
        The root key; its time is 30 s before a full hour [OSNMA-ICD, DSM-KROOT].
    parameters
        Parameters of its chain.
    chain_id
        CIDKR 0 … 3.
    pkid
        PKID 0 … 15 of the public key that is to verify the signature.

    Raises
    ------
    ValueError
        If the time of the key is not 30 s before a full hour.
    """
    hour = root.time + SUBFRAME_S
    if hour.second % HOUR_S:
        raise ValueError(f"a root key is of 30 s before a full hour, not of {root.time}")
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
    """Return the DSM-KROOT with signature and padding for its header, in as many blocks as it needs [OSNMA-ICD, 6.3].

    Parameters
    ----------
    kroot
        The message; its own signature and padding are replaced.
    header
        The NMA header that is broadcast with it: it is signed, too.
    private_key
        On P-256 or P-521.
    """
    scheme = scheme_of_curve(private_key.curve)
    assert scheme is not None  # noqa: S101  (ours)
    algorithm = ec.ECDSA(scheme.hash, deterministic_signing=True)
    numbers = decode_dss_signature(private_key.sign(kroot.signed_message(header), algorithm))
    signature = b"".join(number.to_bytes(scheme.coordinate_bytes, "big") for number in numbers)
    signed = replace(kroot, signature=signature, padding=b"")
    length = len(signed.serialise())
    n_blocks = max(_MIN_BLOCKS, -(-length // BLOCK_BYTES))
    signed = replace(signed, n_blocks=n_blocks, padding=bytes(n_blocks * BLOCK_BYTES - length))
    return replace(signed, padding=signed.expected_padding(header))
