"""Read the threat table: attacks A0 to A21, their expected outcomes at each mitigation level, and their scenes.

The file `threats.toml` beside this module contains and explains the table. The rows are the attacks against which the
levels of [WFO, Sec. IV] defend. Parameters come from recorded attacks [TEXBAT] if such recordings exist.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, TypeAdapter, model_validator

from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.toml.toml_file import Section, overridden, read_toml, validated
from vestige.streams import stream

THREATS_FILE = Path(__file__).with_name("threats.toml")
LEVEL_NUMBERS = (1, 2, 3)
OUTCOMES = ("pass", "detect", "mitigate", "miss", "deny", "partial")

_CAMPAIGN: TypeAdapter[CampaignScenario] = TypeAdapter(CampaignScenario)


class Draw(Section):
    """Value that each seed draws at random, uniformly in the value or in its logarithm."""

    low: float
    high: float
    log: bool = False

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not (self.low < self.high and (self.low > 0 or not self.log)):
            raise ValueError("low must be less than high, and more than 0 if log is true")
        return self

    def value(self, share: float) -> float:
        """Return the value at a share (0 to 1) of the range from low to high."""
        if self.log:
            return math.exp(math.log(self.low) + share * math.log(self.high / self.low))
        return self.low + share * (self.high - self.low)


class ShortRecording(Section):
    """Settings with which `threats/recorded_scenes.py` makes a recording of some seconds from a scene.

    Attributes
    ----------
    name
        Name of the recording, which describes the state of the receiver when the attack begins; empty for the name of
        the scene.
    faster
        Factor by which the attack is faster than in the scene.
    first_s, end_s
        Start and end of the recording, in s after the start of the scene with the accelerated attack.
    every_s
        Time between two RECS in s.
    svids
        SVIDs of the satellites in the recording.
    sample_rate_hz
        Sampling rate of both bands in Hz. The rate is slightly above the 5.115 MHz that E6 needs, unless a jammer is
        wider.
    """

    name: str = ""
    faster: Annotated[float, Field(ge=1, le=100)] = 1.0
    first_s: Annotated[int, Field(ge=0)]
    end_s: Annotated[int, Field(ge=1)]
    every_s: Annotated[int, Field(ge=1, le=60)]
    svids: tuple[int, ...]
    sample_rate_hz: Annotated[float, Field(ge=5.2e6, le=25e6)] = 5.2e6


class Scene(Section):
    """Scene of the threat table: a campaign that shows an attack."""

    name: str  # name of the scene, unique within a threat
    settings: tuple[str, ...] = ()  # values KEY=VALUE, as for `--set`, that replace values of `base`
    attack: tuple[dict[str, Any], ...] = ()  # `[[attack]]` tables of the scene
    draw: dict[str, Draw] = Field(default_factory=dict)  # values that each seed draws at random, by dotted key
    draws_of: str = ""  # earlier name of the scene, which still determines the drawn values; empty if unchanged
    # Reasons why the measured outcome differs from the expected outcome, by level.
    notes: dict[Literal["1", "2", "3"], str] = Field(default_factory=dict)
    recording: tuple[ShortRecording, ...] = ()  # recordings made from the scene


class Threat(Section):
    """Row of the threat table: an attack with its scenes."""

    id: Annotated[str, Field(pattern=r"^A\d+$")]  # number of the attack, such as `A5`
    name: str  # description of the attack
    e1: str  # parameters of the attack on E1
    e6: str  # parameters of the attack on E6
    source: str  # source of the attack and its parameters
    # Expected outcome by level: a word of `OUTCOMES`, which may be followed by a colon and a reason.
    expected: dict[Literal["1", "2", "3"], Annotated[str, Field(pattern=rf"^({'|'.join(OUTCOMES)})(: .+)?$")]]
    scene: Annotated[tuple[Scene, ...], Field(min_length=1)]

    def outcome(self, level: int) -> tuple[str, str]:
        """Return the expected outcome of a level, one of `OUTCOMES`, and the reason, which may be empty."""
        word, _, reason = self.expected[str(level)].partition(": ")  # type: ignore[index]
        return word, reason


class _ThreatFile(Section):
    base: dict[str, Any]
    threat: tuple[Threat, ...]


@cache
def _table() -> _ThreatFile:
    table: _ThreatFile = validated(TypeAdapter(_ThreatFile), read_toml(THREATS_FILE), THREATS_FILE)
    return table


def read_threats() -> tuple[Threat, ...]:
    """Return the rows of the threat table."""
    return _table().threat


def scene_attacks(threat: Threat, scene: Scene, seed: int) -> tuple[dict[str, Any], ...]:
    """Return the `[[attack]]` tables of a scene with the values that a seed draws.

    The function raises `VestigeError` if a draw names an attack that the scene does not have.
    """
    raw = overridden({"attack": [dict(one) for one in scene.attack]}, _drawn(threat, scene, seed))
    return tuple(raw["attack"])


def scene_scenario(
    threat: Threat,
    scene: Scene,
    seed: int,
    *,
    attacked: bool = True,
    settings: tuple[str, ...] = (),
    attacks: tuple[dict[str, Any], ...] | None = None,
) -> CampaignScenario:
    """Return the campaign of a scene with one seed, which also determines the values that the scene draws.

    Parameters
    ----------
    threat, scene, seed
        Row of the threat table, a scene of this row, and seed of the campaign.
    attacked
        Whether the campaign has the attacks of the scene. The values of all other tables do not depend on `attacked`.
    settings
        Values of `--set`, which replace values of the scene. Values of attacks are used only if `attacked` is true.
    attacks
        `[[attack]]` tables that replace the tables of `scene_attacks`; None for no replacement.

    Raises
    ------
    InputFileError
        If the tables with all replaced values are not a valid campaign.
    VestigeError
        If a setting does not have the form KEY=VALUE, or removes a key that does not exist.
    """
    raw = overridden(_table().base, (f"seed={seed}", *scene.settings))
    if attacked:
        raw = raw | {"attack": list(scene_attacks(threat, scene, seed) if attacks is None else attacks)}
    raw = overridden(raw, (one for one in settings if attacked or not one.startswith(("attack=", "attack."))))
    return validated(_CAMPAIGN, raw, THREATS_FILE)


def _drawn(threat: Threat, scene: Scene, seed: int) -> tuple[str, ...]:
    rng = stream(seed, "threat", threat.id, scene.draws_of or scene.name)
    return tuple(f"{key}={draw.value(float(rng.random()))!r}" for key, draw in scene.draw.items())
