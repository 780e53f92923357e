from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vestige.signal_generator.rectangular import rectangular_parts
from vestige.signal_generator.waveform import open_component
from vestige.signals.definitions import ALL_SIGNALS, SignalDefinition
from vestige.signals.pulse import ALL_PULSES, RECTANGULAR_PARTS


@settings(max_examples=25)
@given(
    signal=st.sampled_from(ALL_SIGNALS),
    svid=st.integers(1, 36),
    first=st.sampled_from([-5000, -1, 0, 4090, 102_290, 5_114_000]),
    n=st.sampled_from([1, 5, 6000]),
)
def test_the_parts_add_up_to_the_waveform(signal: SignalDefinition, svid: int, first: int, n: int) -> None:
    """Sampled in the middle of each twelfth of a chip, over symbol edges and before the reference."""
    component = open_component(signal, svid, seed=3)
    t = (first + (np.arange(12 * n) + 0.5) / 12) / signal.chip_rate_hz
    total = np.zeros(12 * n)
    for part in rectangular_parts(component, first, n):
        assert set(np.unique(part.chips)) <= {-1, 1}
        total += part.weight * np.repeat(part.chips, 12 // part.per_chip)
    assert total == pytest.approx(component.modulation(t), abs=1e-12)


def test_every_pulse_is_the_sum_of_its_parts() -> None:
    for pulse in ALL_PULSES:
        total = np.zeros(12)
        for weight, part in RECTANGULAR_PARTS[pulse]:
            assert set(part.levels) <= {-1.0, 1.0}
            total += weight * np.repeat(part.levels, 12 // len(part.levels))
        assert total == pytest.approx(np.repeat(pulse.levels, 12 // len(pulse.levels)), abs=1e-12)
