from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from vestige.receiver.snapshots.cn0_estimate import CN0_INTEGRATION_S, PROMPTS, estimated_cn0_dbhz
from vestige.streams import stream


@pytest.mark.parametrize("cn0_dbhz", [20.0, 35.0, 50.0])
def test_an_estimate_is_that_of_fifty_prompt_correlators(cn0_dbhz: float) -> None:
    """Two-sample KS against the formula on 50 complex prompts, phases at random; p > 0.001."""
    n = 4000
    rng = stream(5, "prompts", repr(cn0_dbhz))
    phase = np.exp(2j * np.pi * rng.random((n, PROMPTS)))
    noise = rng.standard_normal((n, PROMPTS)) + 1j * rng.standard_normal((n, PROMPTS))
    prompts = np.sqrt(2 * 10 ** (cn0_dbhz / 10) * CN0_INTEGRATION_S) * phase + noise
    simulated = (np.sum(np.abs(prompts) ** 2, axis=1) / (2 * PROMPTS) - 1) / CN0_INTEGRATION_S
    drawn = 10 ** (estimated_cn0_dbhz(np.full(n, cn0_dbhz), seed=1, svid=7, first=0) / 10)
    assert stats.ks_2samp(simulated, drawn).pvalue > 0.001


def test_the_estimate_has_no_bias_and_the_spread_of_its_law() -> None:
    """Mean and variance within 4.4 standard errors: relative variance (2 C T + 1)/(K C² T²)."""
    n, snr = 20_000, 10**2.5 * CN0_INTEGRATION_S
    found = 10 ** (estimated_cn0_dbhz(np.full(n, 25.0), seed=2, svid=7, first=0) / 10) / 10**2.5
    variance = (2 * snr + 1) / (PROMPTS * snr**2)
    assert np.mean(found) == pytest.approx(1.0, abs=4.4 * np.sqrt(variance / n))
    assert np.var(found) == pytest.approx(variance, rel=4.4 * np.sqrt(2.2 / n))


def test_an_estimate_does_not_depend_on_the_cut_and_satellites_differ() -> None:
    cn0_dbhz = np.linspace(25.0, 45.0, 1200)
    whole = estimated_cn0_dbhz(cn0_dbhz, seed=3, svid=7, first=0)
    parts = [
        estimated_cn0_dbhz(cn0_dbhz[low:high], seed=3, svid=7, first=low)
        for low, high in ((0, 1), (1, 499), (499, 1200))
    ]
    assert np.concatenate(parts).tobytes() == whole.tobytes()
    assert not np.any(estimated_cn0_dbhz(cn0_dbhz, seed=3, svid=8, first=0) == whole)


def test_what_noise_drives_below_zero_is_a_number() -> None:
    assert np.all(np.isfinite(estimated_cn0_dbhz(np.full(500, -np.inf), seed=1, svid=1, first=0)))
