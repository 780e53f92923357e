"""E1 correlators and received power: the model and what comes out of samples have one distribution.

Error budget: 88 comparisons at 1e-6 each.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.special import kolmogorov

from sky_builder import CLEAN, e1_of, sky_scenario
from vestige.receiver.correlators.e1_taps import TAP_CHIPS

EPOCHS = 120
LIFT_OFF = (
    'attack=[{kind="lift-off", start_s=0, power_db=3, delay_m={kind="ramp", first=0, last=110, start_s=5, stop_s=115}}]'
)
FAR_AND_JAMMED = (
    'attack=[{kind="meaconing", delay_s=0.013, power_db=3}, '
    '{kind="jamming", bands=["E1"], j_over_n_db=3, waveform={kind="cw"}}]'
)
PARTS = {"magnitude": np.abs, "real": np.real, "imaginary": np.imag, "phase": np.angle}


@cache
def taken(fidelity: str, attack: str, seed: int) -> dict[str, np.ndarray]:
    settings = (f'fidelity="{fidelity}"', f"epochs={EPOCHS}", f"recs.every={EPOCHS}", f"seed={seed}", attack)
    return e1_of(sky_scenario(*settings))


def same(a: np.ndarray, b: np.ndarray) -> float:
    """Return the p-value of the two-sample test of Kolmogorov and Smirnov."""
    x = np.concatenate([a, b])
    steps = [np.searchsorted(np.sort(one), x, side="right") / one.size for one in (a, b)]
    return float(kolmogorov(np.max(np.abs(steps[0] - steps[1])) * np.sqrt(a.size * b.size / (a.size + b.size))))


@pytest.mark.parametrize("attack", ["attack=[]", LIFT_OFF])
def test_both_fidelities_have_one_distribution(attack: str) -> None:
    model, samples = taken("correlators", attack, 31), taken("samples", attack, 32)
    for tap in range(len(TAP_CHIPS)):
        for name, part in PARTS.items():
            values = [part(found["taps"][:, :, tap].ravel()) for found in (model, samples)]
            assert same(*values) > 1e-6, (tap, name)
    assert same(model["power_db"], samples["power_db"]) > 1e-6


def test_another_cn0_would_be_seen() -> None:
    model = taken("correlators", "attack=[]", 31)["taps"][:, :, 2]
    assert same(np.abs(model.ravel()), 1.1 * np.abs(model.ravel())) < 1e-6  # 0.8 dB


@pytest.mark.parametrize("attack", ["attack=[]", LIFT_OFF, FAR_AND_JAMMED])
def test_what_is_left_of_the_difference_is_noise(attack: str) -> None:
    """With one truth the signals cancel: mean 0, and twice the covariance of the replicas over the taps."""
    found = [taken(fidelity, attack, 32) for fidelity in ("correlators", "samples")]
    assert found[0]["power_db"] == pytest.approx(found[1]["power_db"], abs=0.3)
    bare = [one["taps"] * 10 ** (one["power_db"] / 20)[:, None, None] for one in found]
    apart = (bare[0] - bare[1]).reshape(-1, len(TAP_CHIPS))
    n = apart.shape[0]
    jammed = found[0]["noise_rise_db"][0]
    expected = 2 * (1 - 3 * np.abs(np.subtract.outer(TAP_CHIPS, TAP_CHIPS))) * 10 ** (jammed / 10)
    for part in (apart.real, apart.imag):
        assert np.all(np.abs(part.mean(axis=0)) < 5 * np.sqrt(expected[0, 0] / n))
        if attack != FAR_AND_JAMMED:  # a wave is no white noise
            assert part.T @ part / n == pytest.approx(expected, abs=2 * 5.5 * np.sqrt(2 / n))


def test_clean_noise_without_the_loops() -> None:
    settings = (*CLEAN, "receiver.e1_tracking=none", 'fidelity="samples"', f"epochs={EPOCHS}", f"recs.every={EPOCHS}")
    found = e1_of(sky_scenario(*settings))
    shape = 1 - 3 * np.abs(np.array(TAP_CHIPS))
    strength = np.sqrt(2 * 10 ** (found["cn0_dbhz"] / 10) * 0.1)[..., None]
    noise = (found["taps"] - strength * shape).reshape(-1, len(TAP_CHIPS))
    n = noise.shape[0]
    expected = 1 - 3 * np.abs(np.subtract.outer(TAP_CHIPS, TAP_CHIPS))
    for part in (noise.real, noise.imag):
        assert np.all(np.abs(part.mean(axis=0)) < 6 / np.sqrt(n))
        assert part.T @ part / n == pytest.approx(expected, abs=5.5 * np.sqrt(2 / n))
