"""Old names of keys and values still work, with a warning."""

from __future__ import annotations

from pathlib import Path

import pytest

from vestige.errors import VestigeWarning
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.toml.renamed_keys import with_new_names

SKY = Path(__file__).parents[3] / "scenarios" / "sky.toml"
ATTACK = 'attack=[{{kind="e1-asynchronous", power_db=10.0, delay_m=0.0, {0}=true}}]'


def test_an_old_name_is_read_and_warned_of() -> None:
    with pytest.warns(VestigeWarning, match="own_data is called forged_nav_data now"):
        old = load_scenario(SKY, [ATTACK.format("own_data")])
    new = load_scenario(SKY, [ATTACK.format("forged_nav_data")])
    assert isinstance(old, CampaignScenario)
    assert old == new


def test_both_names_are_left_for_the_reader_to_refuse() -> None:
    both = {"own_data": True, "forged_nav_data": False}
    assert with_new_names(both) == both


def test_an_old_value_is_read_and_warned_of() -> None:
    attack = 'attack=[{{kind="scer", power_db=0.0, delay_m=0.0, symbols="{0}"}}]'
    with pytest.warns(VestigeWarning, match='symbols = "estimated" is called "hard" now'):
        old = load_scenario(SKY, [attack.format("estimated")])
    assert old == load_scenario(SKY, [attack.format("hard")])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "table",
    [
        {"attack": [{"kind": "my:Attack", "symbols": "estimated", "own_data": 3, "inner": {"own_data": True}}]},
        {"receiver": {"ionosphere": {"kind": "my:Gusts", "own_data": 2.0}}},
        {"attack": [{"kind": "meaconing", "symbols": "estimated"}]},
    ],
)
def test_keys_of_a_users_part_and_of_other_kinds_keep_their_names(table: dict[str, object]) -> None:
    assert with_new_names(table) == table
