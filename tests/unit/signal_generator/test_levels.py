from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders import START
from vestige.records import Band
from vestige.signal_generator.keystream import encrypted_component
from vestige.signal_generator.levels import BandModulation
from vestige.signal_generator.waveform import Component, open_component
from vestige.signals.definitions import ALL_SIGNALS


def components(band: Band, svid: int, encrypted: bool) -> tuple[Component, ...]:
    found = tuple(open_component(signal, svid, seed=3) for signal in ALL_SIGNALS if signal.band is band)
    return (found[0], encrypted_component(b"secret", svid, START)) if encrypted else found


@settings(max_examples=20)
@given(
    band=st.sampled_from(list(Band)),
    encrypted=st.booleans(),
    svid=st.integers(1, 36),
    first=st.sampled_from([-5000, -1, 0, 4090, 102_290, 5_114_000]),
    n=st.sampled_from([1, 5, 6000]),
)
def test_the_table_is_the_sum_of_the_waveforms(band: Band, encrypted: bool, svid: int, first: int, n: int) -> None:
    """Sampled in the middle of each sub-chip, over symbol edges and before the reference."""
    modulation = BandModulation(components=components(band, svid, encrypted and band is Band.E6))
    per_chip = modulation.per_chip
    t = (first + (np.arange(per_chip * n) + 0.5) / per_chip) / modulation.chip_rate_hz
    expected = sum(one.modulation(t) for one in modulation.components)
    assert modulation.levels(first, n) == pytest.approx(expected, abs=1e-6)
    assert modulation.rate_hz == pytest.approx({Band.E1: 12.276e6, Band.E6: 5.115e6}[band])
