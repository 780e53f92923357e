"""Make the encrypted E6-C of the simulation: a keystream that never repeats, and that can start at any chip.

Galileo's encryption of E6-C is not published. ACAS does not depend on this encryption, because the receiver gets the
chips themselves in the RECS. A simulation needs chips that never repeat, and that nobody can predict without the key.
So chip number n since the start of Galileo time is bit n of the satellite's AES-256-CTR keystream. The most significant
bit comes first. A bit 0 is the chip +1, and a bit 1 is the chip −1:

    K_svid = SHA-256("vestige E6-C" || svid || key)        counter block = ⌊n / 128⌋, big-endian

The chips replace the product of primary and secondary code, because a random code times a public code is a random code.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np
from cryptography.hazmat.primitives.ciphers import Cipher
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.ciphers.modes import CTR
from jaxtyping import Int8, Int64, UInt32

from vestige.records import ChipSequence
from vestige.records.packed_chips import packed_bits, unpacked_chips
from vestige.signal_generator.waveform import Component
from vestige.signals.definitions import E6C
from vestige.streams import stream_key
from vestige.time import GalileoTime

_CHIPS_PER_SECOND = round(E6C.chip_rate_hz)
_BLOCK_CHIPS = 128  # number of chips in an AES block
_GRID_CHIPS = 1e-3  # largest distance in chips from a whole chip number; rounding in float64 is only about 1e-9 chip


@lru_cache(maxsize=16)
def encryption_key(seed: int) -> bytes:
    """Return the secret of the simulated service, from which the key of every satellite follows."""
    return stream_key(seed, "E6-C encryption")


@lru_cache(maxsize=16)
def forged_key(seed: int) -> bytes:
    """Return the key of the chips that an attacker invents, because the attacker does not know the true chips."""
    return stream_key(seed, "chips that an attacker makes up")


def encrypted_chips(key: bytes, svid: int, transmit_time: GalileoTime, n_chips: int) -> ChipSequence:
    """Return the encrypted E6-C chips that a satellite sends from `transmit_time` on.

    `transmit_time` is the satellite time of the first chip, which is a whole number of chips after a whole second.

    The function raises `ValueError` if `transmit_time` is not the start of a chip.
    """
    offset = transmit_time.fraction * E6C.chip_rate_hz
    if abs(offset - round(offset)) > _GRID_CHIPS:
        raise ValueError(f"{transmit_time} is not the start of an E6-C chip but {offset % 1:.3f} chips after one")
    first = transmit_time.gst_seconds * _CHIPS_PER_SECOND + round(offset)
    return ChipSequence(
        svid=svid,
        transmit_time=transmit_time,
        chip_rate_hz=E6C.chip_rate_hz,
        n_chips=n_chips,
        packed=_keystream(key, svid, first, n_chips),
    )


def encrypted_component(key: bytes, svid: int, reference: GalileoTime) -> Component:
    """Return encrypted E6-C as a component for waveforms, with chips counted from the whole second `reference`.

    A call of `Component.chip` makes all chips from the lowest to the highest requested number. So a call should request
    consecutive chips.
    """
    if reference.fraction:
        raise ValueError(f"the reference must be a whole second, not {reference}")
    origin = reference.gst_seconds * _CHIPS_PER_SECOND

    def stretch(first: int, n: int) -> Int8[np.ndarray, " n"]:
        return unpacked_chips(_keystream(key, svid, origin + first, n), n)

    def chip(index: Int64[np.ndarray, " n"]) -> Int8[np.ndarray, " n"]:
        if not index.size:
            return np.empty(0, np.int8)
        first = int(index.min())
        return stretch(first, int(index.max()) - first + 1)[index - first]

    return Component(signal=E6C, chip=chip, stretch=stretch)


def _keystream(key: bytes, svid: int, first: int, n: int) -> UInt32[np.ndarray, " n_words"]:
    """Return chips number `first` to `first + n − 1` since the start of Galileo time as packed chips."""
    block, skip = divmod(first, _BLOCK_CHIPS)
    encryptor = Cipher(_satellite_cipher(key, svid), CTR(block.to_bytes(16, "big"))).encryptor()
    return packed_bits(encryptor.update(bytes((skip + n + 7) // 8)), n, skip)


@lru_cache(maxsize=64)
def _satellite_cipher(key: bytes, svid: int) -> AES:
    return AES(hashlib.sha256(b"vestige E6-C" + bytes([svid]) + key).digest())
