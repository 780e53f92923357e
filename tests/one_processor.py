"""What a campaign's processor says on its own, beside the columns of a campaign: the same bits, however it is cut."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np
import xarray

import vestige as vs
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.campaign.columns.judged_columns import judged_columns
from vestige.campaign.levels import level_verdicts
from vestige.campaign.store.attributes import scenario_of
from vestige.records.snapshot_block import SnapshotBlock
from vestige.scenario.campaign import CampaignScenario
from vestige.threats.scenes import Scene, Threat, read_threats, scene_scenario

SVIDS = (6, 7, 12, 13, 24)  # of eight: enough for RAIM, and some of those that are attacked


def at_level(scenario: CampaignScenario, level: int) -> CampaignScenario:
    """Return a campaign with a processor of some level."""
    return scenario.replaced(processor=scenario.processor.model_copy(update={"level": level}))


def threat_scenes() -> dict[str, tuple[Threat, Scene]]:
    """Return every scene of the threat table by its name."""
    return {f"{threat.id} {scene.name}": (threat, scene) for threat in read_threats() for scene in threat.scene}


def short_scene(
    threat: Threat, scene: Scene, seed: int, level: int, *, before_s: int = 20, after_s: int = 15, every: int = 3
) -> CampaignScenario:
    """Return a scene of the threat table with more RECS in less time, and fewer satellites.

    Parameters
    ----------
    threat, scene, seed, level
        Scene, seed and level of the processor.
    before_s, after_s
        Time before the attack begins, and after that.
    every
        Time between two RECS in s.
    """
    whole = scene_scenario(threat, scene, seed)
    starts_s = [one.start_s for one in whole.attack]
    late_s = max(0.0, min(starts_s, default=0.0) - before_s)
    attack = tuple(replace(one, start_s=one.start_s - late_s) for one in whole.attack)
    recs = whole.recs.model_copy(update={"every": every})
    assert whole.constellation is not None
    few = whole.constellation.model_copy(update={"svids": SVIDS})
    return at_level(whole, level).replaced(attack=attack, epochs=before_s + after_s, recs=recs, constellation=few)


def blocks(scenario: CampaignScenario, sizes: tuple[int, ...]) -> Iterator[SnapshotBlock]:
    """Yield the snapshots of a campaign in blocks of some numbers of epochs, in turn."""
    receiver = scenario.simulated_receiver
    truth, first = receiver.truth(), 0
    for size in cycle(sizes):
        count = min(size, scenario.epochs - first)
        if not count:
            return
        yield receiver.snapshots(first, tuple(one.advance(first, count) for one in truth))
        first += count


@dataclass(frozen=True, kw_only=True, eq=False)
class Said:
    """What a processor said of a campaign: the columns of a store, and whatever a store does not keep.

    Records are texts, whose numbers have all digits, because a NaN is not equal to itself.
    """

    columns: dict[str, np.ndarray]
    covariance_m2: np.ndarray | None  # of the positions; None without positions
    verdicts: list[str]
    changes: list[str]  # of the state that the receiver shows


def said_of(scenario: CampaignScenario, snapshots: Iterable[SnapshotBlock]) -> Said:
    """Return what the processor says, from `step` on blocks of a campaign."""
    processor, assistance, state = vs.processor_of(scenario), scenario.simulated_receiver.assistance, None
    found: list[VerdictBlock] = []
    for block in snapshots:
        step = processor.step(state, block, assistance)
        state = step.state
        found.append(step.block)
    return said_in(found)


def said_in(found: Sequence[VerdictBlock]) -> Said:
    """Return what is said in the verdicts of consecutive blocks."""
    pieces: list[dict[str, np.ndarray]] = []
    for one in found:
        position = one.position
        pieces.append(judged_columns(one) | ({} if position is None else {"fix_position_m": position.position_m}))
    covariances = [one.position.covariance_m2 for one in found if one.position is not None]
    return Said(
        columns={
            name: np.concatenate([piece[name] for piece in pieces], axis=1 if name.startswith("check_") else 0)
            for name in pieces[0]
        },
        covariance_m2=np.concatenate(covariances) if covariances else None,
        verdicts=[repr(verdict) for one in found for verdict in one.verdicts()],
        changes=[repr(change) for one in found for change in one.changes()],
    )


def assert_columns(results: xarray.Dataset, said: Said) -> None:
    """Fail unless the columns of a campaign have the bits of what its processor said."""
    for name, values in said.columns.items():
        column = results[name].sel(fix="authenticated") if name == "fix_position_m" else results[name]
        assert column.values.tobytes() == values.astype(column.dtype).tobytes(), name


def assert_says(results: xarray.Dataset, said: Said) -> None:
    """Fail unless a campaign's columns have the bits of what its processor said, and give the same when judged again.

    Judged again, the columns give the verdicts with all their checks and reasons, the changes of state, and the
    positions with their covariance.
    """
    assert_columns(results, said)
    again = said_in(level_verdicts(results, (scenario_of(results).processor.level,)))
    assert again.verdicts == said.verdicts
    assert again.changes == said.changes
    for name, values in said.columns.items():
        assert again.columns[name].tobytes() == values.tobytes(), name
    assert (again.covariance_m2 is None) == (said.covariance_m2 is None)
    if again.covariance_m2 is not None and said.covariance_m2 is not None:
        assert again.covariance_m2.tobytes() == said.covariance_m2.tobytes()
