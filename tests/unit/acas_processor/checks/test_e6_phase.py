from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from steady_evidence import steady_evidence
from vestige.acas_processor.checks.e6_phase import E6PhaseMonitor
from vestige.acas_processor.checks.power.e6_fading import E6FadingMonitor
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.acas_processor.monitoring.recs_windows import remembered_recs
from vestige.records import Outcome

NO_RAYS = -200.0


def rays(rng: np.random.Generator, shape: tuple[int, ...], power_db: float) -> np.ndarray:
    """Return complex amplitudes of Rayleigh magnitude."""
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * np.sqrt(0.5) * 10 ** (power_db / 20)


def received(rng: np.random.Generator, direct: np.ndarray, magnitude: float) -> np.ndarray:
    """Return correlators in standard deviations of the noise per dimension."""
    return magnitude * direct + rng.standard_normal(direct.shape) + 1j * rng.standard_normal(direct.shape)


@pytest.mark.parametrize("window", [10, 100])
def test_false_alarms_of_noise_are_those_of_the_budget(window: int) -> None:
    """800 windows that share nothing, each with a constant and a slow drift of its own, at 20 σ; two-sided at 1e-4."""
    rng, p_fa, runs = np.random.default_rng(1), 2e-2, 800
    drift = rng.uniform(-0.1, 0.1, runs) * np.arange(window)[:, None] + rng.uniform(0, 6, runs)
    taps = received(rng, np.exp(1j * drift), 20.0)
    monitor = E6PhaseMonitor(window=window, ray_power_db=NO_RAYS, p_fa=p_fa)
    series = monitor.series(steady_evidence(np.angle(taps), np.abs(taps)))
    assert series.run[-1].all()
    assert not series.run[:-1].any()
    count = int(np.count_nonzero(series.failed[-1]))
    assert binom.ppf(5e-5, runs, p_fa) <= count <= binom.isf(5e-5, runs, p_fa)


@pytest.mark.parametrize("kind", ["new", "lasting"])
@pytest.mark.parametrize("check", [E6PhaseMonitor, E6FadingMonitor])
def test_false_alarms_of_rays_stay_below_the_budget(
    kind: str, check: type[E6PhaseMonitor] | type[E6FadingMonitor]
) -> None:
    """Rays of −15.8 dB on top of the direct signal, new with each RECS, or one that lasts and turns; an upper limit."""
    rng, p_fa, runs, window = np.random.default_rng(2), 2e-2, 1000, 30
    if kind == "new":
        ray = rays(rng, (window, runs), -15.8)
    else:
        turns = rng.uniform(-0.5, 0.5, runs) * np.arange(window)[:, None]
        ray = rays(rng, (1, runs), -15.8) * np.exp(2j * np.pi * turns)
    taps = received(rng, 1 + ray, 12.0)
    monitor = check(window=window, ray_life_s=0.0 if kind == "new" else np.inf, p_fa=p_fa)
    series = monitor.series(steady_evidence(np.angle(taps), np.abs(taps)))
    count = int(np.count_nonzero(series.failed[-1]))
    assert series.run[-1].all()
    assert 0.05 * p_fa * runs < count <= binom.isf(1e-4, runs, p_fa)


def test_a_spoofer_that_comes_in_is_seen_if_reflections_do_not_last() -> None:
    """−10 dB at 35 dBHz over 100 RECS of one second, at the budget of 1e-6; one that lasts would look the same."""
    rng = np.random.default_rng(4)
    turned = np.exp(2j * np.pi * 0.37 * np.arange(100))[:, None] * np.exp(2j * np.pi * rng.random(200))
    ray = rays(rng, turned.shape, -21.0)
    taps = received(rng, 1 + ray + 10 ** (-10 / 20) * turned, 10.06)
    for check in (E6PhaseMonitor, E6FadingMonitor):
        for life_s, low, high in ((0.0, 0.8, 1.0), (np.inf, 0.0, 0.0)):
            series = check(window=100, ray_life_s=life_s).series(steady_evidence(np.angle(taps), np.abs(taps)))
            assert low <= np.mean(series.failed[-1]) <= high, (check, life_s)


def test_whole_turns_and_a_drift_mean_nothing() -> None:
    """The ionosphere turns the phase by several whole turns in a window."""
    phase_rad = (0.5 * np.arange(60))[:, None]
    series = E6PhaseMonitor().series(steady_evidence(phase_rad, 20.0, predicted_rad=2.0))
    assert np.nanmax(series.statistic) < 1e-6
    assert np.count_nonzero(series.run) == 31


def test_e1_makes_its_own_noise() -> None:
    """At 35 dBHz: 18 Hz/3162 (1 + 1/(2 · 20 ms · 3162)) = 0.0758 rad on E1, 0.0615 on E6; 0.102 of E6 beside it."""
    found = E6PhaseMonitor().variance_rad2(np.array([9.8]), np.array([35.0]), np.array([0.0]))
    assert np.sqrt(found[0]) == pytest.approx(np.hypot(1 / 9.8, 0.0615), rel=2e-3)
    later = E6PhaseMonitor().variance_rad2(np.array([9.8]), np.array([35.0]), np.array([0.09]))
    of_doppler_hz = 1 / (2 * np.pi * 0.02) * np.sqrt(20 / 3162 * (1 + 1 / (0.02 * 3162)))
    assert later[0] - found[0] == pytest.approx((2 * np.pi * 0.09 * of_doppler_hz * 125 / 154) ** 2, rel=1e-3)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"interval_s": 30.0}, "RECS are too far apart: the phase may turn by more than half a turn"),
        ({"interval_s": 4.2}, "the last 30 RECS take more than 120 s"),
        ({"predicted_rad": np.nan}, "E1 has no carrier phase"),
        ({"magnitude_sigma": np.nan}, "nothing was detected on E6"),
        ({"seen": np.arange(40)[:, None] != 20}, "fewer than 30 RECS in a row with a carrier phase of E1"),
    ],
)  # fmt: skip
def test_it_says_why_it_was_not_run(given: dict[str, object], reason: str) -> None:
    given = {"magnitude_sigma": 10.0} | given
    result = E6PhaseMonitor().series(steady_evidence(np.zeros((40, 1)), **given)).result(39, 0)  # type: ignore[arg-type]
    assert result.outcome is Outcome.NOT_RUN
    assert result.reason.startswith(reason)


def test_fading_is_run_with_any_interval() -> None:
    rng = np.random.default_rng(5)
    given = steady_evidence(np.zeros((40, 1)), 10 + rng.standard_normal((40, 1)), interval_s=30.0, predicted_rad=np.nan)
    assert E6FadingMonitor().series(given).result(39, 0).outcome is Outcome.PASS
    early = E6FadingMonitor().series(given).result(28, 0)
    assert early.reason == "fewer than 30 RECS in a row since E1 began to track the satellite"
    fades = steady_evidence(np.zeros((40, 1)), 10 + 6 * (-1.0) ** np.arange(40)[:, None], interval_s=30.0)
    assert "the magnitude of E6 scatters" in E6FadingMonitor().series(fades).result(39, 0).reason


@pytest.mark.parametrize("check", [E6PhaseMonitor, E6FadingMonitor])
@pytest.mark.parametrize("cuts", [(1,), (7, 13), tuple(range(1, 60))])
def test_one_by_one_equals_the_block(
    check: type[E6PhaseMonitor] | type[E6FadingMonitor], cuts: tuple[int, ...]
) -> None:
    """To the bit, with RECS that are missed and a time in which E1 does not track a satellite."""
    rng, monitor = np.random.default_rng(6), check(window=12, p_fa=1e-2)
    phase_rad, magnitude = 0.3 * rng.standard_normal((60, 2)), 8 + rng.standard_normal((60, 2))
    seen = np.ones((60, 2), bool)
    magnitude[rng.random((60, 2)) < 0.1] = np.nan
    seen[20:22, 1], magnitude[20:22, 1] = False, np.nan
    whole = monitor.series(steady_evidence(phase_rad, magnitude, seen=seen))
    assert np.count_nonzero(whole.run[:, 0]) > np.count_nonzero(whole.run[:, 1]) > 10
    memory: CheckMemory = {}
    for low, high in zip((0, *cuts), (*cuts, 60), strict=True):
        part = slice(low, high)
        given = steady_evidence(phase_rad[part], magnitude[part], seen=seen[part], first=low, memory=memory)
        found = monitor.series(given)
        np.testing.assert_array_equal(found.statistic, whole.statistic[part])
        np.testing.assert_array_equal(found.threshold, whole.threshold[part])
        memory = remembered_recs(given, 11)


def test_elevation_scales_the_rays() -> None:
    given = steady_evidence(np.zeros((30, 1)))
    high = replace(given, elevation_rad=np.full((30, 1), np.radians(60.0)))
    low = replace(given, elevation_rad=np.full((30, 1), np.radians(5.0)))
    limits = [E6PhaseMonitor().series(one).threshold[-1, 0] for one in (high, given, low)]
    assert limits[0] < limits[1] < limits[2]
