from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from vestige.receiver.errors.error_process import named_streams
from vestige.receiver.errors.ionosphere import HeavyTailedIonosphere

MODELS = st.builds(
    HeavyTailedIonosphere,
    core_sigma_m=st.floats(0.1, 5.0),
    tail_start_m=st.floats(0.5, 5.0),
    tail_scale_m=st.floats(0.1, 5.0),
    tail_probability=st.floats(0.0, 1.0),
    late_tail_share=st.floats(0.0, 1.0),
    truncated=st.booleans(),
)


@given(model=MODELS, z=st.lists(st.floats(-8.0, 8.0), min_size=1, max_size=30))
def test_the_quantile_inverts_the_distribution(model: HeavyTailedIonosphere, z: list[float]) -> None:
    values = np.array(z)
    found = model.quantile(values)
    late = found > 0
    # A gap between core and tail has no probability of its own: every quantile in it is one.
    for side, probability in ((late, ndtr(-values)), (found < 0, ndtr(values))):
        beyond = model.exceedance(np.abs(found[side]), late=side is late)
        assert beyond == pytest.approx(probability[side], rel=1e-9, abs=1e-15)


@given(model=MODELS)
def test_the_quantile_ascends_and_the_mirrored_model_mirrors_it(model: HeavyTailedIonosphere) -> None:
    z = np.linspace(-7, 7, 301)
    found = model.quantile(z)
    assert np.all(np.diff(found) >= -1e-9)
    mirrored = replace(model, late_tail_share=1 - model.late_tail_share)
    assert found == pytest.approx(-mirrored.quantile(-z), rel=1e-9, abs=1e-9)


def test_a_symmetric_model_is_odd_to_the_bit() -> None:
    z = np.linspace(-7, 7, 301)
    model = HeavyTailedIonosphere.solar_maximum_2014()
    assert np.array_equal(model.quantile(z), -model.quantile(-z))


def test_without_its_early_tail_the_late_side_of_2014_is_as_before_and_the_early_side_gaussian() -> None:
    """The preset keeps 5 % in the late tail; the early side is 95 % of the core alone."""
    both, late = HeavyTailedIonosphere.solar_maximum_2014(), HeavyTailedIonosphere.solar_maximum_2014_late()
    x_m = np.array([6.0, 8.0, 10.0])
    assert late.exceedance(x_m) == pytest.approx(both.exceedance(x_m), rel=1e-4)
    assert late.exceedance(x_m, late=False) == pytest.approx(0.95 * ndtr(-x_m / 1.24), rel=1e-12)


def test_without_tails_it_is_gaussian() -> None:
    z = np.linspace(-7, 7, 100)
    model = HeavyTailedIonosphere(core_sigma_m=1.3, tail_start_m=2.0, tail_scale_m=1.0, tail_probability=0.0)
    assert model.quantile(z) == pytest.approx(1.3 * z, rel=1e-9)


def test_without_a_core_it_is_a_shifted_exponential() -> None:
    z = np.linspace(0.1, 7, 100)
    model = HeavyTailedIonosphere(core_sigma_m=1.0, tail_start_m=2.0, tail_scale_m=0.5, tail_probability=1.0)
    assert model.quantile(z) == pytest.approx(2.0 - 0.5 * np.log(2 * ndtr(-z)), rel=1e-12)


def test_a_truncated_core_leaves_the_tails_exactly_their_probability() -> None:
    free, cut = (
        HeavyTailedIonosphere(core_sigma_m=1.24, tail_start_m=2.65, tail_scale_m=1.17, truncated=truncated)
        for truncated in (False, True)
    )
    u = np.array([2.65])
    assert 2 * cut.exceedance(u)[0] == pytest.approx(0.10, rel=1e-12)
    assert 2 * free.exceedance(u)[0] == pytest.approx(0.129, abs=5e-4)


def test_probability_beyond_ten_metres() -> None:
    model = HeavyTailedIonosphere.solar_maximum_2014()
    assert model.exceedance(np.array([10.0]))[0] == pytest.approx(9.3e-5, rel=6e-3)  # the printed digits


def test_ten_metres_are_the_quantile_of_one_in_ten_thousand() -> None:
    model = HeavyTailedIonosphere.solar_maximum_2014()
    assert model.quantile(np.array([3.719]))[0] == pytest.approx(10, abs=0.1)  # Φ(−3.719) = 1e-4


@pytest.mark.parametrize(
    ("model", "rms_m"),
    [  # rms of NeQuick-G minus NTCM-G; the recommended mixture of the first has 1.73 m
        (HeavyTailedIonosphere.solar_maximum_2014(), 1.70),
        (HeavyTailedIonosphere.average_2017(), 1.06),
        (HeavyTailedIonosphere.solar_maximum_2014_high(), 0.98),
        (HeavyTailedIonosphere.average_2017_high(), 0.64),
    ],
)
def test_presets_have_the_rms_of_what_they_stand_for(model: HeavyTailedIonosphere, rms_m: float) -> None:
    p, u, beta = model.tail_probability, model.tail_start_m, model.tail_scale_m
    mean_square = (1 - p) * model.core_sigma_m**2 + p * ((u + beta) ** 2 + beta**2)
    assert np.sqrt(mean_square) == pytest.approx(rms_m, rel=0.03)


def test_memory_does_not_change_the_first_value() -> None:
    """Both kinds go through the same inverse distribution function, from the same stream."""
    iid, slow = (
        replace(HeavyTailedIonosphere.solar_maximum_2014(), correlation=correlation).process(named_streams(1, 3))
        for correlation in ("iid", "gauss-markov")
    )
    times_s = np.arange(600.0)
    one, other = iid.advance(times_s), slow.advance(times_s)
    assert one[0] == other[0]
    assert np.std(np.diff(other)) < 0.1 * np.std(np.diff(one))


@pytest.mark.parametrize(
    "wrong",
    [
        {"core_sigma_m": -1.0},
        {"tail_start_m": -1.0},
        {"tail_scale_m": np.nan},
        {"tail_probability": 1.1},
        {"late_tail_share": -0.1},
    ],
)
def test_parameters_must_make_sense(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="not"):
        HeavyTailedIonosphere(**({"core_sigma_m": 1.0, "tail_start_m": 2.0, "tail_scale_m": 1.0} | wrong))
