from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.errors.error_process import named_streams, steps_s
from vestige.streams import stream


def test_a_stream_is_that_of_seed_variable_and_owner() -> None:
    expected = stream(7, "multipath.delay", 11).random(5)
    assert np.array_equal(named_streams(7, 11)("multipath.delay").random(5), expected)
    assert not np.array_equal(named_streams(7)("multipath.delay").random(5), expected)


def test_steps_count_from_the_epoch_before() -> None:
    assert steps_s(2.0, np.array([2.0, 2.5, 4.5])).tolist() == [0.0, 0.5, 2.0]
    assert steps_s(2.0, np.zeros(0)).size == 0


@pytest.mark.parametrize("times_s", [[1.0], [3.0, 2.5], [float("nan")]])
def test_time_only_goes_forward(times_s: list[float]) -> None:
    with pytest.raises(ValueError, match="forward"):
        steps_s(2.0, np.array(times_s))
