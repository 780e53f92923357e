"""Define tables of the bit fields of a message, which the encoder and the decoder use.

A `BitLayout` lists the fields of a word or page in the order of transmission, as the tables of the interface document
do. Bit 0 is the first bit sent, which is the most significant bit of the message as an integer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from vestige.errors import VestigeError

_TURN_RAD = 2 * math.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class BitField:
    """A field of a message.

    Attributes
    ----------
    name
        Name of the field, unique in its layout.
    start
        Index of the first bit, counted from 0.
    length
        Number of bits.
    signed
        Whether the field is a two's complement number.
    scale
        Value of the last bit in `unit`.
    unit
        Unit of the physical value, empty for a plain number.
    fill
        Default raw value of the field, such as the pattern of spare bits; None without a default.
    """

    name: str
    start: int
    length: int
    signed: bool = False
    scale: float = 1.0
    unit: str = ""
    fill: int | None = None

    @property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest raw integer of the field."""
        return (-(1 << (self.length - 1)), (1 << (self.length - 1)) - 1) if self.signed else (0, (1 << self.length) - 1)

    @property
    def cyclic(self) -> bool:
        """Whether the field is an angle whose range is exactly one turn, so that every angle fits."""
        return self.unit == "rad" and math.isclose(self.scale * (1 << self.length), _TURN_RAD, rel_tol=1e-12)

    def physical(self, raw: int) -> float:
        """Return the physical value of a raw integer in `unit`. If `scale` is 1, the value stays an integer.

        Parameters
        ----------
        raw
            Raw integer, within `raw_range`.
        """
        return raw if self.scale == 1 else raw * self.scale

    def quantised(self, value: float) -> int:
        """Return the raw integer nearest to a physical value.

        Parameters
        ----------
        value
            Physical value in `unit`. An angle of a cyclic field may be of any size.

        Returns
        -------
        int
            The raw integer, within `raw_range`.

        Raises
        ------
        VestigeError
            If the value is not finite or does not fit into the field.

        Examples
        --------
        >>> BitField(name="crc_m", start=88, length=16, signed=True, scale=2.0**-5, unit="m").quantised(-1.04)
        -33
        """
        low, high = self.raw_range
        if math.isfinite(value):
            # a plain number is not divided, because a float has only 53 bits and a field may have 112 bits
            raw = round(value) if self.scale == 1 else round(value / self.scale)
            if self.cyclic:
                raw = (raw - low) % (1 << self.length) + low
            if low <= raw <= high:
                return raw
        unit = f" {self.unit}" if self.unit else ""
        raise VestigeError(
            f"{self.name} is {value:.9g}{unit}; its {self.length} bits in the message hold "
            f"{low * self.scale:.9g} to {high * self.scale:.9g}{unit}"
        )


@dataclass(frozen=True, slots=True)
class BitLayout:
    """The fields of a word or page in the order of transmission, without a gap.

    Parameters
    ----------
    total_bits
        Length of the word or page in bits. The lengths of the fields must add up to this length.
    fields
        Fields in the order of transmission.
    """

    total_bits: int
    fields: tuple[BitField, ...]
    by_name: Mapping[str, BitField] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        at = 0
        for one in self.fields:
            if one.start != at:
                raise ValueError(f"{one.name} starts at bit {one.start}, expected {at}")
            at += one.length
        if at != self.total_bits or len({one.name for one in self.fields}) != len(self.fields):
            raise ValueError(f"{at} bits in {len(self.fields)} fields, expected {self.total_bits} and unique names")
        object.__setattr__(self, "by_name", {one.name: one for one in self.fields})

    def read(self, bits: int, name: str) -> int:
        """Return the raw integer of one field.

        Parameters
        ----------
        bits
            The whole message, `total_bits` long.
        name
            Name of the field.
        """
        one = self.by_name[name]
        raw = (bits >> (self.total_bits - one.start - one.length)) & ((1 << one.length) - 1)
        return raw - (1 << one.length) if one.signed and raw >> (one.length - 1) else raw

    def unpack(self, bits: int) -> dict[str, int]:
        """Return the raw integers of all fields by name.

        Parameters
        ----------
        bits
            The whole message, `total_bits` long.
        """
        return {name: self.read(bits, name) for name in self.by_name}

    def pack(self, raw: Mapping[str, int]) -> int:
        """Return the message with the given raw integers. The function is the inverse of `unpack`.

        Parameters
        ----------
        raw
            Field name -> raw integer. A missing field gets its `fill`.

        Raises
        ------
        ValueError
            If a field is unknown, a field has neither value nor `fill`, or a value does not fit.
        """
        unknown = set(raw) - set(self.by_name)
        if unknown:
            raise ValueError(f"unknown fields {sorted(unknown)}, expected {list(self.by_name)}")
        bits = 0
        for one in self.fields:
            value = raw.get(one.name, one.fill)
            low, high = one.raw_range
            if value is None or not low <= value <= high:
                raise ValueError(f"{one.name} is {value}, expected {low} to {high}")
            bits = bits << one.length | value & ((1 << one.length) - 1)
        return bits
