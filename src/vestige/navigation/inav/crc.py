"""Compute CRC-24Q, the checksum of Galileo pages [OS-ICD, 5.1.9.4]."""

from __future__ import annotations

_CRC_24Q = 0x1864CFB  # generator polynomial, initial value 0 [OS-ICD, 5.1.9.4]


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        register = byte << 16
        for _ in range(8):
            register <<= 1
            if register & 0x1000000:
                register ^= _CRC_24Q
        table.append(register)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc_24q(data: bytes) -> int:
    """Return the CRC-24Q checksum of `data` [OS-ICD, 5.1.9.4].

    Zero bits before the data do not change the checksum.

    Parameters
    ----------
    data
        Any number of bytes. If the number of bits is not a multiple of 8, the caller puts zero bits before the first
        bit.

    Examples
    --------
    >>> f"{crc_24q(b'123456789'):06x}"
    'cde703'
    """
    register = 0
    for byte in data:
        register = ((register << 8) & 0xFFFFFF) ^ _CRC_TABLE[(register >> 16) ^ byte]
    return register
