"""What the tests of tracking share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def _e1_is_acquired_once() -> Iterator[None]:
    """Many tests of a file track one sky, or the same sky in other pieces."""
    from kept_acquisitions import e1_acquired_once  # late: the check of array types is installed before vestige is

    with e1_acquired_once():
        yield
