"""Whatever a campaign's keys are set to: one clear line, or a scenario that can be simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simulated_banks import banks as banks_of
from simulated_banks import snapshots
from vestige.errors import InputFileError, VestigeError
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario, scenario_schema
from vestige.scenario.warnings import scenario_warnings

HARSH = Path(__file__).resolve().parents[3] / "scenarios" / "harsh.toml"


def _keys(table: dict[str, Any], definitions: dict[str, Any], prefix: str = "") -> list[str]:
    """Return the dotted names of all keys that the schema knows, of every alternative."""
    found = []
    for name, value in table.get("properties", {}).items():
        found.append(f"{prefix}{name}")
        for reference in str(value).split("#/$defs/")[1:]:
            found += _keys(definitions[reference.split("'")[0]], definitions, f"{prefix}{name}.")
    return list(dict.fromkeys(found))


DEFINITIONS = scenario_schema()["$defs"]
KEYS = _keys(DEFINITIONS["CampaignScenario"], DEFINITIONS)
NUMBERS = [key for key in KEYS if key.endswith(("_hz", "_m", "_mps", "_s", "_dbhz", "_db", "_probability"))]
VALUES = """
    0 0.0 -0.0 1 -1 2 3 7 63 64 1e-300 1e-30 -1e-30 1e-9 1e-6 0.1 0.3 0.5 0.999 10.0 35.0 80.0 1e3 5.115e6 10.23e6
    1e9 1e14 -1e14 1e15 1e16 1e300 -1e300 inf -inf nan 9223372036854775807 100000000000000000000000
    none true false "" "x" "early" "2014" "open-sky" [] [1.0] {} {a=1} {kind="empirical",path="x"} 2026-01-01
    "9999-12-31T23:59:59UTC" "99999:0" "1:604800"
"""
TEXT = st.one_of(
    st.sampled_from([*VALUES.split(), "1" * 5000, "[" * 2000, "1\nseed = 3", "\x00"]),
    st.floats().map(repr),
    st.integers().map(str),
)
SETTING = st.tuples(st.sampled_from(KEYS), TEXT).map("=".join)


@settings(max_examples=300)
@given(changes=st.lists(SETTING, min_size=1, max_size=3), fidelity=st.sampled_from(["samples", "correlators"]))
def test_one_line_or_a_simulation(changes: list[str], fidelity: str) -> None:
    try:
        scenario = load_scenario(HARSH, [*changes, f'fidelity="{fidelity}"'])
    except VestigeError as error:
        assert "\n" not in str(error)  # noqa: PT017  (many examples, not one)
        return
    assert isinstance(scenario, CampaignScenario)
    assert all("\n" not in warning for warning in scenario_warnings(scenario))
    assert scenario.model_dump_json()
    simulation = scenario.simulation()
    truth = simulation.truth().advance(0, 2)
    tracked = snapshots(simulation, "correlators", 0, truth).e1.seen[:, 0]  # below 20 dBHz E1 is not
    banks = banks_of(simulation, "correlators", 0, truth)
    assert np.all(np.isfinite(banks.taps[tracked]))
    assert np.all(banks.noise_power[tracked] > 0)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e300"])
def test_every_number_is_finite(value: str) -> None:
    """Each key by itself, and the error names it."""
    for key in NUMBERS:
        with pytest.raises(InputFileError) as error:
            load_scenario(HARSH, [f"{key}={value}"])
        assert error.value.place == key
