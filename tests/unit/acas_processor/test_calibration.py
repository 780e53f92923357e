from __future__ import annotations

import numpy as np
import pytest

from evidence_builder import evidence
from vestige.acas_processor.measurement import MeasurementBlock
from vestige.acas_processor.monitoring.calibration import hardware_bias_correction_s
from vestige.constants import SPEED_OF_LIGHT_MPS


def _measurement(offsets_m: dict[int, float | None]) -> MeasurementBlock:
    values = np.array([[np.nan if one is None else one for one in offsets_m.values()]], np.float64)
    return evidence(values.shape, range_offset_m=values, svids=tuple(offsets_m)).measured


def test_median_over_satellites_survives_a_spoofed_minority() -> None:
    measurements = [_measurement({1: -20.0, 2: -22.0, 3: 60.0}), _measurement({1: -21.0, 2: -22.5, 3: None})]
    correction = hardware_bias_correction_s(measurements)
    assert correction is not None
    assert correction * SPEED_OF_LIGHT_MPS == pytest.approx(-20.5)


@pytest.mark.parametrize("offsets", [{}, {1: -20.0, 2: -20.0}, {1: None, 2: None, 3: None, 4: 1.0}])
def test_too_few_satellites(offsets: dict[int, float | None]) -> None:
    assert hardware_bias_correction_s([_measurement(offsets)]) is None
