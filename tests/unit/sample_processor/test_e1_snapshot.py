from __future__ import annotations

import numpy as np
import pytest

from builders import START, batch_of, received_batch, satellite
from vestige.cli.recordings.process_options import CN0_ESTIMATOR_NAMES
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.records import Band
from vestige.sample_processor.acquisition import Acquisition, acquire
from vestige.sample_processor.e1_snapshot import ESTIMATORS, measure_e1


def _pseudorange_error_m(transmit_phase_s: float, at_s: float, range_m: float, rate_mps: float) -> float:
    truth = (at_s - (range_m + rate_mps * at_s) / SPEED_OF_LIGHT_MPS) % 0.1
    return ((truth - transmit_phase_s + 0.05) % 0.1 - 0.05) * SPEED_OF_LIGHT_MPS


@pytest.mark.parametrize("svid", [2, 19, 33])
def test_measures_what_was_sent(svid: int) -> None:
    range_m, rate_mps, cn0_dbhz = 2.4e7 + 12_345.678 * svid, 450.0 - 30 * svid, 45.0
    batch = received_batch(
        Band.E1, [satellite(svid, range_m, rate_mps, cn0_dbhz, 45.0, seed=svid)], rate_hz=8.3e6, seed=svid
    )
    (found,) = acquire(batch, [svid])
    measured = measure_e1(batch, found)
    assert measured is not None
    at_s = measured.time - START
    # 100 ms of E1-B and E1-C at 45 dBHz each: one-shot bound for BOC(1,1) about 1.3 m, 5 sigma
    assert _pseudorange_error_m(measured.transmit_phase_s, at_s, range_m, rate_mps) == pytest.approx(0.0, abs=7.0)
    assert measured.doppler_hz == pytest.approx(-rate_mps / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ, abs=0.3)
    assert measured.cn0_dbhz == pytest.approx(cn0_dbhz, abs=1.2)
    assert measured.secondary_margin_db > 3


@pytest.mark.slow
def test_code_phase_is_unbiased() -> None:
    """Mean pseudorange error over 16 noise seeds at 45 dBHz: within 5 standard errors of zero."""
    errors = []
    for seed in range(16):
        range_m = 2.35e7 + 37.1 * seed
        batch = received_batch(
            Band.E1, [satellite(8, range_m, 100.0, 45.0, 45.0)], rate_hz=8.3e6, duration_s=0.07, seed=seed
        )
        (found,) = acquire(batch, [8], doppler_span_hz=1000.0)
        measured = measure_e1(batch, found)
        assert measured is not None
        errors.append(_pseudorange_error_m(measured.transmit_phase_s, measured.time - START, range_m, 100.0))
    assert np.std(errors) < 3.5
    assert abs(np.mean(errors)) < 5 * np.std(errors, ddof=1) / 4


@pytest.mark.parametrize(
    ("estimator", "tolerance_db"),
    [
        ("noise-floor", 0.5),  # one standard deviation is 0.1 dB, and the same for all others
        ("narrow-to-wide", 3.7),  # 0.94 dB
        ("moments", 5.3),  # 1.3 dB
        ("signal-to-noise-variance", 4.0),
        ("beaulieu", 6.2),  # 1.55 dB
        ("real-signal-complex-noise", 6.0),
    ],
)
def test_cn0_by_every_estimator(estimator: str, tolerance_db: float) -> None:
    """Of 0.1 s at 45 dBHz, within four standard deviations of the Monte Carlo in docs/checks/cn0.md.

    The replica is BOC(1,1), which holds 10/11 of the power; E1-B takes another 0.2 dB (44.39 dBHz in the mean of 12
    seeds, by the noise floor).
    """
    batch = received_batch(Band.E1, [satellite(8, 2.35e7, 100.0, 45.0, 45.0)], rate_hz=8.3e6, seed=3)
    (found,) = acquire(batch, [8])
    measured = measure_e1(batch, found, cn0_estimator=estimator)
    reference = measure_e1(batch, found)
    assert measured is not None
    assert reference is not None
    assert measured.cn0_dbhz == pytest.approx(45.0 + 10 * np.log10(10 / 11), abs=tolerance_db)
    assert (measured.cn0_dbhz == reference.cn0_dbhz) is (estimator == "noise-floor")
    assert (measured.time, measured.transmit_phase_s) == (reference.time, reference.transmit_phase_s)


def test_the_estimators_of_the_command_line_are_these() -> None:
    assert CN0_ESTIMATOR_NAMES == ESTIMATORS


def test_too_short() -> None:
    found = Acquisition(svid=8, code_start_s=1e-3, doppler_hz=0.0, statistic=0.0, threshold=0.0, cn0_dbhz=45.0)
    assert measure_e1(batch_of(np.ones(4_000 * 30), 4.0e6, Band.E1), found) is None  # 30 ms
