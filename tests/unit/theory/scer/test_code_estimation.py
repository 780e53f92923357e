from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from vestige.signals.definitions import E1B
from vestige.theory.scer.code_estimation import (
    Decision,
    Estimation,
    chip_energy_over_n0,
    estimation_noise,
    matching_share,
    replayed_covariance,
    replayed_mean,
    sign_error_probability,
)


@pytest.mark.parametrize("estimation", ["repeated", "hard", "soft"])
@pytest.mark.parametrize("gain_db", [10.0, 20.0, 25.0])
def test_drawn_chips_correlate_as_computed(estimation: Estimation, gain_db: float) -> None:
    """400,000 chips of 45 dBHz; the bounds are 4.5 standard deviations of the correlation coefficient."""
    gamma = float(chip_energy_over_n0(45.0 + gain_db))
    n, rng = 400_000, np.random.default_rng(round(gain_db))
    chips = rng.choice([-1.0, 1.0], n)
    in_phase, quadrature = rng.standard_normal((2, n)) / np.sqrt(2 * gamma)
    received = chips + in_phase
    sent = {
        "repeated": received + 1j * quadrature,
        "hard": np.sign(received) + 0j,
        "soft": np.tanh(2 * gamma * received) + 0j,
    }[estimation]
    correlation = np.mean(sent * chips).real / np.sqrt(np.mean(np.abs(sent) ** 2))
    expected = np.sqrt(float(matching_share(gamma, estimation)))
    assert abs(correlation - expected) < 4.5 / np.sqrt(n)
    if estimation == "hard":
        errors, p = np.mean(sent.real != chips), float(sign_error_probability(gamma))
        assert abs(errors - p) < 4.5 * np.sqrt(p * (1 - p) / n)
        assert expected == pytest.approx(1 - 2 * p)


@pytest.mark.parametrize("gamma_db", [-40.0, -22.1, -5.0, 0.0, 5.0, 10.0, 30.0])
def test_the_quadrature_of_the_soft_share(gamma_db: float) -> None:
    """Against E[x s]²/E[x²] on a grid, which does not use that both are the same."""
    gamma = 10 ** (gamma_db / 10)
    z = np.linspace(-12, 12, 100_001)
    density = np.exp(-np.square(z) / 2) / np.sqrt(2 * np.pi) * (z[1] - z[0])
    soft = np.tanh(2 * gamma + np.sqrt(2 * gamma) * z)
    assert float(matching_share(gamma, "soft")) == pytest.approx((soft @ density) ** 2 / (soft**2 @ density), rel=1e-7)


def test_the_figures_for_e6c() -> None:
    """Ec/N0 −22 dB at 45 dBHz; 10 % wrong chips need 21 dB, cost 1.9 dB; soft decisions gain 0.6 dB at 20 dB."""
    assert 10 * np.log10(chip_energy_over_n0(45.0)) == pytest.approx(-22.1, abs=0.05)

    def wrong(gain_db: float) -> float:
        return float(sign_error_probability(chip_energy_over_n0(45.0 + gain_db))) - 0.1

    gain_db = float(brentq(wrong, 10.0, 30.0))
    assert gain_db == pytest.approx(21.2, abs=0.1)
    assert 10 * np.log10(matching_share(chip_energy_over_n0(45.0 + gain_db), "hard")) == pytest.approx(-1.94, abs=0.01)
    twenty = chip_energy_over_n0(65.0)
    gained_db = 10 * np.log10(matching_share(twenty, "soft") / matching_share(twenty, "hard"))
    assert gained_db == pytest.approx(0.6, abs=0.05)


def test_the_noise_in_the_spoofing_signal() -> None:
    """1/G of a repeater; 1.05 dB and 3 dB less by decisions on chips far below the noise; none on clear chips."""
    assert estimation_noise(45.0, 20.0, "repeated") == pytest.approx(0.01)
    assert estimation_noise(35.0, -20.0, "hard") == pytest.approx(100 * np.pi / 4, rel=1e-3)
    assert estimation_noise(35.0, -20.0, "soft") == pytest.approx(50, rel=1e-3)
    assert 0 <= estimation_noise(45.0, 60.0, "soft") < 1e-12
    assert 0 <= estimation_noise(45.0, 60.0, "hard") < 1e-12


def test_hard_decisions_beat_repetition_in_phase_from_20_db_on() -> None:
    """An attacker who repeats without the quadrature has half the noise; soft decisions always have less."""

    def better_db(gain_db: float, estimation: Estimation) -> float:
        in_phase = estimation_noise(45.0, gain_db, "repeated") / 2
        return 10 * np.log10(in_phase / estimation_noise(45.0, gain_db, estimation))

    assert float(brentq(lambda gain_db: better_db(gain_db, "hard"), 10.0, 25.0)) == pytest.approx(20.5, abs=0.15)
    assert all(better_db(gain_db, "soft") > 0 for gain_db in np.arange(-10.0, 30.0))


def test_an_unknown_estimation_is_refused() -> None:
    with pytest.raises(ValueError, match="no estimation 'linear'"):
        matching_share(1.0, "linear")  # type: ignore[arg-type]


@pytest.mark.parametrize("decision", ["hard", "soft"])
@pytest.mark.parametrize("head_chips", [-1.5, 0.0, 0.7])
def test_drawn_symbols_have_mean_and_covariance(decision: Decision, head_chips: float) -> None:
    """100,000 sums of what was received, from one chip to the next; bounds of 5 standard deviations, at most."""
    cn0_dbhz, n_chips, n = 52.0, 5, 100_000
    rng = np.random.default_rng(3)
    known_s = np.maximum(np.arange(n_chips) + head_chips, 0.0) / E1B.chip_rate_hz
    step = np.diff(known_s, prepend=0.0) * 10 ** (cn0_dbhz / 10)
    total = np.cumsum(2 * step + np.sqrt(2 * step) * rng.standard_normal((n, n_chips)), axis=1)  # 2γ y
    guess = rng.choice([-1.0, 1.0], (n, n_chips))
    sent = np.tanh(total) if decision == "soft" else np.where(known_s > 0, np.sign(total), guess)
    head_s = head_chips / E1B.chip_rate_hz
    assert np.abs(sent.mean(axis=0) - replayed_mean(cn0_dbhz, head_s, n_chips, decision)).max() < 5 / np.sqrt(n)
    covariance = replayed_covariance(cn0_dbhz, head_s, n_chips, decision)
    assert np.abs(np.cov(sent.T) - covariance).max() < 10 / np.sqrt(n)
