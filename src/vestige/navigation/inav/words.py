"""Convert an I/NAV word of 128 bits to named integers and physical values, and back.

The table `WORD_LAYOUTS` gives the bits of each field. A decoded word is encoded to the same bits again, because spare
and reserved bits are fields too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from vestige.errors import VestigeError
from vestige.navigation.inav.word_table import TYPE_BITS, WORD_BITS, WORD_LAYOUTS, word_layout

_TIME_SET = 0b10  # value of the field `time_set` if word 0 has week and time of week [OS-ICD, 4.3.5]
_TIME_WORDS = {0: True, 5: True, 6: False}  # word type -> whether the word has the week in addition to the time of week


def word_bits(word: int, start: int, length: int) -> int:
    """Return `length` bits of a 128-bit word from bit `start` on (bit 0 is transmitted first)."""
    return (word >> (WORD_BITS - start - length)) & ((1 << length) - 1)


def word_type(word: int) -> int:
    """Return the type of a 128-bit word, 0 to 63."""
    return word >> (WORD_BITS - TYPE_BITS)


@dataclass(frozen=True, slots=True)
class InavWord:
    """An I/NAV word, with an integer for each of its fields.

    Attributes
    ----------
    kind
        Word type, 0 to 63.
    raw
        Field name -> integer as transmitted, including the field `type`.

    Examples
    --------
    >>> word = InavWord.from_values(6, {"a0_s": 0.0, "a1": 0.0, "leap_seconds": 18, "t0t_s": 7200, "utc_week": 92,
    ...     "leap_week": 137, "leap_day": 7, "leap_seconds_after": 18, "tow_s": 65})
    >>> InavWord.decode(word.encode()) == word, word.value("t0t_s")
    (True, 7200.0)
    """

    kind: int
    raw: Mapping[str, int]

    @classmethod
    def decode(cls, bits: int) -> InavWord:
        """Return the fields of a 128-bit word.

        Parameters
        ----------
        bits
            Word of 128 bits, whose first bit is the most significant bit.

        Raises
        ------
        ValueError
            If the word has more than 128 bits.
        """
        return cls(word_type(bits), word_layout(word_type(bits)).unpack(bits))

    @classmethod
    def from_values(cls, kind: int, values: Mapping[str, float]) -> InavWord:
        """Return the word whose fields are nearest to the given physical values.

        Parameters
        ----------
        kind
            Word type, 0 to 63.
        values
            Field name -> value in the unit of the table. Spare bits that are not given take their pattern.

        Raises
        ------
        VestigeError
            If a value does not fit into its field.
        ValueError
            If a field is unknown or missing.
        """
        layout = word_layout(kind)
        try:
            raw = {name: layout.by_name[name].quantised(value) for name, value in values.items()}
        except KeyError as error:
            raise ValueError(f"word {kind} has no field {error}") from None
        except VestigeError as error:
            raise VestigeError(f"I/NAV word {kind}: {error}") from None
        return cls(kind, layout.unpack(layout.pack(raw)))

    def encode(self) -> int:
        """Return the 128 bits of the word, whose first bit is the most significant bit."""
        return word_layout(self.kind).pack(self.raw)

    def value(self, name: str) -> float:
        """Return the physical value of a field in the unit of the table.

        Parameters
        ----------
        name
            Name of the field.
        """
        return word_layout(self.kind).by_name[name].physical(self.raw[name])

    @property
    def values(self) -> dict[str, float]:
        """Physical values of all fields by name, in the units of the table."""
        fields = word_layout(self.kind).by_name
        return {name: fields[name].physical(raw) for name, raw in self.raw.items()}


def time_in_word(word: int) -> tuple[int | None, int] | None:
    """Return (week modulo 4096 or None, time of week in s) of the start of the page that carries `word`.

    Returns
    -------
    tuple or None
        None if the word has no time. The week is None for word type 6, which has only the time of week.
    """
    kind = word_type(word)
    if kind not in _TIME_WORDS:
        return None
    layout = WORD_LAYOUTS[kind]
    if kind == 0 and layout.read(word, "time_set") != _TIME_SET:
        return None
    return layout.read(word, "week") if _TIME_WORDS[kind] else None, layout.read(word, "tow_s")
