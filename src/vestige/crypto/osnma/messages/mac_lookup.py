"""Look up which data each tag of a MACK message authenticates, in the MAC look-up table [OSNMA-ICD, Annex C].

The number MACLT of the signed DSM-KROOT selects a row. A row has two sequences of slots, for subframes that start at a
full minute and at half a minute. A slot gives the kind of data (ADKD) of a tag, and the satellite whose data the tag
covers. `S` means the sending satellite, and `E` means any Galileo satellite. In a flexible slot (`FLX`) the tag itself
gives kind and satellite, which MACSEQ protects.

Rows 33 and 34 are verified on real data. The other rows are copied from the table, and are not verified on real data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.errors import UnsupportedError
from vestige.time import GalileoTime

_SEQUENCES: Mapping[int, tuple[str, str]] = {  # MACLT -> (GST mod 60 = 0, GST mod 60 = 30) [OSNMA-ICD, Annex C]
    27: ("00S 00E 00E 00E 12S 00E", "00S 00E 00E 04S 12S 00E"),
    28: ("00S 00E 00E 00E 00S 00E 00E 12S 00E 00E", "00S 00E 00E 00S 00E 00E 04S 12S 00E 00E"),
    31: ("00S 00E 00E 12S 00E", "00S 00E 00E 12S 04S"),
    33: ("00S 00E 04S 00E 12S 00E", "00S 00E 00E 12S 00E 12E"),
    34: ("00S FLX 04S FLX 12S 00E", "00S FLX 00E 12S 00E 12E"),
    35: ("00S FLX 04S FLX 12S FLX", "00S FLX FLX 12S FLX FLX"),
    36: ("00S FLX 04S FLX 12S", "00S FLX 00E 12S 12E"),
    37: ("00S 00E 04S 00E 12S", "00S 00E 00E 12S 12E"),
    38: ("00S FLX 04S FLX 12S", "00S FLX FLX 12S FLX"),
    39: ("00S FLX 04S FLX", "00S FLX 00E 12S"),
    40: ("00S 00E 04S 12S", "00S 00E 00E 12E"),
    41: ("00S FLX 04S FLX", "00S FLX FLX 12S"),
}


@dataclass(frozen=True, slots=True)
class Slot:
    """A slot of a sequence in the MAC look-up table, which says what data a tag may authenticate."""

    adkd: int | None  # kind of data; None in a flexible slot
    own: bool  # whether the tag must be for the satellite that sends it

    @property
    def flexible(self) -> bool:
        """Whether the tag itself gives its kind of data and its satellite."""
        return self.adkd is None

    def allows(self, *, adkd: int, own: bool) -> bool:
        """Whether the slot allows a tag for a kind of data of the sending satellite (`own`) or of another satellite."""
        return self.flexible or (adkd == self.adkd and own >= self.own)


def _slot(code: str) -> Slot:
    return Slot(None, False) if code == "FLX" else Slot(int(code[:2]), code[2] == "S")


MAC_LOOKUP: Mapping[int, tuple[tuple[Slot, ...], tuple[Slot, ...]]] = {
    number: (tuple(map(_slot, first.split())), tuple(map(_slot, second.split())))
    for number, (first, second) in _SEQUENCES.items()
}


def slots(parameters: ChainParameters, time: GalileoTime) -> tuple[Slot, ...]:
    """Return the slots of the tags in a subframe, including the slot of the first tag.

    The function raises `UnsupportedError` if the table lacks the row of the chain, or if the row does not have one slot
    for each tag of the MACK message.
    """
    row = MAC_LOOKUP.get(parameters.mac_lookup)
    if row is None:
        raise UnsupportedError(
            f"MAC look-up table {parameters.mac_lookup} is not known; keys can be verified, MACSEQ and tags cannot"
        )
    if len(row[0]) != parameters.n_tags:
        raise UnsupportedError(
            f"MAC look-up table {parameters.mac_lookup} has {len(row[0])} tags, the MACK message {parameters.n_tags}; "
            "keys can be verified, MACSEQ and tags cannot"
        )
    return row[time.second // SUBFRAME_S % 2]
