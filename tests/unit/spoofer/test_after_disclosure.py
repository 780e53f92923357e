"""The forger who has the disclosed key: what is on air, and what his victim's clock makes of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import level_verdicts
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.errors import VestigeError
from vestige.receiver.snapshots.searches import DrawnSearches
from vestige.records import Band, Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.spoofer.after_disclosure import ForgeryAfterDisclosure
from vestige.spoofer.spoofer import Spoofer
from vestige.theory.search_budget import SEARCH_P_FA
from vestige.threats.scenes import read_threats, scene_scenario

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
T = np.arange(4.0)
FORGER = 'attack=[{kind="forgery-after-disclosure", delay_s=45.00137, power_db=3.0}]'
NULLED = "attack.1.gain_db=-inf"  # nothing is nulled: the true signal of E1 stays
(A17,) = (threat for threat in read_threats() if threat.id == "A17")


def test_true_chips_without_noise_late_on_both_bands_with_a_range_of_the_attackers_choice() -> None:
    spoofer = Spoofer(attacks=(ForgeryAfterDisclosure(delay_s=45.0, power_db=3.0, range_offset_m=-2000.0, svids=(5,)),))
    for band in Band:
        effects = spoofer.effects(band, 5, T)
        assert effects.delay_m[:, 0] == pytest.approx(np.full(4, 45.0 * SPEED_OF_LIGHT_MPS - 2000.0), rel=1e-12)
        assert np.all(effects.power_db == 3.0)
        assert not effects.forged_chips.any()
        assert np.all(effects.rise(band) == 0.0)
        assert np.all(spoofer.effects(band, 6, T).power_db == -np.inf)


@pytest.mark.parametrize("delay_s", [0.0, -1.0, 120.1, np.nan, np.inf])
def test_how_late_a_forger_is(delay_s: float) -> None:
    with pytest.raises(ValueError, match="expected a delay of more than 0 s and at most 120 s"):
        ForgeryAfterDisclosure(delay_s=delay_s, power_db=0.0)


@pytest.mark.parametrize(("key_delay", "every", "known_s"), [(0, 30, 31), (1, 30, 61), (0, 20, 31), (1, 45, 61)])
def test_nobody_makes_the_chips_before_the_key_is_complete(key_delay: int, every: int, known_s: float) -> None:
    """A key is complete 31 s after the start of its subframe; the first RECS begins with a subframe."""
    settings = (f"recs.key_delay={key_delay}", "epochs=10", f"interval_s={every}.0", 'fidelity="correlators"', FORGER)
    load_scenario(QUICK, (*settings, f"attack.0.delay_s={known_s}"))
    with pytest.raises(VestigeError, match=rf"attack.0.delay_s.*{known_s - 0.1:g} s.*at least {known_s} s"):
        load_scenario(QUICK, (*settings, f"attack.0.delay_s={known_s - 0.1}"))


def test_a_clock_that_is_wrong_by_a_constant_is_for_drawn_correlators() -> None:
    with pytest.raises(VestigeError, match=r"receiver.clock_offset_s.*-40 with samples"):
        load_scenario(QUICK, ["receiver.clock_offset_s=-40", 'fidelity="samples"'])
    scenario = load_scenario(QUICK, ["receiver.clock_offset_s=-40", 'fidelity="correlators"'])
    assert isinstance(scenario, CampaignScenario)
    with pytest.raises(VestigeError, match=r"receiver.clock_offset_s: found -40, expected 0 for a recording"):
        AcasTestCase(scenario=scenario, first=0, end=1)


def _scenario(*settings: str) -> CampaignScenario:
    """Return a minute and a half of A17, with an RECS at 0, 30, 60 and 90 s."""
    return scene_scenario(A17, A17.scene[0], 0, settings=("epochs=91", "attack.0.power_db=3.0", *settings))


def _verdicts(*settings: str) -> dict[int, set[Status]]:
    """Return the verdicts of all satellites with RECS, by level."""
    levels, names = (1, 2, 3), np.array(list(Status))
    found = level_verdicts(direct_results(ScenarioPlan(scenario=_scenario(*settings))), levels)
    return {
        level: set(names[one.status[one.recs][one.seen[one.recs]]]) for level, one in zip(levels, found, strict=True)
    }


def test_a_late_clock_makes_what_was_forged_authentic() -> None:
    """The limit of the disclosure rule: no level sees it, and the ranges are 45 s off."""
    assert _verdicts() == {level: {Status.AUTHENTIC} for level in (1, 2, 3)}


def test_two_signals_on_e1_give_it_away_at_level_2() -> None:
    found = _verdicts(NULLED)
    assert found[1] == {Status.AUTHENTIC}
    assert Status.AUTHENTIC not in found[2] | found[3]


@pytest.mark.parametrize(
    "settings",
    [("receiver.clock_offset_s=0.0",), ("receiver.time_uncertainty_s=22.0",), ("receiver.time_uncertainty_s=46.0",)],
    ids=["a clock that is right", "too uncertain for the key delay", "an upper limit that holds the error"],
)
def test_a_clock_that_is_right_or_known_to_be_uncertain_proves_nothing(settings: tuple[str, ...]) -> None:
    found = _verdicts(*settings)
    assert found[1] == {Status.NOT_AVAILABLE}
    assert Status.AUTHENTIC not in found[2] | found[3]


def test_the_reason_names_the_time_and_the_disclosure() -> None:
    """Received 45 s and the travel time after 16:00:00; the key of KDI 0 is on air from 22 s after its subframe."""
    receiver = _scenario("receiver.clock_offset_s=0.0").simulated_receiver
    block = receiver.snapshots(0, tuple(one.advance(0, 1) for one in receiver.truth()))
    measured = AcasProcessor().measure(block, receiver.assistance)
    reason = measured.why_unavailable(0, 0)
    assert re.search(
        r"not provably received before.*16:00:45.* ± 1 s by the receiver's clock, key on air from .*16:00:22", reason
    ), reason


SECOND = (
    'attack=[{kind="forgery-after-disclosure", delay_s=45.00137, power_db=3.0},'
    '{kind="forgery-after-disclosure", delay_s=46.50237, power_db=1.0}]'
)


def test_the_searches_look_where_the_late_clock_has_the_recs() -> None:
    """Two forgers within ±15 s of that clock are found, the true signal 45 s before them is not."""
    receiver = _scenario(SECOND, "epochs=1").simulated_receiver
    block = receiver.snapshots(0, tuple(one.advance(0, 1) for one in receiver.truth()))
    assert isinstance(block.searches, DrawnSearches)
    finds = block.searches.finds(SEARCH_P_FA)
    assert np.all(finds.exhaustive_signals == 2)
    # that of the forger whom E1 follows; places are kept in single precision, in steps of 1024 m at 45 s
    assert np.all(np.abs(finds.exhaustive_earliest_m) <= 1024.0)
    received_s = block.received_at.since(receiver.simulations[0].start)
    assert np.all((received_s > 0.08) & (received_s < 0.2))
    assert finds.earliest_s == pytest.approx(received_s, abs=1e-6)
