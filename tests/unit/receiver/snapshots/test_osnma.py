"""Pieces of OSNMA subframes, epoch by epoch, against pages counted one by one."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import sky_scenario
from vestige.acas_processor.checks.osnma_subframes import subframes
from vestige.acas_processor.monitoring.memory import OsnmaMemory
from vestige.constants import PAGES_A_SUBFRAME
from vestige.records.snapshot_block import OsnmaBlock, SnapshotBlock
from vestige.scenario.campaign import CampaignScenario


def _block(scenario: CampaignScenario) -> tuple[SnapshotBlock, OsnmaBlock]:
    receiver = scenario.simulated_receiver
    block = receiver.snapshots(0, tuple(one.advance(0, scenario.epochs) for one in receiver.truth()))
    assert block.osnma is not None
    return block, block.osnma


@pytest.mark.parametrize("interval_s", [1.0, 2.5, 30.0, 60.0])
def test_each_page_is_due_once_and_whole_subframes_end_once(interval_s: float) -> None:
    """16:00:00 is the start of a subframe: in 5 minutes the first nine end, and their last page 1 s after the tenth."""
    epochs = int(300 / interval_s) + 1
    scenario = sky_scenario(
        f"interval_s={interval_s}", f"epochs={epochs}", "recs.every=1", "constellation.svids=[6, 24]"
    )
    block, osnma = _block(scenario)
    assert np.all(np.diff(osnma.epoch) >= 0)
    pages: dict[int, int] = {}
    for piece in range(osnma.epoch.size):
        start, bits = int(osnma.subframe[piece]), int(osnma.due[piece, 0])
        assert pages.get(start, 0) & bits == 0
        pages[start] = pages.get(start, 0) | bits
    ended = osnma.subframe[osnma.last].tolist()
    assert ended == [start for start in sorted(pages) if pages[start] == (1 << PAGES_A_SUBFRAME) - 1]
    found, _ = subframes(osnma, block.svids, OsnmaMemory())
    assert found.due.tolist() == [PAGES_A_SUBFRAME * len(block.svids)] * len(ended)
    assert np.all(found.received == found.due)
    assert np.all(found.missing == 0)
    assert len(ended) >= (9 if interval_s < 30 else 5)


def test_a_subframe_that_began_before_the_run_does_not_end_in_it() -> None:
    """The run begins 17 s into a subframe: its last page comes 16 s later and does not close it."""
    scenario = sky_scenario('start="2026-11-21T16:00:17 GST"', "epochs=60")
    _, osnma = _block(scenario)
    closed = osnma.subframe[osnma.last]
    assert closed.tolist() == [scenario.start_time.gst_seconds + 13]
    assert int(osnma.subframe[0]) == scenario.start_time.gst_seconds - 17


def test_what_a_spoofing_signal_with_data_of_its_own_brings_differs() -> None:
    attack = (
        'attack=[{kind="e1-asynchronous", start_s=60.0, power_db=20.0, delay_m=0.0, forged_nav_data=true, svids=[6]}]'
    )
    block, osnma = _block(sky_scenario("epochs=180", attack))
    column = block.svids.index(6)
    others = [place for place in range(len(block.svids)) if place != column]
    late = osnma.epoch > 70
    assert np.array_equal(osnma.differs[late, column], osnma.received[late, column])
    assert np.any(osnma.differs[late, column])
    assert not osnma.differs[:, others].any()
    assert not osnma.differs[osnma.epoch < 55].any()
    assert block.data_authenticated is not None
    assert not block.data_authenticated[100:, column].any()
    assert block.data_authenticated[:, others].all()


def test_keys_that_are_jammed_are_not_there() -> None:
    """−30 dB of C/N0 for all satellites: RECS whose key comes then have none, those before do."""
    jam = 'attack=[{kind="jamming", bands=["E1"], start_s=100.0, waveform={kind="wideband"}, j_over_n_db=30.0}]'
    scenario = sky_scenario("epochs=150", "recs.every=10", jam)
    block, _ = _block(scenario)
    recs = scenario.simulated_receiver.assistance.recs_of(block).block
    assert np.array_equal(recs.found, np.repeat(block.recs[:, None], len(block.svids), axis=1))
    key_end_s = recs.complete.since(scenario.start_time)[:, 0]
    sent = np.flatnonzero(block.recs)
    before = sent[(key_end_s[sent] < 100) & (sent < 100)]
    assert recs.with_key[before].all()
    assert not recs.with_key[sent[sent >= 100]].any()


def test_the_page_that_ends_while_e1_acquires_is_lost() -> None:
    """A page is complete at each odd second; the receiver restarts at 61 s and acquires for 1.5 s or for 4.5 s."""

    def lost(reacquisition_s: float) -> list[int]:
        attack = 'attack=[{kind="e1-asynchronous", start_s=61.0, power_db=20.0, delay_m=5e3, svids=[6]}]'
        settings = (f"receiver.reacquisition_s={reacquisition_s}", "constellation.svids=[6, 24]")
        _, osnma = _block(sky_scenario("epochs=90", attack, *settings))
        missing = osnma.due & ~osnma.received
        assert not missing[:, 1].any()
        return sorted(set(osnma.epoch[missing[:, 0] > 0].tolist()))

    assert lost(1.5) == [61]
    assert lost(4.5) == [61, 63, 65]
