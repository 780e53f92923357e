from __future__ import annotations

import numpy as np
import pytest

from builders import received_batch, satellite
from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.records import Band
from vestige.sample_processor.e6_acquisition import (
    OPEN_SHARE,
    E6Acquisition,
    acquire_e6,
    cn0_on_the_peak_dbhz,
    secondary_share,
)
from vestige.signals.definitions import E6B

CN0_DBHZ = 45.0
# Dopplers of the bins of 500 Hz, of their edges, and between them; the last code phase is half-way between two samples
CASES = [(0.0, 0.0), (250.0, 0.5), (-250.0, 0.3), (1_400.0, 0.75), (-2_370.0, 0.15), (3_250.0, 0.5)]


@pytest.mark.parametrize("rate_hz", [5e6, 5.5e6, 10e6, 12.5e6])
@pytest.mark.parametrize(("doppler_hz", "delay_samples"), CASES)
def test_cn0_is_that_of_the_peak(rate_hz: float, doppler_hz: float, delay_samples: float) -> None:
    """Each code phase and Doppler counts by itself: a mean over code phases would hide the loss between two samples."""
    rate_mps = -doppler_hz / E6_CARRIER_HZ * SPEED_OF_LIGHT_MPS
    range_m = (0.08 + delay_samples / rate_hz) * SPEED_OF_LIGHT_MPS
    batch = received_batch(
        Band.E6, [satellite(11, range_m, rate_mps, CN0_DBHZ, CN0_DBHZ)], rate_hz=rate_hz, duration_s=0.05
    )
    searches = (
        acquire_e6(batch, E6B, 11, doppler_hz=doppler_hz, doppler_span_hz=400.0),
        acquire_e6(batch, E6B, 11, doppler_span_hz=5000.0, max_stretches=12),  # without E1
    )
    for found in searches:
        assert found is not None
        assert cn0_on_the_peak_dbhz(batch, E6B, found) == pytest.approx(CN0_DBHZ, abs=0.6)


def test_cn0_needs_a_complete_period() -> None:
    batch = received_batch(Band.E6, [satellite(11, 2.4e7, 0.0, CN0_DBHZ, CN0_DBHZ)], duration_s=0.0015)
    found = E6Acquisition(svid=11, code_start_s=8e-4, doppler_hz=0.0, statistic=50.0, threshold=40.0)
    assert np.isnan(cn0_on_the_peak_dbhz(batch, E6B, found))


@pytest.mark.parametrize("duration_s", [0.055, 0.12])
def test_noise_does_not_fit_the_secondary_code(duration_s: float) -> None:
    """With 50 periods, noise is above `OPEN_SHARE` with a probability of 5e-4."""
    batch = received_batch(Band.E6, [], duration_s=duration_s)
    for k in range(8):
        found = E6Acquisition(svid=11, code_start_s=k * 1e-4, doppler_hz=0.0, statistic=50.0, threshold=40.0)
        share = secondary_share(batch, found, 0.0)
        assert share is not None
        assert share[0] < OPEN_SHARE


def test_few_periods_do_not_tell_the_secondary_code() -> None:
    batch = received_batch(Band.E6, [], duration_s=0.045)
    found = E6Acquisition(svid=11, code_start_s=0.0, doppler_hz=0.0, statistic=50.0, threshold=40.0)
    assert secondary_share(batch, found, 0.0) is None
