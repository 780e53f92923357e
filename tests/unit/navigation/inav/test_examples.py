"""The examples in the docstrings of the I/NAV message and of what is broadcast run as they stand."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import vestige.broadcast
import vestige.navigation.inav

PACKAGES = (vestige.navigation.inav, vestige.broadcast)
MODULES = [module.name for one in PACKAGES for module in pkgutil.walk_packages(one.__path__, f"{one.__name__}.")]


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_a_module(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0
