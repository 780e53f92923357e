from __future__ import annotations

import pytest

from builders import START
from vestige.acas_processor.calibration import hardware_bias_correction_s
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.measurement import Detection, Measurement, SatelliteMeasurement


def _measurement(offsets_m: dict[int, float | None]) -> Measurement:
    satellites = tuple(
        SatelliteMeasurement(
            svid=svid,
            detection=None
            if offset is None
            else Detection(tap=1, magnitude=9.0, phase_rad=0.0, threshold=5.0, range_offset_m=offset),
        )
        for svid, offset in offsets_m.items()
    )
    return Measurement(index=0, time=START, satellites=satellites, observations={}, front_end={})


def test_median_over_satellites_survives_a_spoofed_minority() -> None:
    measurements = [_measurement({1: -20.0, 2: -22.0, 3: 60.0}), _measurement({1: -21.0, 2: -22.5, 3: None})]
    correction = hardware_bias_correction_s(measurements)
    assert correction is not None
    assert correction * SPEED_OF_LIGHT_MPS == pytest.approx(-20.5)


@pytest.mark.parametrize("offsets", [{}, {1: -20.0, 2: -20.0}, {1: None, 2: None, 3: None, 4: 1.0}])
def test_too_few_satellites(offsets: dict[int, float | None]) -> None:
    assert hardware_bias_correction_s([_measurement(offsets)]) is None
