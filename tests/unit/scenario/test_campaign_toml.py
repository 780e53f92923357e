from __future__ import annotations

from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

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
    "OSNMA events": (
        "sky",
        (
            'osnma.event=[{kind="key-renewal", start_s=60, in_force_s=90}, {kind="silence", start_s=60, svids=[7]}]',
            'atmosphere={troposphere={kind="saastamoinen"}, ionosphere={kind="ntcm-g", ai0_sfu=100}}',
        ),
    ),
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


def test_a_scenario_with_an_osnma_key_of_the_user_can_be_read_again(tmp_path: Path) -> None:
    """Its digest is no key of a scenario file."""
    key = ec.generate_private_key(ec.SECP256R1())
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    (tmp_path / "own.pem").write_bytes(pem)
    (tmp_path / "sky.toml").write_text((SCENARIOS / "sky.toml").read_text(encoding="utf-8"), encoding="utf-8")
    text = load_scenario(tmp_path / "sky.toml", ("osnma.private_key='own.pem'",)).model_dump_json()
    (tmp_path / "again.toml").write_text(campaign_toml(text), encoding="utf-8")
    assert load_scenario(tmp_path / "again.toml").model_dump_json() == text
    other = ec.generate_private_key(ec.SECP256R1())
    (tmp_path / "own.pem").write_bytes(other.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    assert load_scenario(tmp_path / "again.toml").model_dump_json() != text
