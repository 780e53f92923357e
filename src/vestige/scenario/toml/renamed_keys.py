"""Keys and values of scenario files that have another name now. The old name works for one release, with a warning."""

from __future__ import annotations

import warnings
from typing import Any

from vestige.errors import VestigeWarning

NEW_NAMES = {"own_data": "forged_nav_data"}  # by the names of version 0.1
NEW_VALUES = {("symbols", "estimated"): "hard"}  # by the names of version 0.2


def with_new_names(value: Any) -> Any:
    """Return a table as TOML gives it with the names that keys and values have now; warn of each old one.

    Examples
    --------
    >>> with_new_names({"attack": [{"kind": "meaconer", "forged_nav_data": True}]})
    {'attack': [{'kind': 'meaconer', 'forged_nav_data': True}]}
    """
    if isinstance(value, list):
        return [with_new_names(item) for item in value]
    if not isinstance(value, dict):
        return value
    for old, new in NEW_NAMES.items():
        if old in value and new not in value:
            warnings.warn(f"the key {old} is called {new} now; use that name", VestigeWarning, stacklevel=2)
            value = {(new if key == old else key): item for key, item in value.items()}
    for (key, old), new in NEW_VALUES.items():
        if value.get(key) == old:
            warnings.warn(f'{key} = "{old}" is called "{new}" now; use that name', VestigeWarning, stacklevel=2)
            value = {**value, key: new}
    return {key: with_new_names(item) for key, item in value.items()}
