"""Parse DSM-KROOTs, and find out how many blocks a digital signature message (DSM) of OSNMA has.

A DSM contains a root key (DSM-KROOT), or a public key or an alert notice (DSM-PKR).

The HKROOT message of every subframe is `NMA header 8 | DSM header 8 | DSM block 104`, with lengths in bits. A DSM is 7
to 16 blocks long. The satellites send different blocks at the same time, so a receiver with many satellites in view can
complete a DSM within a minute.

A DSM-KROOT is `NB 4 | PKID 4 | CIDKR 2 | reserved 2 | HF 2 | MF 2 | KS 4 | TS 4 | MACLT 8 | reserved 4 | WN 12 | TOWH 8
| alpha 48 | KROOT | signature | padding` [OSNMA-ICD, DSM-KROOT]. The signature has 512 bits (P-256) or 1056 bits
(P-521). The signature covers the NMA header and all fields from CIDKR to KROOT. Parsing does not verify the signature.
Only a `root_key.RootKey` may be used, because its construction verifies the signature.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from vestige.constants import SECONDS_PER_WEEK, SUBFRAME_S
from vestige.crypto.keys.signature_scheme import P256, P521
from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS, ChainParameters
from vestige.errors import AuthenticationError, UnsupportedError
from vestige.time import GalileoTime

DSM_BLOCK_BYTES = 13  # length of a DSM block, which has 104 bits [OSNMA-ICD, DSM header]
FIRST_PKR_ID = 12  # DSM ids 0 to 11 are DSM-KROOTs, and 12 to 15 are DSM-PKRs [OSNMA-ICD, DSM header]
# number of blocks by NB [OSNMA-ICD, DSM-KROOT]
KROOT_BLOCKS: Mapping[int, int] = {code: code + 6 for code in range(1, 9)}
PKR_BLOCKS: Mapping[int, int] = {5: 11, 7: 13, 8: 14, 9: 15, 10: 16}  # number of blocks by NB [OSNMA-ICD, DSM-PKR]

_HEAD_BYTES = 13  # length of the fields before KROOT, including alpha
_WEEKS = 4096  # week numbers are sent modulo this number [OSNMA-ICD, DSM-KROOT]

NMA_STATUS: Mapping[int, str] = {0: "reserved", 1: "test", 2: "operational", 3: "don't use"}  # [OSNMA-ICD, 3.1.1]
TEST, OPERATIONAL, DONT_USE = 1, 2, 3
CHAIN_REVOKED, KEY_REVOKED, ALERT = 3, 5, 7
KEY_STATUS: Mapping[int, str] = {  # CPKS, chain and public key status [OSNMA-ICD, 3.1.3]
    0: "reserved", 1: "nominal", 2: "end of chain", 3: "chain revoked", 4: "new public key", 5: "public key revoked",
    6: "new Merkle tree", 7: "alert message",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class NmaHeader:
    """The first byte of the HKROOT message: NMA status 2 | chain id 2 | chain and public key status 3 | reserved 1."""

    value: int

    @property
    def status(self) -> int:
        """NMAS, the status of OSNMA: 1 is test, 2 is operational, 3 is don't use."""
        return self.value >> 6

    @property
    def chain_id(self) -> int:
        """CID, number of the chain to which the transmitted keys and tags belong."""
        return self.value >> 4 & 3

    @property
    def key_status(self) -> int:
        """CPKS, the status of chain and public key, such as a coming change."""
        return self.value >> 1 & 7

    @property
    def usable(self) -> bool:
        """Whether a signed header with this value allows the use of keys and tags."""
        return self.status in (TEST, OPERATIONAL) and self.key_status != ALERT

    @property
    def withdraws(self) -> bool:
        """Whether the header withdraws all chains, or all chains except the chain that the header names."""
        return not self.usable or self.key_status in (CHAIN_REVOKED, KEY_REVOKED)

    def __str__(self) -> str:
        status, keys = NMA_STATUS[self.status], KEY_STATUS[self.key_status]
        return f"0x{self.value:02X} ({status}, chain {self.chain_id}, keys: {keys})"


@dataclass(frozen=True, slots=True, kw_only=True)
class DsmKroot:
    """A DSM-KROOT as received: the root key of a chain, with the parameters of the chain and a signature."""

    n_blocks: int
    public_key_id: int  # PKID of the public key that verifies the signature
    chain_id: int  # CIDKR, chain of the root key
    parameters: ChainParameters
    root_week: int  # WN_K, GST week of the hour `root_hour`, modulo 4096
    root_hour: int  # TOWH_K, hour of the week; the time of the root key is 30 s before this hour
    root_key: bytes
    signature: bytes
    padding: bytes
    reserved: tuple[int, int] = (1, 0)  # 2 + 4 reserved bits, which are signed too

    def root_time(self, near: GalileoTime) -> GalileoTime:
        """Return the subframe of the root key, in the 4096-week cycle nearest to `near`."""
        week = near.week + (self.root_week - near.week + _WEEKS // 2) % _WEEKS - _WEEKS // 2
        seconds = max(week, 0) * SECONDS_PER_WEEK + self.root_hour * 3600 - SUBFRAME_S
        return GalileoTime.from_gst_seconds(max(seconds, 0))

    def serialise(self) -> bytes:
        """Return the bytes of the DSM-KROOT as broadcast, in blocks of 13 bytes."""
        head = (self.n_blocks - 6) << 4 | self.public_key_id
        return bytes([head]) + self._signed_part() + self.signature + self.padding

    def signed_message(self, header: NmaHeader) -> bytes:
        """Return the bytes that the signature covers [OSNMA-ICD, 6.3]."""
        return bytes([header.value]) + self._signed_part()

    def expected_padding(self, header: NmaHeader) -> bytes:
        """Return the padding that a correct DSM-KROOT with this header and signature has [OSNMA-ICD, DSM-KROOT]."""
        return hashlib.sha256(self.signed_message(header) + self.signature).digest()[: len(self.padding)]

    def _signed_part(self) -> bytes:
        p = self.parameters
        fields = (
            (self.chain_id, 2), (self.reserved[0], 2), (p.hash_function, 2), (p.mac_function, 2), (p.key_size, 4),
            (p.tag_size, 4), (p.mac_lookup, 8), (self.reserved[1], 4), (self.root_week, 12), (self.root_hour, 8),
        )  # fmt: skip
        bits = 0
        for value, length in fields:
            bits = bits << length | value
        return bits.to_bytes(6, "big") + p.alpha + self.root_key


def kroot_blocks(first_byte: int) -> int:
    """Return the number of blocks of the DSM-KROOT whose first byte is `first_byte`.

    The function raises `UnsupportedError` if the code is reserved.
    """
    return _blocks("DSM-KROOT", KROOT_BLOCKS, first_byte)


def pkr_blocks(first_byte: int) -> int:
    """Return the number of blocks of the DSM-PKR whose first byte is `first_byte`.

    The function raises `UnsupportedError` if the code is reserved.
    """
    return _blocks("DSM-PKR", PKR_BLOCKS, first_byte)


def _blocks(message: str, table: Mapping[int, int], first_byte: int) -> int:
    code = first_byte >> 4
    if code not in table:
        raise UnsupportedError(f"{message}: NB (number of blocks) is {code}; supported are {sorted(table)}")
    return table[code]


def parse_kroot(message: bytes) -> DsmKroot:
    """Check the format of a DSM-KROOT, and return its fields; the signature is not verified.

    The function raises `AuthenticationError` if the length of the message does not fit its fields, or if TOWH is not an
    hour of the week. The function raises `UnsupportedError` if NB is reserved, or if `ChainParameters` refuses a code.
    """
    if not message:
        raise AuthenticationError("DSM-KROOT: empty")
    n_blocks = kroot_blocks(message[0])
    if len(message) != n_blocks * DSM_BLOCK_BYTES:
        raise AuthenticationError(
            f"DSM-KROOT: {len(message)} bytes, but NB says {n_blocks} blocks of {DSM_BLOCK_BYTES}"
        )
    bits = int.from_bytes(message[1:7], "big")
    parameters = ChainParameters(
        hash_function=bits >> 42 & 3,
        mac_function=bits >> 40 & 3,
        key_size=bits >> 36 & 15,
        tag_size=bits >> 32 & 15,
        mac_lookup=bits >> 24 & 255,
        alpha=message[7:_HEAD_BYTES],
    )
    root_hour = bits & 255
    if root_hour * 3600 >= SECONDS_PER_WEEK:
        raise AuthenticationError(f"DSM-KROOT: TOWH is {root_hour}, not an hour of the week")
    key_end = _HEAD_BYTES + KEY_BITS[parameters.key_size] // 8
    signature_end = key_end + _signature_bytes(len(message) - key_end)
    if signature_end > len(message):
        raise AuthenticationError(f"DSM-KROOT: {n_blocks} blocks are too short for key and signature")
    return DsmKroot(
        n_blocks=n_blocks,
        public_key_id=message[0] & 15,
        chain_id=bits >> 46 & 3,
        reserved=(bits >> 44 & 3, bits >> 20 & 15),
        parameters=parameters,
        root_week=bits >> 8 & 0xFFF,
        root_hour=root_hour,
        root_key=message[_HEAD_BYTES:key_end],
        signature=message[key_end:signature_end],
        padding=message[signature_end:],
    )


def _signature_bytes(room: int) -> int:
    """Return the length of the signature in the bytes after KROOT.

    The message has no field for this length. The message has as many blocks as KROOT and signature need: 7 to 9 blocks
    with P-256, 13 or 14 blocks with P-521. So the scheme is P-521 if the bytes after KROOT are enough for a P-521
    signature.
    """
    return (P521 if room >= P521.signature_bytes else P256).signature_bytes
