"""Encode and decode the ionosphere model in word 5, which is the input of NeQuick-G [OS-ICD, 5.1.6]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from vestige.navigation.inav.word_table import word_layout
from vestige.navigation.inav.words import InavWord

_WORD = 5

_FIELDS: Mapping[str, str] = {  # name of the attribute -> name of the field in word 5
    "ai0_sfu": "ai0_sfu",
    "ai1_sfu_per_deg": "ai1_sfu_per_deg",
    "ai2_sfu_per_deg2": "ai2_sfu_per_deg2",
    "disturbed_regions": "ionosphere_disturbance",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class BroadcastIonosphere:
    """Ionosphere model of word 5: effective ionisation level and disturbance flags.

    Attributes
    ----------
    ai0_sfu, ai1_sfu_per_deg, ai2_sfu_per_deg2
        Coefficients of the polynomial in the modified dip latitude, in degrees, that gives the effective ionisation
        level in solar flux units. If all coefficients are zero, no coefficients are available, and NeQuick-G takes its
        default.
    disturbed_regions
        Disturbance flags of the five regions as a number, 0 to 31. The most significant bit belongs to region 1, the
        northernmost region.

    Examples
    --------
    >>> BroadcastIonosphere(ai0_sfu=120.25).fields["ai0_sfu"]
    120.25
    """

    ai0_sfu: float = 0.0
    ai1_sfu_per_deg: float = 0.0
    ai2_sfu_per_deg2: float = 0.0
    disturbed_regions: int = 0

    @classmethod
    def from_word(cls, word: int) -> BroadcastIonosphere:
        """Return the model in a word 5 of 128 bits."""
        decoded = InavWord.decode(word)
        return cls(
            ai0_sfu=decoded.value("ai0_sfu"),
            ai1_sfu_per_deg=decoded.value("ai1_sfu_per_deg"),
            ai2_sfu_per_deg2=decoded.value("ai2_sfu_per_deg2"),
            disturbed_regions=decoded.raw["ionosphere_disturbance"],
        )

    def as_sent(self) -> BroadcastIonosphere:
        """Return the model as word 5 carries it, with each coefficient rounded to the last bit of its field.

        Raises
        ------
        VestigeError
            If a coefficient does not fit into its field.
        """
        by_name = word_layout(_WORD).by_name
        return BroadcastIonosphere(
            ai0_sfu=by_name["ai0_sfu"].physical(by_name["ai0_sfu"].quantised(self.ai0_sfu)),
            ai1_sfu_per_deg=by_name["ai1_sfu_per_deg"].physical(
                by_name["ai1_sfu_per_deg"].quantised(self.ai1_sfu_per_deg)
            ),
            ai2_sfu_per_deg2=by_name["ai2_sfu_per_deg2"].physical(
                by_name["ai2_sfu_per_deg2"].quantised(self.ai2_sfu_per_deg2)
            ),
            disturbed_regions=self.disturbed_regions,
        )

    @property
    def fields(self) -> dict[str, float]:
        """Physical values of the model by name of the field in word 5."""
        return {field: getattr(self, name) for name, field in _FIELDS.items()}


NO_IONOSPHERE = BroadcastIonosphere()
