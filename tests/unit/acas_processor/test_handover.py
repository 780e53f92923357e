from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import START, random_chips
from vestige.acas_processor.searches.handover import hand_over, predicted_delay_m
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.group_delay import GroupDelayConvention, GroupDelayScale
from vestige.records import E1Observation
from vestige.signal_generator.range_model import RangeModel


def _observation(pseudorange_m: float, doppler_hz: float = 0.0, rate: float = 0.0) -> E1Observation:
    return E1Observation(
        svid=11,
        pseudorange_m=pseudorange_m,
        carrier_phase_cycles=float("nan"),
        doppler_hz=doppler_hz,
        doppler_rate_hz_per_s=rate,
        cn0_dbhz=40.0,
    )


def test_reference_vector() -> None:
    """Models reference, hand-over: STEC 40 TECU (I1 = 6.494898 m), BGD −2.5 ns → 2.975115 m = 9.923914 ns."""
    delay_m = predicted_delay_m(ionosphere_e1_m=6.494898, bgd_e1_e6_s=-2.5e-9)
    assert delay_m == pytest.approx(2.975115, abs=1e-6)
    assert delay_m / SPEED_OF_LIGHT_MPS == pytest.approx(9.923914e-9, abs=1e-15)


def test_reference_vector_through_the_hand_over() -> None:
    chips = random_chips(np.random.default_rng(1), 128)
    p1 = 23_456_789.123
    delay_m = predicted_delay_m(ionosphere_e1_m=6.494898, bgd_e1_e6_s=-2.5e-9)
    observed_at = START + p1 / SPEED_OF_LIGHT_MPS
    handover = hand_over(_observation(p1), observed_at, chips, delay_m=delay_m)
    assert (handover.start_time - observed_at) * SPEED_OF_LIGHT_MPS == pytest.approx(2.975115, abs=1e-6)


def test_doppler_scaling() -> None:
    """51.023 m/s: E1 268.128 Hz, E6 217.636 Hz."""
    doppler_hz = 51.023 / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ
    assert doppler_hz == pytest.approx(268.128, abs=5e-4)
    handover = hand_over(_observation(2.4e7, doppler_hz), START + 0.08, random_chips(np.random.default_rng(1), 128))
    assert handover.doppler_hz == pytest.approx(217.636, abs=5e-4)


@pytest.mark.parametrize("change", [{"ionosphere_e1_m": 1.0}, {"bgd_e1_e6_s": 1e-9}, {"hardware_bias_e1_e6_s": 1e-9}])
def test_more_delay_is_later(change: dict[str, float]) -> None:
    assert predicted_delay_m(**change) > 0


def test_group_delay_switch() -> None:
    as_file = GroupDelayConvention(scale=GroupDelayScale.FILE_VALUE)
    assert predicted_delay_m(bgd_e1_e6_s=1e-9, convention=as_file) == pytest.approx(SPEED_OF_LIGHT_MPS * 1e-9)
    turned = GroupDelayConvention(sign=-1)
    assert predicted_delay_m(bgd_e1_e6_s=1e-9, convention=turned) == -predicted_delay_m(bgd_e1_e6_s=1e-9)


@given(st.floats(2.2e7, 2.9e7), st.floats(-900, 900), st.floats(-30, 30), st.floats(-0.4, 0.4), st.floats(-30, 30))
def test_solves_the_light_time_equation(range_m: float, v: float, a: float, lead_s: float, delay_m: float) -> None:
    """For a pseudorange that is a parabola in time the expected start satisfies t = t_tx + P6(t)/c to 0.1 mm."""
    model = RangeModel(s0_m=range_m, v_mps=v, a_mps2=a)
    at = np.array([lead_s])
    scale = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    observation = _observation(model.range_m(at)[0], scale * model.rate_mps(at)[0], scale * a)
    chips = random_chips(np.random.default_rng(1), 128)
    handover = hand_over(observation, START + lead_s, chips, delay_m=delay_m)
    t = handover.start_time - START
    assert t * SPEED_OF_LIGHT_MPS == pytest.approx(model.range_m(np.array([t]))[0] + delay_m, abs=1e-4 * 30)
    assert handover.doppler_hz == pytest.approx(scale * 125 / 154 * model.rate_mps(np.array([t]))[0], abs=1e-6)
