from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from vestige.recording.tracked.track_recording import TrackedRecording
from vestige.recording.tracked.tracked_folder import POWER_NAME, signal_power_db, write_tracked
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

RATE_HZ = 1e5


def test_power_of_a_signal_in_noise() -> None:
    """Sums over 100 ms of a signal of -23 dB in noise of 6 dB: its power is right on average, give or take 0.1 dB."""
    rng = np.random.default_rng(2)
    n, amplitude, noise = round(0.1 * RATE_HZ), 10 ** (-23 / 20), 10 ** (6 / 20)
    found = []
    for _ in range(100):
        samples = amplitude + noise * np.sqrt(0.5) * rng.standard_normal((n, 2)).view(complex)[:, 0]
        power = float(np.mean(np.abs(samples) ** 2))
        prompt = complex(np.sum(samples)) / math.sqrt(power / 2 * n)
        found.append(signal_power_db(prompt, 10 * math.log10(power), RATE_HZ))
    # one value: 2 / √(2 C N/p) of the amplitude in noise, 0.8 dB; 100 of them 0.1 dB
    assert np.mean(found) == pytest.approx(-23.0, abs=0.4)


def test_no_power_where_there_is_none() -> None:
    assert math.isnan(signal_power_db(1.0 + 0.5j, 3.0, RATE_HZ))
    assert math.isnan(signal_power_db(9.0 + 0.5j, -math.inf, RATE_HZ))


def test_the_file_has_a_row_for_each_satellite_and_epoch(tmp_path: Path) -> None:
    seen = {
        svid: E1Observation(
            svid=svid, pseudorange_m=2.4e7, carrier_phase_cycles=0.0, doppler_hz=0.0, doppler_rate_hz_per_s=math.nan,
            cn0_dbhz=cn0_dbhz,
        )
        for svid, cn0_dbhz in ((3, 44.5), (5, math.nan))
    }  # fmt: skip
    epoch = ObservationEpoch(
        time=GalileoTime(1422, 100),
        observations=seen,
        taps={3: np.array([1.0, 100.0, 1.0], np.complex64)},
        tap_chips=(-0.1, 0.0, 0.1),
        power_db=20.0,
    )
    write_tracked(tmp_path, TrackedRecording(epochs=(epoch,), pages=(), time_tag_error_s=None), RATE_HZ)
    with (tmp_path / POWER_NAME).open() as stream:
        rows = list(csv.reader(stream))
    # 9998 / (2 · 10,000 samples) is -3.01 dB
    assert rows[1:] == [["1422", "100.000", "3", "44.50", "16.99", "20.00"], ["1422", "100.000", "5", "", "", "20.00"]]
