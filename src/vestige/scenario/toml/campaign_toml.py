"""Write the scenario in the results of a campaign as a TOML file that reproduces these results."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from vestige.scenario.toml.toml_text import toml_text


def campaign_toml(text: str) -> str:
    """Return a scenario as TOML with all its defaults, so that `load_scenario` reads a scenario with equal digest.

    `text` is the attribute `scenario` of the results, in JSON.
    """
    tables = json.loads(text)
    tables["attack"] = [_without_power(attack) for attack in tables["attack"]]
    if tables.get("constellation"):
        del tables["line_of_sight"]  # a scenario has either a constellation or a line of sight
    return toml_text(_stated(tables))


def _without_power(attack: Mapping[str, Any]) -> dict[str, Any]:
    """Return an attack with −inf dB in place of a missing power, because JSON cannot express −inf."""
    return {key: -math.inf if value is None and key.endswith("_db") else value for key, value in attack.items()}


def _stated(value: Any) -> Any:
    """Return tables without digests of files and without keys of value None; `kind` is the first key of each table."""
    if isinstance(value, list):
        return [_stated(inner) for inner in value]
    if not isinstance(value, Mapping):
        return value
    stated = {key: _stated(inner) for key, inner in value.items() if inner is not None and not key.endswith("_sha256")}
    return dict(sorted(stated.items(), key=lambda item: item[0] != "kind"))
