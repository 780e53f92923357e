from __future__ import annotations

from pathlib import Path

import pytest

from vestige.errors import VestigeError
from vestige.scenario.load import load_scenario
from vestige.scenario.toml.campaign_toml import campaign_toml

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
CASES = {
    "harsh": ("harsh", ()),
    "vestigial": ("vestigial", ()),
    "no power": ("liftoff", ("attack.0.power_db=-inf",)),
    "satellites": ("liftoff", ("attack.0.svids=[11]",)),
    "quantised": ("quick", ("receiver.front_end.bits=2", "receiver.front_end.bandwidth_hz=10.23e6")),
    "sky": ("sky", ()),
    "circle": (
        "sky",
        ('trajectory={kind="circle", latitude_deg=48.1, longitude_deg=11.6, radius_m=100.0, speed_mps=10.0}',),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_reading_it_gives_the_same_scenario(case: str, tmp_path: Path) -> None:
    name, settings = CASES[case]
    text = load_scenario(SCENARIOS / f"{name}.toml", settings).model_dump_json()
    (tmp_path / "again.toml").write_text(campaign_toml(text), encoding="utf-8")
    again = load_scenario(tmp_path / "again.toml")
    assert again == load_scenario(SCENARIOS / f"{name}.toml", settings)
    assert again.model_dump_json() == text


@pytest.mark.parametrize("text", ["samples", '"samples"', " samples "])
def test_a_bare_word_of_a_setting_is_a_text(text: str) -> None:
    assert load_scenario(SCENARIOS / "harsh.toml", ("epochs=3", f"fidelity={text}")).fidelity == "samples"  # type: ignore[union-attr]


@pytest.mark.parametrize("text", ["two words", "1x", "a:b:c", ""])
def test_what_is_neither_a_word_nor_toml_is_refused(text: str) -> None:
    with pytest.raises(VestigeError, match="expected a TOML value"):
        load_scenario(SCENARIOS / "harsh.toml", (f"fidelity={text}",))
