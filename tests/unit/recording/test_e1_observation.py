from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import START, received_batch, satellite
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.recording.observations.e1_observation import observe, place_travel_times
from vestige.records import Band


@given(
    st.lists(st.floats(0.0775, 0.0975), min_size=1, max_size=12),
    st.floats(-0.03, 0.03),
    st.integers(-5, 5),
)
def test_travel_times_are_placed_together(true_s: list[float], clock_s: float, turns: int) -> None:
    """Any multiple of 100 ms may be missing from each; a clock within ±30 ms of the label does not matter."""
    phases = {svid: (travel + clock_s + 0.1 * turns) % 0.1 for svid, travel in enumerate(true_s)}
    placed = place_travel_times(phases)
    for svid, travel in enumerate(true_s):
        assert placed[svid] == pytest.approx(travel + clock_s, abs=1e-12)


def test_no_satellites() -> None:
    assert place_travel_times({}) == {}


def test_observations_of_a_made_sky() -> None:
    sky = {3: (2.40e7, -700.0, 46.0), 11: (2.75e7, 120.0, 44.0), 30: (2.34e7, 600.0, 45.0)}
    batch = received_batch(Band.E1, [satellite(svid, *values, 45.0) for svid, values in sky.items()], rate_hz=8.3e6)
    time, observations = observe(batch, [3, 7, 11, 30])
    assert time - START == pytest.approx(0.05)
    assert observations.keys() == sky.keys()
    for svid, (range_m, rate_mps, cn0_dbhz) in sky.items():
        one = observations[svid]
        assert one.pseudorange_m == pytest.approx(range_m + 0.05 * rate_mps, abs=8.0)
        assert one.doppler_hz == pytest.approx(-rate_mps / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ, abs=0.5)
        assert one.cn0_dbhz == pytest.approx(cn0_dbhz, abs=1.5)
        assert np.isnan(one.carrier_phase_cycles)
