from __future__ import annotations

import math

import numpy as np
import pytest

from builders import batch_of
from vestige.recording.samples.front_end_power import front_end_status
from vestige.recording.samples.sample_format import SampleFormat


def test_the_power_is_that_of_the_numbers() -> None:
    rng = np.random.default_rng(5)
    samples = (rng.standard_normal((100_000, 2)) * 20.0) @ [1, 1j]
    status = front_end_status(batch_of(samples, 1e6), SampleFormat(component="int8", layout="iq"))
    assert status.total_power_db == pytest.approx(10 * math.log10(800.0), abs=0.05)  # 5 σ are 0.07 dB
    assert math.isnan(status.agc_gain_db)
    assert not status.saturated


@pytest.mark.parametrize(("share", "saturated"), [(0.008, False), (0.012, True)])
@pytest.mark.parametrize(("component", "end"), [("int8", -128.0), ("uint8", 127.0), ("int16", 32767.0)])
def test_numbers_at_the_end_of_the_scale_are_counted(share: float, saturated: bool, component: str, end: float) -> None:
    values = np.zeros(10_000)
    values[: round(share * values.size)] = end
    form = SampleFormat(component=component, layout="real")  # type: ignore[arg-type]
    assert front_end_status(batch_of(values, 1e6), form).saturated is saturated
    floats = SampleFormat(component="float32", layout="real")
    assert not front_end_status(batch_of(values, 1e6), floats).saturated


def test_silence_has_no_power() -> None:
    status = front_end_status(batch_of(np.zeros(10), 1e6), SampleFormat(component="int8", layout="iq"))
    assert status.total_power_db == -math.inf
