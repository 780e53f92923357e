"""What docs/attacks.md says is true: every kind, every key, examples that run, the labels of Assumption 2."""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.campaign import CampaignScenario
from vestige.spoofer.jammers import ALL_JAMMERS
from vestige.spoofer.phase import ALL_PHASES
from vestige.spoofer.profiles import ALL_PROFILES
from vestige.spoofer.spoofer import ALL_ATTACKS

DOCS = Path(__file__).resolve().parents[2] / "docs"
TEXT = (DOCS / "attacks.md").read_text(encoding="utf-8")
SECTIONS = {
    match[1]: match[2] for match in re.finditer(r"^## ([\w -]+)\n(.*?)(?=^## |\Z)", TEXT, re.MULTILINE | re.DOTALL)
}
BLOCKS = re.findall(r"^```toml\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
BASE: dict[str, Any] = {
    "kind": "campaign",
    "seed": 1,
    "start": "2026-11-21T12:00:00 GST",
    "epochs": 5,
    "interval_s": 30.0,
    "fidelity": "correlators",
    "receiver": {"cn0_dbhz": 40.0, "cn0_e1_dbhz": 40.0},
}


def kind_of(one: type) -> str:
    """Return the name of a kind in a scenario."""
    (kind,) = (field.default for field in fields(one) if field.name == "kind")
    return str(kind)


def scenario_of(block: str) -> CampaignScenario:
    return TypeAdapter(CampaignScenario).validate_python(BASE | tomllib.loads(block))


ATTACKS = {kind_of(one): one for one in ALL_ATTACKS}
SCENARIOS_MD = re.findall(
    r"^```toml\n(\[\[attack.*?)^```", (DOCS / "scenarios.md").read_text(), re.MULTILINE | re.DOTALL
)


@pytest.mark.parametrize("block", [*BLOCKS, *SCENARIOS_MD])
def test_every_example_runs(block: str) -> None:
    plan = ScenarioPlan(scenario=scenario_of(block))
    assert plan.scenario.attack
    assert direct_results(plan)["status"].shape == (5, 1)


def test_there_are_examples() -> None:
    assert len(BLOCKS) == len(ATTACKS)
    assert SCENARIOS_MD


@pytest.mark.parametrize("kind", ATTACKS)
def test_a_kind_has_a_section_with_an_example_of_every_key(kind: str) -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", SECTIONS[kind], re.DOTALL)
    tables = [table for table in tomllib.loads(block)["attack"] if table["kind"] == kind]
    keys = {field.name for field in fields(ATTACKS[kind])} - {"start_s", "stop_s", "svids", "kind"}
    keys -= {"antenna"}  # it wants a sky, which the examples have not: tests/unit/receiver/test_meaconer_way.py
    assert keys <= set(tables[0]), keys - set(tables[0])


@pytest.mark.parametrize("kind", ATTACKS)
def test_the_label_of_assumption_2(kind: str) -> None:
    """Every section has one, and the examples hold the assumption."""
    assert "**Assumption 2**" in SECTIONS[kind]
    (block,) = re.findall(r"```toml\n(.*?)```", SECTIONS[kind], re.DOTALL)
    assert all(attack.outside_assumption_2 == "" for attack in scenario_of(block).attack)


def test_what_the_document_says_breaks_assumption_2_does() -> None:
    early = BLOCKS[0].replace("first = 0", "first = -1")
    both = next(block for block in BLOCKS if "nulling" in block).replace('["E1"]', '["E1", "E6"]')
    late = next(block for block in BLOCKS if "scer" in block).replace("58.61", "-1")
    for block in (early, both, late):
        assert scenario_of(block).attack[0].outside_assumption_2


@pytest.mark.parametrize("kinds", [ALL_PROFILES, ALL_PHASES, ALL_JAMMERS], ids=["profiles", "phases", "jammers"])
def test_profiles_phases_and_waveforms_are_named_with_their_keys(kinds: tuple[type, ...]) -> None:
    for one in kinds:
        assert re.search(rf'`{kind_of(one)}`|kind = "{kind_of(one)}"', TEXT), one
        for field in fields(one):
            assert re.search(rf"\b{field.name}\b", TEXT), (one, field.name)
