"""Convert re-encrypted code sequences (RECS) with an OSNMA key to E6-C chips, and back.

The server takes an encrypted code sequence (ECS), a part of the encrypted E6-C code that a satellite will transmit. The
server encrypts the ECS again under an OSNMA key that is still secret. The server publishes the result, the RECS, up to
a week ahead. The receiver records E6-C around the time of the RECS. After the key has been broadcast on E1-B, the
receiver decrypts the RECS and correlates the recorded samples with the chips [WFO, Sec. II-A]::

    GST_SF = (WN mod 4096) << 20 | TOW            32 bits, start of the 30 s subframe that transmits the key
    P      = GST_SF (4 bytes) || RAND (1 byte) || 11 zero bytes
    K_R    = SHA-256(TESLA key)                   AES-256 key
    IV     = first 16 bytes of SHA-256(P)
    ECS    = AES-256-CBC-decrypt(K_R, IV, RECS)   no padding scheme: bodies are whole AES blocks
    chips  = ECS bits, most significant first; bit 0 is +1, bit 1 is -1

The service's interface document is not public. The rules above come from the public reference receiver [SASLIB]. Two
rules are uncertain: the mode of AES (`CipherMode`), and the mapping of the key delay indicator to a key (`key_time`).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

from cryptography.hazmat.primitives.ciphers import Cipher, CipherContext
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.ciphers.modes import CBC, CTR

from vestige.constants import SUBFRAME_S
from vestige.records import ChipSequence, EncryptedSegment
from vestige.records.packed_chips import bits_of_packed, packed_bits
from vestige.signals.definitions import E6C
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey, is_validated

WEEK_MODULUS = 4096  # GST_SF and the unitary header contain the week modulo this number [SASLIB]
AES_BLOCK_BYTES = 16


class CipherMode(Enum):
    """Mode of operation in which AES-256 encrypts a RECS.

    The assumed mode is CBC. The text of the public reference receiver [SASLIB] names CTR, but the code of the receiver
    uses CBC. Two facts support CBC. First, bodies of RECS are padded to whole AES blocks, which CTR would not need.
    Second, the code of the receiver is reported to have worked on the signal in space. CTR would use the IV as its
    first counter block. The wrong mode gives noise, never a wrong correlation peak.
    """

    CBC = "cbc"
    CTR = "ctr"


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentLength:
    """A possible length of a RECS."""

    code: int  # NChip field of the aggregated header
    duration_ms: int  # number of E6-C primary code periods, 1 ms each
    n_bytes: int  # length of the body: the chips, padded to whole AES blocks

    @property
    def n_chips(self) -> int:
        """Number of chips that are correlated. The padding is possibly not on air, and is not correlated."""
        return self.duration_ms * E6C.code_length


# The lengths are from [SASLIB]. The padding of the bodies to AES blocks is inferred, and is exact for all five lengths.
LENGTHS = (
    SegmentLength(code=0, duration_ms=1, n_bytes=640),
    SegmentLength(code=1, duration_ms=2, n_bytes=1_280),
    SegmentLength(code=2, duration_ms=4, n_bytes=2_560),
    SegmentLength(code=3, duration_ms=8, n_bytes=5_120),
    SegmentLength(code=4, duration_ms=16, n_bytes=10_240),
)
LENGTH_BY_CHIPS = {length.n_chips: length for length in LENGTHS}
LENGTH_BY_BYTES = {length.n_bytes: length for length in LENGTHS}


def key_time(transmit_time: GalileoTime, key_delay: int) -> GalileoTime:
    """Return the GST_SF of a RECS's key, which is the start of the subframe that transmits the key.

    By assumption KDI 0 selects the key of the subframe in which the RECS begins, and KDI 1 the key of the next subframe
    [SASLIB].
    """
    if key_delay not in (0, 1):
        raise ValueError(f"key delay indicator {key_delay} is neither 0 nor 1")
    return GalileoTime.from_gst_seconds((transmit_time.gst_seconds // SUBFRAME_S + key_delay) * SUBFRAME_S)


def wrapping_key(key_data: bytes) -> bytes:
    """Return K_R, the AES-256 key of a RECS, which is the SHA-256 hash of the TESLA key [SASLIB]."""
    return hashlib.sha256(key_data).digest()


def iv_preimage(gst_sf: GalileoTime, random_offset: int) -> bytes:
    """Return P, the 16 bytes (GST_SF, RAND and eleven zero bytes) whose hash gives the IV [SASLIB].

    `gst_sf` is the start of the subframe that transmits the key, not the time of transmission of the RECS.
    """
    if gst_sf.second % SUBFRAME_S or gst_sf.fraction:
        raise ValueError(f"{gst_sf} is not the start of a subframe")
    word = (gst_sf.week % WEEK_MODULUS) << 20 | gst_sf.second
    return word.to_bytes(4, "big") + random_offset.to_bytes(1, "big") + bytes(11)


def initialization_vector(gst_sf: GalileoTime, random_offset: int) -> bytes:
    """Return the IV (or first counter block) of a RECS: the first 16 bytes of SHA-256(P) [SASLIB]."""
    return hashlib.sha256(iv_preimage(gst_sf, random_offset)).digest()[:AES_BLOCK_BYTES]


def encrypt_body(
    ecs: bytes, key_data: bytes, gst_sf: GalileoTime, random_offset: int = 0, mode: CipherMode = CipherMode.CBC
) -> bytes:
    """Encrypt the packed code sequence `ecs`, whole AES blocks, and return the body of the RECS. See `decrypt_body`."""
    return _through(_cipher(key_data, gst_sf, random_offset, mode).encryptor(), ecs)


def decrypt_body(
    body: bytes, key_data: bytes, gst_sf: GalileoTime, random_offset: int = 0, mode: CipherMode = CipherMode.CBC
) -> bytes:
    """Decrypt the body of a RECS, and return the packed code sequence (ECS).

    The function cannot detect a wrong key, because AES has no check value and a wrong key gives random chips. A wrong
    IV damages only the first 128 chips in CBC mode.

    `gst_sf` is the start of the subframe that transmits the key.
    """
    return _through(_cipher(key_data, gst_sf, random_offset, mode).decryptor(), body)


def encrypt(
    chips: ChipSequence,
    key_data: bytes,
    *,
    key_delay: int = 0,
    random_offset: int = 0,
    mode: CipherMode = CipherMode.CBC,
) -> EncryptedSegment:
    """Encrypt `chips`, padded with zero bits, and return the RECS that a server publishes.

    The function is the inverse of `decrypt`. `chips` are 1, 2, 4, 8 or 16 ms of E6-C. `key_data` is the key of the
    subframe that `key_time` gives. The server knows the key before its disclosure.
    """
    length = LENGTH_BY_CHIPS.get(chips.n_chips)
    if length is None:
        raise ValueError(f"no RECS has {chips.n_chips} chips; lengths are {sorted(LENGTH_BY_CHIPS)}")
    gst_sf = key_time(chips.transmit_time, key_delay)
    ecs = bits_of_packed(chips.packed, length.n_bytes)
    return EncryptedSegment(
        svid=chips.svid,
        transmit_time=chips.transmit_time,
        n_chips=length.n_chips,
        cipher=encrypt_body(ecs, key_data, gst_sf, random_offset, mode),
        key_time=gst_sf,
        key_delay=key_delay,
        random_offset=random_offset,
    )


def decrypt(segment: EncryptedSegment, key: ValidatedKey, *, mode: CipherMode = CipherMode.CBC) -> ChipSequence:
    """Return the E6-C chips of a RECS, without the padding of its last AES block.

    `key` is the validated key of `segment.key_time`.

    The function raises `TypeError` if the key is not a `ValidatedKey`. The function raises `ValueError` if the key
    belongs to another subframe, or if fields of the segment contradict each other.
    """
    if not is_validated(key):
        raise TypeError(f"a RECS is decrypted with a ValidatedKey, not with a {type(key).__name__}")
    if key.time != segment.key_time:
        raise ValueError(f"the RECS needs the key of {segment.key_time}, not that of {key.time}")
    if segment.key_time != key_time(segment.transmit_time, segment.key_delay):
        raise ValueError(f"key time {segment.key_time} is not that of a RECS at {segment.transmit_time}")
    length = LENGTH_BY_BYTES.get(len(segment.cipher))
    if length is None or length.n_chips != segment.n_chips:
        raise ValueError(f"a RECS body of {len(segment.cipher)} bytes does not hold {segment.n_chips} chips")
    ecs = decrypt_body(segment.cipher, key.data, segment.key_time, segment.random_offset, mode)
    return ChipSequence(
        svid=segment.svid,
        transmit_time=segment.transmit_time,
        chip_rate_hz=E6C.chip_rate_hz,
        n_chips=segment.n_chips,
        packed=packed_bits(ecs, segment.n_chips),
    )


@lru_cache(maxsize=16)
def _cipher(key_data: bytes, gst_sf: GalileoTime, random_offset: int, mode: CipherMode) -> Cipher[CBC | CTR]:
    """Return the AES-256 cipher for a key, the subframe of the key, RAND and a mode."""
    iv = initialization_vector(gst_sf, random_offset)
    return Cipher(AES(wrapping_key(key_data)), CBC(iv) if mode is CipherMode.CBC else CTR(iv))


def _through(context: CipherContext, data: bytes) -> bytes:
    # CTR would accept any length, but a RECS has whole AES blocks in either mode.
    if len(data) % AES_BLOCK_BYTES:
        raise ValueError(f"{len(data)} bytes are not whole AES blocks")
    return context.update(data) + context.finalize()
