"""Translate old names of keys and values in scenario files; an old name still works, with a warning."""

from __future__ import annotations

import warnings
from typing import Any

from vestige.errors import VestigeWarning
from vestige.own_parts import is_own

NEW_NAMES = {"own_data": "forged_nav_data"}  # new name of a key by its name in version 0.1
NEW_VALUES = {("scer", "symbols", "estimated"): "hard"}  # new value by kind, key and value in version 0.2


def with_new_names(value: Any) -> Any:
    """Return a TOML table with the new names of keys and values; warn of each old name.

    A table of a user's own class (`kind = "module:Name"`) is not changed, because the user chose the names of its keys.

    Examples
    --------
    >>> with_new_names({"attack": [{"kind": "meaconer", "forged_nav_data": True}]})
    {'attack': [{'kind': 'meaconer', 'forged_nav_data': True}]}
    >>> with_new_names({"attack": [{"kind": "my_attack:Mine", "own_data": 3}]})
    {'attack': [{'kind': 'my_attack:Mine', 'own_data': 3}]}
    """
    if isinstance(value, list):
        return [with_new_names(item) for item in value]
    if not isinstance(value, dict) or is_own(value.get("kind")):
        return value
    for old, new in NEW_NAMES.items():
        if old in value and new not in value:
            warnings.warn(f"the key {old} is called {new} now; use that name", VestigeWarning, stacklevel=2)
            value = {(new if key == old else key): item for key, item in value.items()}
    for (kind, key, old), new in NEW_VALUES.items():
        if value.get("kind") == kind and value.get(key) == old:
            warnings.warn(f'{key} = "{old}" is called "{new}" now; use that name', VestigeWarning, stacklevel=2)
            value = {**value, key: new}
    return {key: with_new_names(item) for key, item in value.items()}
