"""Make recordings of some seconds from scenes of the threat table, for a receiver that tracks the samples.

A scene lasts 5 to 60 minutes. At 12.5 MHz, the int8 samples of 15 minutes need 45 GB, and tracking the samples would
take about 15 minutes. So a recording is a part of the scene, and differs from the scene only in the following points:

* A slow attack is accelerated by the factor `faster`. Every time in the tables of the attack, counted from its start,
  and every duration is divided by the factor. Powers, delays and the values that the seed draws do not change.
* The interval between two RECS is shorter, and some satellites are left out.
* If the recording begins before the attack, the receiver is locked when the attack begins. If the recording begins
  later, the receiver is switched on during the attack, as in the scene (`acquired`).
* The sampling rate is slightly above the lowest rate that E6 allows, unless a jammer is wider. The stated limit of the
  clock error is 10 ms. So the search for E6 signals at other times than E1 predicts covers 10 ms on both sides, not 1
  s.

The file `threats.toml` gives the part of the scene, the factor and the satellites of each recording.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from vestige.scenario.campaign import CampaignScenario
from vestige.threats.scenes import Scene, ShortRecording, Threat, read_threats, scene_attacks, scene_scenario

_CLOCK_TRUSTED_S = 0.01
_TIMES = ("start_s", "stop_s", "turn_s")
_ACQUIRED = ("e1-asynchronous", "meaconing")  # kinds of attack with the key `acquired`
_DURATIONS = ("rise_s", "fall_s", "period_s", "guard_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedScene:
    """Scene of the threat table as a recording."""

    threat: Threat
    scene: Scene
    recording: ShortRecording
    seed: int = 0

    @property
    def name(self) -> str:
        """Number of the threat, and name of the recording, or of the scene if the recording has no name.

        An example is `A1 receiver already tracking`.
        """
        return f"{self.threat.id} {self.recording.name or self.scene.name}"

    def scenario(self, *, attacked: bool = True) -> CampaignScenario:
        """Return the campaign, with or without its attack, whose epochs `first_s` to `end_s` are recorded."""
        how = self.recording
        settings = [
            f"epochs={how.end_s}",
            f"recs.every={how.every_s}",
            f"constellation.svids={list(how.svids)}",
            f"receiver.sample_rate_hz={how.sample_rate_hz!r}",
            f"receiver.time_uncertainty_s={_CLOCK_TRUSTED_S!r}",
        ]
        attacks = scene_attacks(self.threat, self.scene, self.seed)
        start_s = min((one.get("start_s", 0.0) for one in attacks), default=0.0)
        faster = tuple(_faster(one, how.faster, start_s) for one in attacks)
        if how.first_s < start_s:
            faster = tuple({**one, "acquired": False} if one["kind"] in _ACQUIRED else one for one in faster)
        return scene_scenario(
            self.threat, self.scene, self.seed, attacked=attacked, settings=tuple(settings), attacks=faster
        )


def recorded_scenes(seed: int = 0) -> Iterator[RecordedScene]:
    """Yield all recordings of the scenes of the threat table."""
    for threat in read_threats():
        for scene in threat.scene:
            for recording in scene.recording:
                yield RecordedScene(threat=threat, scene=scene, recording=recording, seed=seed)


def _faster(table: dict[str, Any], factor: float, start_s: float) -> dict[str, Any]:
    """Return the table of an accelerated attack: times since its start and durations are divided by the factor."""

    def changed(key: str, value: Any) -> Any:
        if isinstance(value, dict):
            return _faster(value, factor, start_s)
        if key in _TIMES:
            return start_s + (value - start_s) / factor
        return value / factor if key in _DURATIONS else value

    return {key: changed(key, value) for key, value in table.items()}
