"""What the tests of the command line share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def _e1_is_acquired_once() -> Iterator[None]:
    """Several commands process one recording of a test file; each test still runs its whole command."""
    from kept_acquisitions import e1_acquired_once  # late: the check of array types is installed before vestige is

    with e1_acquired_once():
        yield
