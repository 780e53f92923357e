"""A campaign as a source: any cut, both fidelities, one line of sight and a sky, through the processor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vestige
from sky_builder import sky_scenario
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.errors import VestigeError
from vestige.records import Status
from vestige.records.snapshot_block import SnapshotBlock
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.scenario_processor import processor_of
from vestige.simulated.simulated_source import SimulatedSource, simulate
from vestige.source import Source

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


def _quick(*settings: str) -> CampaignScenario:
    scenario = load_scenario(SCENARIOS / "quick.toml", settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


@pytest.mark.parametrize(
    "scenario",
    [
        _quick("epochs=40", "receiver.cn0_dbhz=45", "receiver.cn0_e1_dbhz=45"),
        _quick("epochs=3", "receiver.cn0_dbhz=45", "receiver.cn0_e1_dbhz=45", 'fidelity="samples"'),
        sky_scenario("epochs=61"),
        sky_scenario("epochs=2", "recs.every=1", 'fidelity="samples"', "constellation.svids=[6]"),
    ],
    ids=["line of sight", "line of sight, samples", "sky", "sky, samples"],
)
def test_the_processor_runs_on_a_campaign(scenario: CampaignScenario) -> None:
    source = simulate(scenario)
    assert isinstance(source, Source)
    verdicts = list(processor_of(scenario).run(source))
    assert len(verdicts) == scenario.epochs * len(scenario.simulations)
    recs = [one for one in verdicts if one.index % scenario.recs.every == 0]
    assert {one.status for one in recs} == {Status.AUTHENTIC}
    others = {one.status for one in verdicts if one.index % scenario.recs.every}
    assert others <= {Status.NOT_AVAILABLE}


@pytest.mark.slow
def test_the_size_of_the_blocks_changes_no_verdict() -> None:
    scenario = sky_scenario("epochs=65", "processor.level=3")
    processor = processor_of(scenario)
    whole, parts = (
        [step.block for step in processor.steps(source, assistance=source.assistance)]
        for source in (simulate(scenario), simulate(scenario, block_epochs=31))
    )
    assert [one.status.shape[0] for one in parts] == [31, 31, 3]
    for name in ("status", "state", "cause", "range_in_use_m"):
        joined = np.concatenate([getattr(one, name) for one in parts])
        assert joined.tobytes() == getattr(whole[0], name).tobytes()


def test_a_source_begins_anew_each_time() -> None:
    source = simulate(_quick("epochs=5"))
    first, second = (next(iter(source)) for _ in range(2))
    assert isinstance(first, SnapshotBlock)
    assert first.e1.pseudorange_m.tobytes() == second.e1.pseudorange_m.tobytes()


def test_a_path_will_do(tmp_path: Path) -> None:
    source = vestige.simulate(str(SCENARIOS / "quick.toml"), block_epochs=7)
    assert isinstance(source, SimulatedSource)
    assert len(next(iter(source)).time) == 7
    with pytest.raises(VestigeError, match='found kind = "recording", expected "campaign"'):
        simulate(SCENARIOS / "first_light.toml")
    with pytest.raises(ValueError, match="one epoch at least"):
        simulate(SCENARIOS / "quick.toml", block_epochs=0)


def test_a_cipher_that_the_processor_does_not_expect_gives_no_signal() -> None:
    """The service encrypts in CTR mode: a processor for CTR finds all RECS, one for CBC none."""
    strong = ("receiver.cn0_dbhz=45", "receiver.cn0_e1_dbhz=45")
    scenario = _quick("epochs=2", *strong, 'fidelity="samples"', 'recs.cipher_mode="ctr"')
    receiver = scenario.simulated_receiver
    block = receiver.snapshots(0, tuple(one.advance(0, 2) for one in receiver.truth()))
    for mode, status in ((CipherMode.CTR, Status.AUTHENTIC), (CipherMode.CBC, Status.NOT_DETECTED)):
        processor = replace(processor_of(scenario), cipher_mode=mode)
        step = processor.step(None, block, receiver.assistance)
        assert [one.status for one in step.verdicts] == [status] * 2
