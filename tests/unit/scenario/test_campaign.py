from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from vestige.errors import InputFileError, VestigeError
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.empirical_ionosphere import EmpiricalIonosphere
from vestige.receiver.errors.ionosphere import IONOSPHERE_PRESETS, HeavyTailedIonosphere
from vestige.receiver.errors.multipath import LmsLiteMultipath
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario, scenario_schema
from vestige.scenario.toml.toml_file import overridden
from vestige.scenario.warnings import scenario_warnings

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


@pytest.mark.parametrize(
    "setting",
    ["epochs", "epochs=", "epochs=ten", "=1", "epochs.more=1", "a b=1", "epochs=1\nseed=2", "epochs=none", "recs=none"],
)
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
        ("receiver.ionosphere.tail=1", "receiver.ionosphere.tail"),
        ("receiver.ionosphere.kind='none'", "receiver.ionosphere.kind"),
        ("receiver.ionosphere.kind=none", "receiver.ionosphere.kind"),
        ("receiver.ionosphere.preset='2013'", "receiver.ionosphere.preset"),
        ("receiver.multipath.elevation_deg=12", "receiver.multipath.preset"),
        ("receiver.front_end={bandwidth_hz=12.5e6}", "receiver.front_end"),
        ("receiver.front_end.oversampling=2", "receiver.front_end"),
        ("processor.tap_spacing_m=94", "processor"),
        ("processor.budget.hardware_m=inf", "processor.budget.hardware_m"),
        ("start='2026-11-21T12:00:00.5 GST'", "start"),
        ("start='9999-12-31T23:59:59 UTC'", "start"),
        ("start='99999:0'", "start"),
        ("seed=1e300", "seed"),
        ("interval_s=nan", "interval_s"),
    ],
)
def test_what_is_wrong_is_named(setting: str, place: str) -> None:
    with pytest.raises(InputFileError) as error:
        _quick(setting)
    assert error.value.place == place


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        (("epochs=100000000", "interval_s=3600.0"), "epochs"),
        (("epochs=100000000",), "epochs"),
        (("epochs=10000000", "receiver.clock=none"), "line_of_sight"),
        (("epochs=10000000", "line_of_sight=none"), "receiver.clock"),
        (("line_of_sight.s0_m=2e8",), "line_of_sight"),
        (("line_of_sight.a_mps2=1.0",), "line_of_sight"),
        (("line_of_sight.amplitude_m=1e3",), "line_of_sight"),
        (("line_of_sight={amplitude_m=1e-9, omega_radps=1e4}",), "line_of_sight"),
    ],
)
def test_a_run_that_goes_too_far(settings: tuple[str, ...], place: str) -> None:
    with pytest.raises(InputFileError) as error:
        _quick('fidelity="samples"', *settings)
    assert error.value.place == place


def test_a_quantised_signal_is_weak_at_the_fidelity_without_samples() -> None:
    strong = ("receiver.cn0_dbhz=52", "receiver.front_end={bits=2}")
    assert _quick(*strong, 'fidelity="samples"').simulation().front_end.bits == 2
    assert _quick(*strong, "receiver.front_end.bits=none").simulation().front_end.transparent
    with pytest.raises(InputFileError) as error:
        _quick(*strong)
    assert error.value.place == "receiver.cn0_dbhz"


def test_none_takes_a_table_away() -> None:
    receiver = _quick("receiver.multipath=none", "receiver.e1_tracking = none", "receiver.clock.kind=none").receiver
    assert (receiver.multipath, receiver.e1_tracking, receiver.clock) == (None, None, TwoStateClock())
    models = _quick("receiver.multipath=none").simulation().models
    assert (models.multipath, models.n_rays) == (None, 1)


def test_presets_stand_for_numbers() -> None:
    for name, preset in IONOSPHERE_PRESETS.items():
        assert _quick(f"receiver.ionosphere.preset='{name}'").receiver.ionosphere == preset()
    changed = _quick("receiver.ionosphere.preset='2017'", "receiver.ionosphere.tail_scale_m=1").receiver.ionosphere
    assert changed == HeavyTailedIonosphere(core_sigma_m=0.76, tail_start_m=1.55, tail_scale_m=1.0)
    multipath = _quick('receiver.multipath={kind="lms-lite", elevation_deg=17.5, n_rays=3}').receiver.multipath
    assert multipath == LmsLiteMultipath(power_db=-16.0, mean_excess_m=40.0, n_rays=3, mean_life_m=0.0)
    assert _quick("receiver.multipath.preset='open-sky'").receiver.multipath == LmsLiteMultipath.open_sky()


def test_a_preset_without_memory_has_no_life_in_seconds() -> None:
    with pytest.raises(InputFileError, match="mean_life_s"):
        _quick("receiver.multipath.mean_life_s=10")
    lasting = _quick("receiver.multipath.mean_life_s=10", "receiver.multipath.mean_life_m=3").receiver.multipath
    assert lasting is not None
    assert lasting.death_rate_hz == pytest.approx(1 / 3 + 1 / 10)


def test_a_measured_ionosphere_lies_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    scenario = tmp_path / "here" / "mine.toml"
    text = (SCENARIOS / "quick.toml").read_text().replace('kind = "heavy-tailed"\npreset = "2014-late"', "{}")
    scenario.write_text(text.format('kind = "empirical"\npath = "../residuals.csv"\ntau_s = 60.0'))
    residuals = tmp_path / "residuals.csv"
    residuals.write_text("e6_minus_e1_m\n1.5\n-2.5\n")
    loaded = load_scenario(scenario)
    assert isinstance(loaded, CampaignScenario)
    model = loaded.simulation().models.ionosphere
    assert isinstance(model, EmpiricalIonosphere)
    assert (model.samples_m.tolist(), model.tau_s) == ([1.5, -2.5], 60.0)
    drawn_m = loaded.simulation().truth().advance(0, 200).iono_diff_m
    assert (drawn_m.min(), drawn_m.max()) == (-2.5, 1.5)
    before = loaded.model_dump_json()
    assert load_scenario(scenario).model_dump_json() == before
    residuals.write_text("e6_minus_e1_m\n1.5\n-2.4\n")
    assert load_scenario(scenario).model_dump_json() != before  # another scenario: its results are not continued
    residuals.write_text("e6_minus_e1_m\n1.5\nmuch\n")
    with pytest.raises(InputFileError) as error:
        load_scenario(scenario)
    assert (error.value.path.name, error.value.place) == ("residuals.csv", "line 3")


def test_a_filter_that_rounds_the_peak_is_named() -> None:
    filtered = "receiver.front_end={bandwidth_hz=10.23e6, oversampling=2}"
    for fidelity in ("samples", "correlators"):
        (line,) = scenario_warnings(_quick(f'fidelity="{fidelity}"', filtered))
        assert "10.23 MHz" in line
        assert "15 m apart" in line
    assert scenario_warnings(_quick("receiver.front_end={bandwidth_hz=60e6, oversampling=8}")) == ()
    assert scenario_warnings(_quick("receiver.front_end={bits=2}")) == ()


def test_a_commensurate_rate_is_named() -> None:
    (line,) = scenario_warnings(_quick('fidelity="samples"', "receiver.sample_rate_hz=10.23e6"))
    assert "29.3 m" in line
    assert "10.3 MHz" in line
    assert scenario_warnings(_quick("receiver.sample_rate_hz=10.23e6")) == ()  # no samples, no staircase
    for path in SCENARIOS.glob("*.toml"):
        assert scenario_warnings(load_scenario(path)) == ()
    recording = load_scenario(SCENARIOS / "first_light.toml", ["receiver.sample_rate_hz=20.46e6"])
    assert "14.7 m" in scenario_warnings(recording)[0]


def test_both_scenarios_of_the_paper_are_the_same_but_for_length() -> None:
    harsh = load_scenario(SCENARIOS / "harsh.toml", ["epochs=20_000", "seed=1", 'fidelity="correlators"'])
    assert harsh == _quick()


def _validator() -> Any:
    return jsonschema.Draft202012Validator(scenario_schema())


def _jsonable(value: Any) -> Any:
    """Return TOML tables as JSON has them: arrays are lists, times text."""
    return json.loads(json.dumps(value, default=str))


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda path: path.stem)
def test_the_schema_holds_for_every_scenario(path: Path) -> None:
    raw = _jsonable(tomllib.loads(path.read_text()))
    assert list(_validator().iter_errors(raw)) == []


@pytest.mark.parametrize(
    ("setting", "good"),
    [
        ('receiver.multipath={kind="lms-lite", elevation_deg=12}', True),
        ('receiver.multipath={kind="lms-lite", preset="open-sky", power_db=-20.0}', True),
        ('receiver.multipath={kind="lms-lite", preset="open-sky", elevation_deg=40}', False),
        ('receiver.multipath={kind="lms-lite", preset="dry"}', False),
        ('receiver.multipath={kind="lms-lite", power_db=-20.0}', False),
        ('receiver.multipath={kind="lms-lite", power_db=-20.0, mean_excess_m=30.0}', True),
        ('receiver.ionosphere={kind="heavy-tailed", elevation_deg=12}', False),
        ('receiver.ionosphere={kind="heavy-tailed", preset="2017-high", correlation="gauss-markov"}', True),
        ('receiver.ionosphere={kind="heavy-tailed"}', False),
        ('receiver.ionosphere={kind="empirical"}', False),
        ("receiver.front_end={bits=4}", False),
        ("receiver.front_end={bandwidth_hz=8e6, bits=2, agc=false}", True),
        ("receiver.front_end={bandwith_hz=8e6}", False),
    ],
)
def test_the_schema_and_the_loader_agree(setting: str, good: bool) -> None:
    raw = overridden(tomllib.loads((SCENARIOS / "quick.toml").read_text()), [setting])
    assert _validator().is_valid(_jsonable(raw)) is good
    if good:
        _quick(setting)
    else:
        with pytest.raises(InputFileError):
            _quick(setting)


def test_schema_names_the_kinds() -> None:
    text = str(scenario_schema())
    for kind in ("campaign", "recording", "two-state", "lms-lite", "heavy-tailed", "betz"):
        assert f"'{kind}'" in text
