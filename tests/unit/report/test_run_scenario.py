from __future__ import annotations

import pytest

from vestige.report.run_scenario import every_kth


@pytest.mark.parametrize(
    ("k", "text"),
    [
        (1, "all dots"),
        (2, "every 2nd of the dots"),
        (3, "every 3rd of the dots"),
        (4, "every 4th of the dots"),
        (11, "every 11th of the dots"),
        (13, "every 13th of the dots"),
        (21, "every 21st of the dots"),
        (112, "every 112th of the dots"),
    ],
)
def test_every_kth_in_words(k: int, text: str) -> None:
    assert every_kth("dots", k) == text
