"""Define the parameters of a TESLA chain that a DSM-KROOT states, such as hash and MAC functions, key and tag sizes.

The tables of [OSNMA-ICD, DSM-KROOT] define the meaning of each code. A code that is not in its table is reserved, and
raises an `UnsupportedError`. SHA3-256 and CMAC-AES are in the tables, but no signal or test vector has used them yet.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from cryptography.hazmat.primitives.ciphers import algorithms
from cryptography.hazmat.primitives.cmac import CMAC

from vestige.crypto.osnma.messages.subframe import MACK_BITS, MACK_TOTAL_BITS
from vestige.errors import UnsupportedError

ALPHA_BYTES = 6  # length of the random pattern of the chain [OSNMA-ICD, DSM-KROOT]
# Length of the information after a tag: 8 bits of PRN_D, 4 bits of ADKD and 4 bits of COP. The information after the
# first tag has 12 bits of MACSEQ and 4 bits of COP [OSNMA-ICD, MACK].
TAG_INFO_BITS = 16


def _hmac_sha256(key: bytes, message: bytes) -> bytes:
    return hmac.digest(key, message, "sha256")


def _cmac_aes(key: bytes, message: bytes) -> bytes:
    mac = CMAC(algorithms.AES(key))
    mac.update(message)
    return mac.finalize()


# name and function by the code HF [OSNMA-ICD, DSM-KROOT]
HASH_FUNCTIONS: Mapping[int, tuple[str, Callable[[bytes], hashlib._Hash]]] = {
    0: ("SHA-256", hashlib.sha256),
    2: ("SHA3-256", hashlib.sha3_256),
}
# name and function by the code MF [OSNMA-ICD, DSM-KROOT]
MAC_FUNCTIONS: Mapping[int, tuple[str, Callable[[bytes, bytes], bytes]]] = {
    0: ("HMAC-SHA-256", _hmac_sha256),
    1: ("CMAC-AES", _cmac_aes),
}
KEY_BITS: Mapping[int, int] = {  # length of a key in bits by the code KS [OSNMA-ICD, DSM-KROOT]
    0: 96, 1: 104, 2: 112, 3: 120, 4: 128, 5: 160, 6: 192, 7: 224, 8: 256,
}  # fmt: skip
# length of a tag in bits by the code TS [OSNMA-ICD, DSM-KROOT]
TAG_BITS: Mapping[int, int] = {5: 20, 6: 24, 7: 28, 8: 32, 9: 40}
_AES_KEY_BITS = (128, 192, 256)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainParameters:
    """Parameters of a TESLA chain, as codes of the DSM-KROOT.

    The constructor raises `UnsupportedError` if the code of a function, key length or tag length is reserved, or if
    CMAC-AES is combined with a key length that AES does not have. The constructor raises `ValueError` if `alpha` does
    not have 6 bytes.
    """

    hash_function: int = 0  # HF, code of the hash function [OSNMA-ICD, DSM-KROOT]
    mac_function: int = 0  # MF, code of the function for message authentication codes
    key_size: int = 4  # KS, code of the length of a key
    tag_size: int = 9  # TS, code of the length of a tag
    mac_lookup: int = 34  # MACLT, number of the row in the MAC look-up table (see `mac_lookup`)
    alpha: bytes  # random pattern of the chain, 6 bytes

    def __post_init__(self) -> None:
        if len(self.alpha) != ALPHA_BYTES:
            raise ValueError(f"alpha has {len(self.alpha)} bytes, not {ALPHA_BYTES}")
        for name, code, table in (
            ("HF (hash function)", self.hash_function, HASH_FUNCTIONS),
            ("MF (MAC function)", self.mac_function, MAC_FUNCTIONS),
            ("KS (key size)", self.key_size, KEY_BITS),
            ("TS (tag size)", self.tag_size, TAG_BITS),
        ):
            if code not in table:
                raise UnsupportedError(f"DSM-KROOT: {name} is {code}; supported are {sorted(table)}")
        if self.mac_function == 1 and self.key_bits not in _AES_KEY_BITS:
            raise UnsupportedError(
                f"DSM-KROOT: MF is CMAC-AES with keys of {self.key_bits} bits, which AES does not have"
            )

    @property
    def key_bits(self) -> int:
        """Length of a key, l_k, in bits."""
        return KEY_BITS[self.key_size]

    @property
    def key_bytes(self) -> int:
        """Length of a key in bytes."""
        return self.key_bits // 8

    @property
    def tag_bits(self) -> int:
        """Length of a tag, l_t, in bits."""
        return TAG_BITS[self.tag_size]

    @property
    def n_tags(self) -> int:
        """Number of tags in one MACK message, n_t [OSNMA-ICD, MACK]."""
        return (MACK_TOTAL_BITS - self.key_bits) // (self.tag_bits + TAG_INFO_BITS)

    @property
    def key_start_bit(self) -> int:
        """Index of the first bit of the key in the MACK message."""
        return self.n_tags * (self.tag_bits + TAG_INFO_BITS)

    @property
    def disclosure_start_s(self) -> int:
        """Time from the start of the subframe to the first bit of its key on air, in whole seconds rounded down.

        The first page starts 1 s after the start of the subframe. The OSNMA field is in the odd half of a page, which
        starts 1 s after the start of the page. The result is 22 s with tags of 40 bits and keys of 128 bits.
        """
        return 1 + 2 * (self.key_start_bit // MACK_BITS) + 1

    @property
    def disclosure_end_s(self) -> int:
        """Time in s from the start of a subframe to the end of the page with the last bit of the key, often 31 s."""
        last_bit = self.key_start_bit + self.key_bits - 1
        return 1 + 2 * (last_bit // MACK_BITS) + 2

    @property
    def new_hash(self) -> Callable[[bytes], hashlib._Hash]:
        """Hash function of the chain with digests of 32 bytes, directly from `hashlib` for speed."""
        return HASH_FUNCTIONS[self.hash_function][1]

    def mac(self, key: bytes, message: bytes, n_bits: int) -> int:
        """Return the first `n_bits` bits of the chain's message authentication code of `message` under `key`."""
        code = MAC_FUNCTIONS[self.mac_function][1](key, message)
        return int.from_bytes(code, "big") >> (8 * len(code) - n_bits)

    def __str__(self) -> str:
        functions = f"{HASH_FUNCTIONS[self.hash_function][0]}, {MAC_FUNCTIONS[self.mac_function][0]}"
        return f"{functions}, {self.key_bits}-bit keys, {self.tag_bits}-bit tags, MACLT {self.mac_lookup}"
