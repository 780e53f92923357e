"""Attacks in scenario files: what is understood, and one clear line for what is not."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from vestige.errors import InputFileError, VestigeError
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario, scenario_schema
from vestige.scenario.warnings import scenario_warnings
from vestige.simulated.exported_case import AcasTestCase, with_default_range
from vestige.simulated.exported_case_folder import simulated
from vestige.spoofer.jammers import Chirp
from vestige.spoofer.profiles import Ramp, Table, extremes
from vestige.spoofer.repeaters import LiftOff, Nulling
from vestige.spoofer.spoofer import ALL_ATTACKS

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


def _with(tmp_path: Path, text: str, *settings: str) -> CampaignScenario:
    path = tmp_path / "scenario.toml"
    path.write_text((SCENARIOS / "quick.toml").read_text() + "\n[[attack]]\n" + text)
    scenario = load_scenario(path, settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


@pytest.mark.parametrize(
    ("name", "bank"), [("liftoff", ("processor.n_taps=13", "processor.early_reach_m=90")), ("liftoff_sudden", ())]
)
def test_the_paper_s_attack_under_its_harsh_conditions(name: str, bank: tuple[str, ...]) -> None:
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    assert isinstance(scenario, CampaignScenario)
    (attack,) = scenario.attack
    assert isinstance(attack, LiftOff)
    assert attack.bands == (Band.E6,)
    assert scenario_warnings(scenario) == ()
    harsh = load_scenario(
        SCENARIOS / "harsh.toml", ["epochs=1500", "seed=600", "receiver.ionosphere.code_only=true", *bank]
    )
    assert scenario.model_copy(update={"attack": ()}) == harsh


def test_attacks_compose(tmp_path: Path) -> None:
    scenario = _with(
        tmp_path,
        'kind = "jamming"\nj_over_n_db = 20\nwaveform = {kind = "chirp", sweep_s = 3e-5}\nbands = ["E1"]\n'
        '[[attack]]\nkind = "nulling"\nbands = ["E1", "E6"]\n'
        '[[attack]]\nkind = "time-push"\npower_db = -inf\nstart_s = 3\n'
        'delay_m = {kind = "ramp", first = 0, last = 9, start_s = 1, stop_s = 2}\n',
    )
    jam, nulling, push = scenario.attack
    assert jam.waveform == Chirp(sweep_s=3e-5)  # type: ignore[union-attr]
    assert nulling == Nulling(bands=(Band.E1, Band.E6))
    assert push.delay_m == Ramp(first=0.0, last=9.0, start_s=1.0, stop_s=2.0)  # type: ignore[union-attr]
    assert scenario_warnings(scenario) == ("attack.1 (nulling) is outside Assumption 2: it nulls the encrypted signal",)


def test_a_table_stands_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "pull.csv").write_text("time_s,value\n0,0\n10,30\n")
    text = 'kind = "lift-off"\npower_db = 3\ndelay_m = {kind = "table", path = "pull.csv"}\n'
    (attack,) = _with(tmp_path, text).attack
    assert attack.delay_m == Table(path="pull.csv", time_s=(0.0, 10.0), values=(0.0, 30.0))  # type: ignore[union-attr]
    (tmp_path / "pull.csv").write_bytes(b"\xef\xbb\xbftime_s,value\r\n0,0\r\n10,30\r\n")  # of a spreadsheet
    assert _with(tmp_path, text).attack == (attack,)
    text = 'kind = "lift-off"\npower_db = 3\ndelay_m = {kind = "table", path = "absent.csv"}\n'
    with pytest.raises(InputFileError, match=r"absent\.csv: file"):
        _with(tmp_path, text)


def test_the_points_of_a_table_stand_in_the_scenario(tmp_path: Path) -> None:
    text = 'kind = "lift-off"\npower_db = 3\ndelay_m = {{kind = "table", time_s = [0.0, {}], values = [0.0, 30.0]}}\n'
    (attack,) = _with(tmp_path, text.format(10.0)).attack
    assert attack.delay_m == Table(time_s=(0.0, 10.0), values=(0.0, 30.0))  # type: ignore[union-attr]
    with pytest.raises(VestigeError, match=r'delay_m\.time_s\.1: found the text "x", expected a number'):
        _with(tmp_path, text.format('"x"'))


def test_settings_reach_into_an_attack(tmp_path: Path) -> None:
    text = 'kind = "meaconing"\ndelay_s = 1e-6\npower_db = 3\n'
    (attack,) = _with(tmp_path, text, "attack.0.power_db=-inf", 'attack.0.bands=["E6"]').attack
    assert (attack.power_db, attack.bands) == (float("-inf"), (Band.E6,))  # type: ignore[union-attr]
    for setting in ("attack.1.power_db=3", "attack.x.power_db=3", "attack.0=3"):
        with pytest.raises(VestigeError, match="--set attack"):
            _with(tmp_path, text, setting)


LIFT = 'kind = "lift-off"\n'
FINE = LIFT + "power_db = 3\ndelay_m = 0\n"


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("power_db = 3\n", "attack.0.kind"),
        ('kind = "magic"\n', "attack.0.kind"),
        (LIFT + "power_db = 3\n", "attack.0.delay_m"),
        (FINE + "colour = 3\n", "attack.0.colour"),
        (FINE + 'bands = ["L5"]\n', "attack.0.bands.0"),
        (FINE + 'phase = {kind = "lost"}\n', "attack.0.phase.kind"),
        (FINE + 'phase = {kind = "slipping"}\n', "attack.0.phase.slip_hz"),
        (FINE + 'phase = {kind = "slipping", slip_hz = 1e12}\n', "attack.0.phase.slip_hz"),
        (FINE + "bands = []\n", "attack.0.bands"),
        (FINE + "reception_gain_db = 1e3\n", "attack.0.reception_gain_db"),
        (FINE + "start_s = -1\n", "attack.0.start_s"),
        (FINE + "svids = [99]\n", "attack.0.svids"),
        (LIFT + "power_db = 3\ndelay_m = 1e12\n", "attack.0.delay_m"),
        (LIFT + "power_db = 300\ndelay_m = 0\n", "attack.0.power_db"),
        (LIFT + "power_db = nan\ndelay_m = 0\n", "attack.0.power_db"),
        (LIFT + 'power_db = "x"\ndelay_m = 0\n', "attack.0.power_db"),
        (LIFT + "power_db = 3\ndelay_m = -inf\n", "attack.0.delay_m"),
        (LIFT + 'power_db = 3\ndelay_m = {kind = "ramp", first = 0}\n', "attack.0.delay_m.last"),
        (LIFT + 'power_db = 3\ndelay_m = {kind = "cubic"}\n', "attack.0.delay_m.kind"),
        (LIFT + 'power_db = 3\ndelay_m = {kind = "constant", level = 1, x = 1}\n', "attack.0.delay_m.x"),
        (
            LIFT + 'power_db = 3\ndelay_m = {kind = "ramp", first = 0, last = 9e4, start_s = 0, stop_s = 1}\n',
            "attack.0.delay_m",
        ),
        ('kind = "meaconing"\npower_db = 3\ndelay_s = 100\n', "attack.0.delay_s"),
        ('kind = "position-push"\npower_db = 3\ndelay_m = 0\n', "attack.0"),
        ('kind = "time-push"\npower_db = 3\ndelay_m = 0\nsvids = [3]\n', "attack.0"),
        ('kind = "jamming"\nj_over_n_db = 3\nwaveform = {kind = "chirp", sweep_s = 1}\n', "attack.0.waveform"),
        ('kind = "between-recs"\npower_db = 3\ntop_m = 9\nperiod_s = 1\n', "attack.0.guard_s"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, place: str) -> None:
    with pytest.raises(InputFileError) as error:
        _with(tmp_path, text)
    assert error.value.place == place
    assert "\n" not in str(error.value)


def test_no_power_in_both_spellings(tmp_path: Path) -> None:
    for power in ("-inf", '{kind = "constant", level = -inf}'):
        (attack,) = _with(tmp_path, LIFT + f"delay_m = 0\npower_db = {power}\n").attack
        assert extremes(attack.power_db) == (float("-inf"), float("-inf"))  # type: ignore[union-attr]


@pytest.mark.parametrize("fidelity", ["samples", "correlators"])
@pytest.mark.parametrize(
    ("waveform", "fits"),
    [
        ('kind = "cw", offset_hz = -6.2e6', True),
        ('kind = "cw", offset_hz = 6.3e6', False),
        ('kind = "chirp", bandwidth_hz = 12.5e6', True),
        ('kind = "chirp", bandwidth_hz = 12.6e6', False),
    ],
)
def test_a_waveform_lies_within_the_samples(tmp_path: Path, waveform: str, fits: bool, fidelity: str) -> None:
    """12.5 MHz. Sampling would fold it in, and the model of correlators would not: two answers to one question."""
    text = f'kind = "osnma-denial"\n[[attack]]\nkind = "jamming"\nj_over_n_db = 3\nwaveform = {{{waveform}}}\n'
    settings = ("receiver.sample_rate_hz=12.5e6", f'fidelity="{fidelity}"')
    if fits:
        _with(tmp_path, text, *settings)
        return
    with pytest.raises(InputFileError, match=r"at most 6\.25 MHz") as error:
        _with(tmp_path, text, *settings)
    assert error.value.place == "attack.1.waveform"
    _with(tmp_path, text + 'bands = ["E1"]\n', *settings)


def test_satellites_that_are_not_there(tmp_path: Path) -> None:
    text = FINE + "svids = [11]\n[[attack]]\n" + FINE + "svids = [3, 11]\n"
    assert scenario_warnings(_with(tmp_path, text)) == ("attack.1.svids: E03 not in the scenario, which has E11",)


def test_estimated_symbols_are_for_recordings(tmp_path: Path) -> None:
    scer = '[[attack]]\nkind = "scer"\npower_db = 3\ndelay_m = 0\n'
    (warning,) = scenario_warnings(_with(tmp_path, FINE + scer + 'symbols = "hard"\n'))
    assert warning.startswith('attack.1.symbols: "hard" changes nothing in a campaign')
    assert scenario_warnings(_with(tmp_path, FINE + scer)) == ()


def test_an_attack_after_the_end(tmp_path: Path) -> None:
    late = '[[attack]]\nkind = "lift-off"\nstart_s = 1e6\npower_db = 3\ndelay_m = 0\n'
    (warning,) = scenario_warnings(_with(tmp_path, FINE + late))
    assert warning.startswith("attack.1.start_s: 1e+06 s is not before the end of the scenario, ")


def test_schema_names_every_attack() -> None:
    text = str(scenario_schema())
    for attack in ALL_ATTACKS:
        (kind,) = (field.default for field in fields(attack) if field.name == "kind")
        assert f"'{kind}'" in text


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        (["receiver.front_end.bits=2"], "receiver.front_end.bits"),
        (["receiver.front_end.bandwidth_hz=8e6"], "receiver.front_end"),
    ],
)
def test_what_the_model_of_correlators_does_not_know(tmp_path: Path, settings: list[str], place: str) -> None:
    text = 'kind = "jamming"\nj_over_n_db = 3\nwaveform = {kind = "cw"}\n'
    with pytest.raises(InputFileError) as error:
        _with(tmp_path, text, *settings)
    assert error.value.place == place
    _with(tmp_path, text, 'fidelity="samples"', *settings)


def test_a_jamming_waveform_is_in_a_test_case(tmp_path: Path) -> None:
    """A wave of J/N 20 dB in its band, from 1 s on, on E1 alone; its phase has no break within 50 ms."""
    text = (
        'kind = "jamming"\nj_over_n_db = 20\nstart_s = 1\nbands = ["E1"]\nwaveform = {kind = "cw", offset_hz = 1e5}\n'
    )
    scenario = _with(tmp_path, text, 'fidelity="samples"', "receiver.sample_rate_hz=5e6")
    assert isinstance(scenario, CampaignScenario)
    one = simulated(AcasTestCase(scenario=with_default_range(scenario), first=0, end=3))
    for band in Band:
        quiet, loud = (one.window(band, t, t + 0.05).samples for t in (0.5, 1.5))
        line = np.abs(np.mean(loud * np.exp(-2j * np.pi * 1e5 * np.arange(loud.size) / 5e6))) ** 2
        over = np.mean(np.abs(loud) ** 2) - np.mean(np.abs(quiet) ** 2)
        assert line == pytest.approx(over if band is Band.E1 else 0.0, rel=0.01, abs=1e-3)
        assert (over > 1) == (band is Band.E1)
