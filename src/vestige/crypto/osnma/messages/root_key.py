"""Verify the root key of a TESLA chain, so that the trust in a public key extends to the keys of the chain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader, parse_kroot
from vestige.errors import AuthenticationError, VestigeError
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class RootKey:
    """A verified root key, whose construction checks signature, padding and time.

    The checks are repeated when a pickled root key is read.

    The constructor raises `AuthenticationError` if the DSM-KROOT is malformed, or if signature, padding or time are
    wrong. The constructor raises `TypeError` if an attribute is not exactly of its declared type, because a subclass
    could skip the verification.
    """

    kroot: DsmKroot
    header: NmaHeader  # NMA header that is signed together with the root key
    time: GalileoTime  # subframe of the root key: 30 s before the hour that the DSM-KROOT names
    public_key: PublicKey  # key that verified the root key
    # subframe in which the receiver received the root key; the status in the header counts from this time on
    received_at: GalileoTime

    def __post_init__(self) -> None:
        parts = (self.kroot, self.header, self.time, self.public_key, self.received_at)
        for part, kind in zip(parts, (DsmKroot, NmaHeader, GalileoTime, PublicKey, GalileoTime), strict=True):
            if type(part) is not kind:
                raise TypeError(f"a RootKey has a {kind.__name__}, not a {type(part).__name__}")
        # A private copy is verified, because the message may contain a bytearray, which can change.
        object.__setattr__(self, "kroot", parse_kroot(self.kroot.serialise()))
        self.public_key.verify(self.kroot.signed_message(self.header), self.kroot.signature)
        found, expected = self.kroot.padding, self.kroot.expected_padding(self.header)
        if found != expected:
            raise AuthenticationError(f"the padding is {found.hex()}, not {expected.hex()}")
        if self.time != self.kroot.root_time(self.time):
            raise AuthenticationError(f"the root key is of {self.kroot.root_time(self.time)}, not of {self.time}")

    def __reduce__(
        self,
    ) -> tuple[Callable[..., RootKey], tuple[DsmKroot, NmaHeader, GalileoTime, PublicKey, GalileoTime]]:
        """Return a function and its arguments for pickle, so that an unpickled root key is checked again."""
        return _root_key, (self.kroot, self.header, self.time, self.public_key, self.received_at)

    def received(self, time: GalileoTime) -> RootKey:
        """Return a copy of this root key with `time` as the subframe of its reception.

        The time of reception is not signed, so no check is repeated.
        """
        again = object.__new__(RootKey)
        for field in fields(self):
            object.__setattr__(again, field.name, getattr(self, field.name))
        object.__setattr__(again, "received_at", time)
        return again

    @property
    def chain_id(self) -> int:
        """CIDKR, number of the chain to which the root key belongs."""
        return self.kroot.chain_id

    @property
    def parameters(self) -> ChainParameters:
        """Parameters of the chain."""
        return self.kroot.parameters

    @property
    def data(self) -> bytes:
        """Bytes of the root key."""
        return self.kroot.root_key


def verify_root_key(kroot: DsmKroot, header: NmaHeader, public_keys: Sequence[PublicKey], near: GalileoTime) -> RootKey:
    """Verify signature and padding of a DSM-KROOT, and return the verified root key [OSNMA-ICD, 6.3].

    The function raises `AuthenticationError` if the DSM-KROOT is malformed, or if signature or padding are wrong. The
    function raises `VestigeError` if `public_keys` contains neither a key with the PKID of the DSM-KROOT nor a key
    without PKID.

    Parameters
    ----------
    kroot
        DSM-KROOT with the root key and its signature.
    header
        NMA header that was broadcast with the DSM-KROOT.
    public_keys
        Keys that may have signed the DSM-KROOT. Only keys with the PKID of the DSM-KROOT, or without PKID, are used.
    near
        Time within 2048 weeks of the root key, such as the time of reception. The DSM-KROOT has the week only modulo
        4096, and `near` determines the full week. The returned root key has `near` as its time of reception.
    """
    candidates = [key for key in public_keys if key.pkid in (None, kroot.public_key_id)]
    if not candidates:
        raise VestigeError(f"the root key is signed with PKID {kroot.public_key_id}, which was not given")
    for public_key in candidates:
        try:
            return _root_key(kroot, header, kroot.root_time(near), public_key, near)
        except AuthenticationError as error:
            refused = error
    raise refused


def _root_key(
    kroot: DsmKroot, header: NmaHeader, time: GalileoTime, public_key: PublicKey, received_at: GalileoTime
) -> RootKey:
    return RootKey(kroot=kroot, header=header, time=time, public_key=public_key, received_at=received_at)
