from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.signals.pulse import (
    BOC11,
    BOC61,
    BPSK,
    CBOC_MINUS,
    CBOC_PLUS,
    Pulse,
    autocorrelation,
    band_limited_autocorrelation,
    gabor_bandwidth_hz,
    spectrum,
)

F0 = 1.023e6
PULSES = (BPSK, BOC11, BOC61, CBOC_PLUS, CBOC_MINUS)
BANDWIDTHS_MHZ = (4.092, 10.23, 14, 20.46, 24.552, 40.92)


@pytest.mark.parametrize("pulse", PULSES, ids=lambda pulse: pulse.name)
def test_unit_area_and_unit_power(pulse: Pulse) -> None:
    share = band_limited_autocorrelation(pulse, np.zeros(1), chip_rate_hz=F0, bandwidth_hz=4000e6)[0]
    assert share == pytest.approx(1.0, abs=2e-2 if pulse is not BPSK else 1e-3)
    assert autocorrelation(pulse, np.zeros(1))[0] == pytest.approx(1.0)


@pytest.mark.parametrize("pulse", PULSES, ids=lambda pulse: pulse.name)
@given(delay=st.floats(-1.5, 1.5))
def test_autocorrelation_equals_the_integral_over_a_chip(pulse: Pulse, delay: float) -> None:
    """R(τ) = (1/T) ∫ p(t) p(t+τ) dt, integrated as a Riemann sum that is exact on the sub-chip grid."""
    n = 4800
    t = (np.arange(n) + 0.5) / n
    levels = np.asarray(pulse.levels)
    shifted = t + delay
    inside = (shifted >= 0) & (shifted < 1)
    there = np.where(inside, levels[np.clip((shifted * levels.size).astype(int), 0, levels.size - 1)], 0.0)
    direct = np.mean(levels[(t * levels.size).astype(int)] * there)
    assert autocorrelation(pulse, np.array([delay]))[0] == pytest.approx(direct, abs=30 / n)


def test_bpsk_triangle() -> None:
    assert autocorrelation(BPSK, np.array([-2, -1, -0.25, 0, 0.5, 1, 2])) == pytest.approx([0, 0, 0.75, 1, 0.5, 0, 0])


def test_bpsk_and_boc_spectra_equal_their_textbook_forms() -> None:
    f = np.linspace(-20e6, 20e6, 1999) + 17.0
    assert spectrum(BPSK, f, 5 * F0) == pytest.approx(np.sinc(f / (5 * F0)) ** 2 / (5 * F0))
    textbook = (
        F0 * (np.sin(np.pi * f / (2 * F0)) * np.sin(np.pi * f / F0) / (np.pi * f * np.cos(np.pi * f / (2 * F0)))) ** 2
    )
    assert spectrum(BOC11, f, F0) == pytest.approx(textbook)


def test_cboc_signs_average_to_mboc() -> None:
    f = np.linspace(-15e6, 15e6, 801)
    mboc = 10 / 11 * spectrum(BOC11, f, F0) + 1 / 11 * spectrum(BOC61, f, F0)
    assert (spectrum(CBOC_PLUS, f, F0) + spectrum(CBOC_MINUS, f, F0)) / 2 == pytest.approx(mboc)


def test_cboc_first_levels_carry_the_sign_of_the_icd() -> None:
    assert CBOC_PLUS.levels[0] > 1 > CBOC_MINUS.levels[0] > 0


# In-band power and Gabor bandwidth, reference table of models (Betz-Kolodziejski section), four and three decimals.
@pytest.mark.parametrize(
    ("pulses", "chip_rate", "shares", "gabors"),
    [
        ((BPSK,), 5 * F0, (0.676, 0.9028, 0.9189, 0.9499, 0.9559, 0.9748), (1.096, 1.714, 1.900, 2.362, 2.529, 3.298)),
        ((BOC11,), F0, (0.8557, 0.9385, 0.9538, 0.9697, 0.9747, 0.9848), (0.862, 1.302, 1.483, 1.811, 1.979, 2.542)),
        (
            (CBOC_PLUS, CBOC_MINUS),
            F0,
            (0.7793, 0.8595, 0.9400, 0.9559, 0.9605, 0.9775),
            (0.863, 1.334, 2.183, 2.410, 2.526, 3.367),
        ),
    ],
    ids=["BPSK(5)", "BOC(1,1)", "MBOC"],
)
def test_band_table(
    pulses: tuple[Pulse, ...], chip_rate: float, shares: tuple[float, ...], gabors: tuple[float, ...]
) -> None:
    for bandwidth, share, gabor in zip(BANDWIDTHS_MHZ, shares, gabors, strict=True):
        power = [
            band_limited_autocorrelation(p, np.zeros(1), chip_rate_hz=chip_rate, bandwidth_hz=bandwidth * 1e6)[0]
            for p in pulses
        ]
        width = [gabor_bandwidth_hz(p, chip_rate_hz=chip_rate, bandwidth_hz=bandwidth * 1e6) for p in pulses]
        assert np.mean(power) == pytest.approx(share, abs=6e-4 if share == 0.676 else 6e-5)
        mixed = np.sqrt(np.average(np.square(width), weights=power)) * 1e-6
        assert mixed == pytest.approx(gabor, abs=6e-4)


def test_band_limited_e6_correlation_at_the_paper_spacing() -> None:
    for bandwidth, ratio_15, ratio_7 in [(10.23, 0.863, 0.964), (20.46, 0.788, 0.936), (40.92, 0.763, 0.897)]:
        r0, r7, r15 = band_limited_autocorrelation(
            BPSK, np.array([0.0, 7.5, 15.0]) / 58.6105, chip_rate_hz=5 * F0, bandwidth_hz=bandwidth * 1e6
        )
        assert (r15 / r0, r7 / r0) == (pytest.approx(ratio_15, abs=6e-4), pytest.approx(ratio_7, abs=6e-4))


@given(st.floats(-5, 5), st.floats(0.5, 60))
def test_wide_band_limit_is_even_and_bounded(delay: float, bandwidth_mhz: float) -> None:
    r = band_limited_autocorrelation(
        BPSK, np.array([delay, -delay, 0.0]), chip_rate_hz=5 * F0, bandwidth_hz=bandwidth_mhz * 1e6
    )
    assert r[0] == pytest.approx(r[1])
    assert abs(r[0]) <= r[2] + 1e-12 <= 1.0 + 1e-9


def test_no_bandwidth() -> None:
    with pytest.raises(ValueError, match="bandwidth"):
        gabor_bandwidth_hz(BPSK, chip_rate_hz=F0, bandwidth_hz=0.0)
