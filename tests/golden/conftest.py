"""What the tests on real data share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def _e1_is_acquired_once() -> Iterator[None]:
    """A test file looks for the same satellites in the same samples of the real recording several times."""
    from kept_acquisitions import e1_acquired_once  # late: the check of array types is installed before vestige is

    with e1_acquired_once():
        yield
