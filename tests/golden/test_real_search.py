"""Vestigial signal search on the real recording, as it is and with a delayed copy of itself mixed in.

In the last 12 ms of the recording all satellites arrive 80 µs earlier at once: some 965 samples are missing there. So
the searches stay in front of that.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from builders import batch_of
from vestige.records import Band, SampleBatch
from vestige.sample_processor.search.e1_search import search_e1

IN_THE_SKY = (2, 3, 5, 7, 8, 13, 15, 25)
RATE_HZ = 12e6
PERIODS = 8
DELAY_SAMPLES = round(1.3e-3 * RATE_HZ)
COPY = 10 ** (-3 / 20)


@pytest.fixture(scope="module")
def e1(recording_data: Path) -> SampleBatch:
    samples = np.fromfile(recording_data / "L1_20211125_004000_12MHz_I.bin", np.int8)
    return batch_of(samples, RATE_HZ, Band.E1, center_frequency_hz=1572.42e6)


def with_copy(samples: np.ndarray) -> np.ndarray:
    """Return the samples with a copy of themselves 1.3 ms later and 3 dB weaker."""
    return samples[DELAY_SAMPLES:] + np.complex64(COPY) * samples[:-DELAY_SAMPLES]


def test_one_signal_for_each_satellite_in_the_sky_and_none_for_the_others(e1: SampleBatch) -> None:
    found = search_e1(e1, range(1, 37), periods=PERIODS)
    assert tuple(one.svid for one in found) == IN_THE_SKY


def test_with_a_delayed_copy_exactly_two(e1: SampleBatch) -> None:
    found = search_e1(
        batch_of(with_copy(e1.samples), RATE_HZ, Band.E1, center_frequency_hz=1572.42e6), IN_THE_SKY, periods=PERIODS
    )
    for svid in IN_THE_SKY:
        true, copy = (one for one in found if one.svid == svid)
        later_s = (copy.code_start_s - true.code_start_s) % 4e-3
        assert later_s == pytest.approx(1.3e-3, abs=0.3e-6)
        assert -6 < copy.cn0_dbhz - true.cn0_dbhz < -1  # both in noise, the copy in the true one's too
