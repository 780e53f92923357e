from __future__ import annotations

import numpy as np
import pytest

from vestige.signals.codes import tiered_code
from vestige.signals.definitions import E6C
from vestige.signals.open_e6c import is_open_e6c, repeated_after_s


@pytest.mark.parametrize("duration_ms", [1, 2, 16])
@pytest.mark.parametrize("first_ms", [0, 7])
def test_the_open_code_is_recognised(duration_ms: int, first_ms: int) -> None:
    chips = tiered_code(E6C, 11)[first_ms * 5115 :][: duration_ms * 5115]
    assert is_open_e6c(chips, 11)
    assert repeated_after_s(chips, 11) == 0.1
    changed = chips.copy()
    changed[-1] *= -1
    assert not is_open_e6c(changed, 11)


def test_encrypted_chips_never_repeat() -> None:
    rng = np.random.default_rng(1)
    for n_chips in (100, 5115, 81_840):
        chips = (1 - 2 * rng.integers(0, 2, n_chips)).astype(np.int8)
        assert not is_open_e6c(chips, 11)
        assert repeated_after_s(chips, 11) is None
