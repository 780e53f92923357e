"""Simulate a campaign as a source of snapshots, for example `processor.run(simulate("scenarios/sky.toml"))`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from vestige.errors import VestigeError
from vestige.receiver.snapshots.assistance import SimulatedAssistance
from vestige.records.snapshot_block import SnapshotBlock
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

BLOCK_EPOCHS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedSource:
    """Source of a campaign's snapshots, in order of time; each iteration begins with the first snapshot.

    Attributes
    ----------
    scenario
        Campaign whose snapshots are simulated.
    block_epochs
        Number of epochs in a block; the verdicts do not depend on this number.
    """

    scenario: CampaignScenario
    block_epochs: int = BLOCK_EPOCHS

    @property
    def assistance(self) -> SimulatedAssistance:
        """RECS, group delays and keys for the snapshots of the campaign."""
        return self.scenario.simulated_receiver.assistance

    def __iter__(self) -> Iterator[SnapshotBlock]:
        """Yield the blocks of snapshots in order of time."""
        receiver = self.scenario.simulated_receiver
        processes = receiver.truth()
        for first in range(0, self.scenario.epochs, self.block_epochs):
            count = min(self.block_epochs, self.scenario.epochs - first)
            yield receiver.snapshots(first, tuple(one.advance(first, count) for one in processes))


def simulate(scenario: CampaignScenario | Path | str, *, block_epochs: int = BLOCK_EPOCHS) -> SimulatedSource:
    """Return a source that simulates the snapshots of a campaign when they are requested.

    Use `simulate` to inspect single snapshots and verdicts. Use `run` to store the results of all epochs in a folder.

    Parameters
    ----------
    scenario
        Campaign, or path of the scenario file of a campaign.
    block_epochs
        Number of epochs in a block, 1 or more. The verdicts do not depend on this number.

    Returns
    -------
    SimulatedSource
        Source of blocks of n epochs × m satellites, which `AcasProcessor.run` takes. Each iteration begins with the
        first snapshot.

    Raises
    ------
    InputFileError
        If the file cannot be read or does not describe a valid scenario.
    VestigeError
        If the scenario of the file is not a campaign.
    ValueError
        If `block_epochs` is less than 1.

    Examples
    --------
    >>> import vestige as vs
    >>> scenario = vs.load_scenario("scenarios/quick.toml", ["epochs=3", "receiver.cn0_dbhz=45"])
    >>> for verdict in vs.processor_of(scenario).run(vs.simulate(scenario)):
    ...     print(verdict.index, verdict.status.name)
    0 AUTHENTIC
    1 AUTHENTIC
    2 AUTHENTIC
    """
    if block_epochs < 1:
        raise ValueError(f"a block has one epoch at least, found {block_epochs}")
    if not isinstance(scenario, CampaignScenario):
        loaded = load_scenario(scenario)
        if not isinstance(loaded, CampaignScenario):
            raise VestigeError(f'{scenario}: found kind = "{loaded.kind}", expected "campaign"')
        scenario = loaded
    return SimulatedSource(scenario=scenario, block_epochs=block_epochs)
