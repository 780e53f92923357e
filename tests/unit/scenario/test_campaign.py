from __future__ import annotations

from pathlib import Path

import pytest

from vestige.errors import InputFileError, VestigeError
from vestige.receiver.clock import TwoStateClock
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario, schema

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


def _quick(*settings: str) -> CampaignScenario:
    scenario = load_scenario(SCENARIOS / "quick.toml", settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


def test_the_models_are_the_configuration() -> None:
    assert _quick().receiver.clock == TwoStateClock()
    assert _quick("receiver.clock.h0_s=0.0").receiver.clock == TwoStateClock(h0_s=0.0)
    assert _quick().receiver.bias is None
    assert _quick('receiver.bias={kind="bias", bgd_sigma_m=1.5}').receiver.bias is not None


def test_settings_replace_values() -> None:
    scenario = _quick("receiver.cn0_dbhz=37", "epochs=10", 'processor.detector="maximum"')
    assert (scenario.receiver.cn0_dbhz, scenario.epochs, scenario.processor.detector) == (37.0, 10, "maximum")


@pytest.mark.parametrize("setting", ["epochs", "epochs=", "epochs=ten", "=1", "epochs.more=1", "a b=1"])
def test_bad_settings(setting: str) -> None:
    with pytest.raises(VestigeError):
        _quick(setting)


@pytest.mark.parametrize(
    ("setting", "place"),
    [
        ("epochs=0", "epochs"),
        ("receiver.cn0=35", "receiver.cn0"),
        ("receiver.clock.kind='three-state'", "receiver.clock.kind"),
        ("receiver.clock.h0=1", "receiver.clock.h0"),
        ("interval_s=0.25", "interval_s"),
        ("recs.duration_ms=3", "recs.duration_ms"),
    ],
)
def test_what_is_wrong_is_named(setting: str, place: str) -> None:
    with pytest.raises(InputFileError) as error:
        _quick(setting)
    assert error.value.place == place


def test_both_scenarios_of_the_paper_are_the_same_but_for_length() -> None:
    harsh = load_scenario(SCENARIOS / "harsh.toml", ["epochs=20_000", "seed=1", 'fidelity="correlators"'])
    assert harsh == _quick("receiver.multipath.n_rays=1")


def test_schema_names_the_kinds() -> None:
    text = str(schema())
    for kind in ("campaign", "recording", "two-state", "lms-lite", "heavy-tailed", "betz"):
        assert f"'{kind}'" in text
