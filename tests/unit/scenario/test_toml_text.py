from __future__ import annotations

import tomllib
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from vestige.scenario.toml.toml_file import read_toml
from vestige.scenario.toml.toml_text import toml_text

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"

keys = st.one_of(st.from_regex(r"[a-z_0-9-]{1,5}", fullmatch=True), st.text(max_size=4))
texts = st.text(st.characters(exclude_categories=["Cs"]))
scalars = st.one_of(st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False), texts)
values = st.one_of(scalars, st.lists(scalars, max_size=3))
tables = st.recursive(
    st.dictionaries(keys, values, max_size=3),
    lambda inner: st.dictionaries(keys, st.one_of(values, inner, st.lists(inner, min_size=1, max_size=2)), max_size=3),
    max_leaves=8,
)


@given(tables)
def test_what_is_written_is_read(table: dict) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_the_scenarios_survive() -> None:
    for path in sorted(SCENARIOS.glob("*.toml")):
        assert tomllib.loads(toml_text(read_toml(path))) == read_toml(path)
