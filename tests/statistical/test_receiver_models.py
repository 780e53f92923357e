"""The distributions of the receiver's error models against their equations and against reference numbers.

Error budget: a distribution is refused at p < 1e-4 of a Kolmogorov-Smirnov test (29 of them); counts, variances and
correlations at 4.4 standard deviations, 1e-5 each (about 50). So a correct model fails this file with a probability of
0.4 % for a new seed; the seeds are fixed. The reference tables for multipath have two or three digits and are
statistics themselves: 2 % on an rms, 5 % on a quantile of 1e-3.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from math import inf

import numpy as np
import pytest
from scipy import stats

from vestige.receiver.correlators.e1_multipath import e1_multipath_error_m
from vestige.receiver.errors.bias import BiasResiduals
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.empirical_ionosphere import EmpiricalIonosphere
from vestige.receiver.errors.error_process import named_streams
from vestige.receiver.errors.gauss_markov import GaussMarkovProcess
from vestige.receiver.errors.ionosphere import HeavyTailedIonosphere
from vestige.receiver.errors.multipath import LmsLiteMultipath, RayBlock
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise

C_MPS, F6_HZ = 299_792_458.0, 1278.75e6
P_MIN, SIGMAS = 1e-4, 4.4
STREAMS = named_streams(20, 11)


def agrees(sample: np.ndarray, distribution: object) -> None:
    from scipy.stats import kstest

    assert kstest(sample, distribution).pvalue > P_MIN


def expect_count(count: int, probability: float, trials: int) -> None:
    assert abs(count - trials * probability) < SIGMAS * np.sqrt(trials * probability * (1 - probability))


def expect_variance(sample: np.ndarray, variance: float) -> None:
    """Compare the mean square of independent Gaussian values of mean 0."""
    assert np.mean(sample**2) == pytest.approx(variance, rel=SIGMAS * np.sqrt(2 / sample.size))


# --- clock

CLOCK_EPOCHS = 200_000


def clock_run(step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Bias and drift from the start on, the start included."""
    times_s = np.arange(CLOCK_EPOCHS + 1) * step_s
    return TwoStateClock().process(STREAMS).advance(times_s)


def overlapping_allan_deviation(phase_s: np.ndarray, step_s: float, m: int) -> float:
    second = phase_s[2 * m :] - 2 * phase_s[m:-m] + phase_s[: -2 * m]
    return float(np.sqrt(np.mean(second**2) / 2) / (m * step_s))


@pytest.mark.judged(by="theory", what="receiver clock", figure="Allan deviation within 4.4 σ")
@pytest.mark.parametrize(
    ("step_s", "m", "expected"),
    [
        (0.01, 1, 2.5286e-11),
        (0.01, 10, 5.3592e-11),
        (1.0, 1, 1.6843e-10),
        (1.0, 10, 5.3259e-10),
        (1.0, 100, 1.6842e-9),
        (1.0, 1000, 5.3259e-9),
    ],
)
def test_allan_deviation(step_s: float, m: int, expected: float) -> None:
    import allantools

    bias_m, _ = clock_run(step_s)
    found = overlapping_allan_deviation(bias_m / C_MPS, step_s, m)
    # At least one degree of freedom for each non-overlapping second difference.
    assert found == pytest.approx(expected, rel=SIGMAS / np.sqrt(2 * CLOCK_EPOCHS / (2 * m)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        taus, deviations, _, _ = allantools.oadev(bias_m / C_MPS, rate=1 / step_s, data_type="phase", taus=[m * step_s])
    assert taus == pytest.approx([m * step_s])
    assert found == pytest.approx(deviations[0], rel=1e-9)


@pytest.mark.parametrize(("step_s", "stride"), [(1e-3, 1), (1e-2, 1), (1.0, 1), (1.0, 30)])
def test_noise_of_a_step_has_the_full_covariance(step_s: float, stride: int) -> None:
    """One step, or 30 as one: bias and drift noise with their correlation, 0.866 where the walk dominates."""
    bias_m, drift_mps = (column[::stride] for column in clock_run(step_s))
    t = step_s * stride
    kick = np.diff(drift_mps)
    jump = np.diff(bias_m) - drift_mps[:-1] * t
    sf, sg = C_MPS**2 * 7.115e-24 / 2, C_MPS**2 * 2 * np.pi**2 * 4.311e-21
    expect_variance(kick, sg * t)
    expect_variance(jump, sf * t + sg * t**3 / 3)
    rho = (sg * t**2 / 2) / np.sqrt(sg * t * (sf * t + sg * t**3 / 3))
    found = np.mean(kick * jump) / np.sqrt(np.mean(kick**2) * np.mean(jump**2))
    assert found == pytest.approx(rho, abs=SIGMAS * (1 - rho**2) / np.sqrt(kick.size))
    assert abs(np.corrcoef(kick[1:], kick[:-1])[0, 1]) < SIGMAS / np.sqrt(kick.size)


@pytest.mark.parametrize("step_s", [1e-3, 1.0])
def test_increments_of_the_clock_are_normal(step_s: float) -> None:
    """Both noises of a step, made independent and divided by the root of their covariance, are normal."""
    bias_m, drift_mps = clock_run(step_s)
    kick, jump = np.diff(drift_mps), np.diff(bias_m) - drift_mps[:-1] * step_s
    sf, sg = C_MPS**2 * 7.115e-24 / 2, C_MPS**2 * 2 * np.pi**2 * 4.311e-21
    bias_var, drift_var, both = sf * step_s + sg * step_s**3 / 3, sg * step_s, sg * step_s**2 / 2
    normal = stats.norm.cdf
    agrees(jump / np.sqrt(bias_var), normal)
    agrees(kick / np.sqrt(drift_var), normal)
    agrees((jump - both / drift_var * kick) / np.sqrt(bias_var - both**2 / drift_var), normal)


# --- E1 tracking


@pytest.mark.parametrize("cn0_dbhz", [35.0, 45.0])
def test_noise_of_e1_tracking_has_its_distribution(cn0_dbhz: float) -> None:
    """Normal with the model's σ for code, carrier and Doppler; 20 s apart, e^−160 from one to the next."""
    model = BetzTrackingNoise(loop_bandwidth_hz=2.0)
    found = model.process(STREAMS, cn0_dbhz=cn0_dbhz).advance(np.arange(50_000) * 20.0)
    sigmas = (model.code_sigma_m(cn0_dbhz), model.carrier_sigma_m(cn0_dbhz), model.doppler_sigma_hz(cn0_dbhz))
    for sample, sigma in zip(found, sigmas, strict=True):
        agrees(sample, stats.norm(scale=sigma).cdf)
    assert np.abs(np.corrcoef(found)[np.triu_indices(3, 1)]).max() < SIGMAS / np.sqrt(50_000)


# --- biases


def test_biases_have_their_distribution() -> None:
    """5000 receivers with a satellite each: normal at the start; an hour later with the drift in it."""
    model = BiasResiduals(bgd_sigma_m=1.5, hardware_sigma_m=3.0, hardware_drift_mps=1e-3)
    times_s = np.array([0.0, 3600.0])
    found = np.array(
        [model.process(named_streams(seed, 11), receiver=named_streams(seed)).advance(times_s) for seed in range(5000)]
    )
    agrees(found[:, 0], stats.norm(scale=np.hypot(1.5, 3.0)).cdf)
    agrees(found[:, 1], stats.norm(scale=np.sqrt(1.5**2 + 3.0**2 + 3.6**2)).cdf)
    agrees(found[:, 1] - found[:, 0], stats.norm(scale=3.6).cdf)


# --- ionosphere

CORE_2014 = {"core_sigma_m": 1.24, "tail_start_m": 2.65, "tail_scale_m": 1.17}


def mixture_cdf(x: np.ndarray, sigma: float, u: float, beta: float) -> np.ndarray:
    """0.9 N(0, σ) and 0.05 on each side of ±(u + Exp(β))."""
    from scipy.stats import expon, norm

    right, left = expon(loc=u, scale=beta), expon(loc=u, scale=beta)
    return np.asarray(0.9 * norm.cdf(x, scale=sigma) + 0.05 * right.cdf(x) + 0.05 * left.sf(-x))


@pytest.mark.parametrize(
    ("model", "numbers"),
    [
        (HeavyTailedIonosphere.solar_maximum_2014(), (1.24, 2.65, 1.17)),
        (HeavyTailedIonosphere.average_2017(), (0.76, 1.55, 0.78)),
    ],
)
def test_ionosphere_has_its_distribution(model: HeavyTailedIonosphere, numbers: tuple[float, float, float]) -> None:
    sample = model.process(STREAMS).advance(np.arange(200_000.0))
    agrees(sample, lambda x: mixture_cdf(x, *numbers))
    assert abs(np.corrcoef(sample[1:], sample[:-1])[0, 1]) < SIGMAS / np.sqrt(sample.size)


def test_rms_and_tail_of_2014() -> None:
    trials = 1_000_000
    sample = HeavyTailedIonosphere.solar_maximum_2014().process(STREAMS).advance(np.arange(float(trials)))
    fourth = np.mean(sample**4) / np.mean(sample**2) ** 2
    rms_error = 0.5 * np.sqrt((fourth - 1) / trials)
    assert np.sqrt(np.mean(sample**2)) == pytest.approx(1.73, rel=SIGMAS * rms_error + 0.005 / 1.73)  # printed digits
    expect_count(np.count_nonzero(sample > 10), 9.3e-5, trials)
    expect_count(np.count_nonzero(sample < -10), 9.3e-5, trials)
    beyond = sample[sample > 6] - 6  # where the core has 1e-6: an exponential again
    agrees(beyond, lambda x: -np.expm1(-x / 1.17))


def test_truncated_core_leaves_ten_percent_outside() -> None:
    sample = HeavyTailedIonosphere(truncated=True, **CORE_2014).process(STREAMS).advance(np.arange(200_000.0))
    expect_count(np.count_nonzero(np.abs(sample) > 2.65), 0.10, sample.size)
    from scipy.stats import truncnorm

    agrees(sample[np.abs(sample) <= 2.65], truncnorm(-2.65 / 1.24, 2.65 / 1.24, scale=1.24).cdf)


@pytest.mark.parametrize("lag", [1, 5, 20, 60])
def test_gauss_markov_correlation(lag: int) -> None:
    tau_s, n = 20.0, 200_000
    z = GaussMarkovProcess(STREAMS("z"), tau_s).advance(np.arange(float(n)))
    rho = np.exp(-1 / tau_s)
    # Bartlett's formula for a first-order autoregression
    spread = np.sqrt(((1 + rho**2) * (1 - rho ** (2 * lag)) / (1 - rho**2) - 2 * lag * rho ** (2 * lag)) / n)
    assert np.mean(z[lag:] * z[:-lag]) / np.mean(z**2) == pytest.approx(rho**lag, abs=SIGMAS * spread)


def test_memory_keeps_the_distribution() -> None:
    model = HeavyTailedIonosphere(correlation="gauss-markov", tau_s=7200.0, **CORE_2014)
    times_s = np.arange(20_000) * 72_000.0  # e^−10 from one to the next: practically independent
    agrees(model.process(STREAMS).advance(times_s), lambda x: mixture_cdf(x, 1.24, 2.65, 1.17))


def test_empirical_distribution() -> None:
    samples_m = 1.5 * np.random.default_rng(3).laplace(size=2000)
    sample = EmpiricalIonosphere(samples_m=samples_m).process(STREAMS).advance(np.arange(50_000.0))
    places = (np.arange(2000) + 0.5) / 2000
    inside = (sample > samples_m.min()) & (sample < samples_m.max())
    assert np.mean(inside) == pytest.approx(1 - 1 / 2000, abs=1e-3)
    ordered = np.sort(samples_m)
    agrees(sample[inside], lambda x: (np.interp(x, ordered, places) - places[0]) / (places[-1] - places[0]))


# --- multipath

RAY_EPOCHS = 100_000


def rays_of(model: LmsLiteMultipath, n: int = RAY_EPOCHS, step_s: float = 1.0) -> RayBlock:
    return model.process(STREAMS).advance(np.arange(n) * step_s)


def test_rays_have_their_distributions() -> None:
    from scipy.stats import arcsine, expon, truncexpon, uniform

    rays = rays_of(replace(LmsLiteMultipath.elevation_5_30(), speed_mps=2.0))
    delay, amplitude = rays.delay_m[:, 0], rays.amplitude[:, 0]
    agrees(delay, truncexpon(C_MPS * 500e-9 / 40, scale=40).cdf)
    agrees(np.abs(amplitude) ** 2, expon(scale=10**-1.58).cdf)
    agrees(np.abs(rays.amplitude_e1[:, 0]) ** 2, expon(scale=10**-1.58).cdf)
    agrees(np.angle(amplitude) / (2 * np.pi) % 1, uniform.cdf)
    agrees(np.angle(rays.amplitude_e1[:, 0]) / (2 * np.pi) % 1, uniform.cdf)
    agrees(rays.doppler_hz[:, 0], arcsine(loc=-2 * F6_HZ / C_MPS, scale=4 * F6_HZ / C_MPS).cdf)
    columns = np.stack([delay, np.abs(amplitude), amplitude.real, amplitude.imag, rays.doppler_hz[:, 0]])
    assert np.max(np.abs(np.corrcoef(columns) - np.eye(5))) < SIGMAS / np.sqrt(RAY_EPOCHS)


def test_phases_of_the_carriers_are_practically_independent() -> None:
    rays = rays_of(LmsLiteMultipath.elevation_5_30())
    relative = rays.amplitude_e1 / rays.amplitude
    # Characteristic function of the exponential: 1/√(1 + (2π μ (f1 − f6)/c)²), and noise
    expected = 1 / np.sqrt(1 + (2 * np.pi * 40 * (1575.42e6 - F6_HZ) / C_MPS) ** 2)
    assert abs(np.mean(relative)) < expected + SIGMAS / np.sqrt(RAY_EPOCHS)


@pytest.mark.parametrize(("n_rays", "mean_rays"), [(1, None), (3, None), (20, 3.0)])
def test_all_rays_together_have_the_power(n_rays: int, mean_rays: float | None) -> None:
    from scipy.stats import poisson

    model = replace(LmsLiteMultipath.elevation_5_30(), n_rays=n_rays, mean_rays=mean_rays)
    rays = rays_of(model)
    power = np.sum(np.abs(rays.amplitude) ** 2, axis=1)
    assert np.mean(power) == pytest.approx(10**-1.58, abs=SIGMAS * np.std(power) / np.sqrt(RAY_EPOCHS))
    present = np.count_nonzero(rays.amplitude, axis=1)
    if mean_rays is None:
        assert np.all(present == n_rays)
    else:
        for number in range(8):
            expect_count(np.count_nonzero(present == number), float(poisson.pmf(number, mean_rays)), RAY_EPOCHS)


def test_no_more_rays_than_places() -> None:
    model = replace(LmsLiteMultipath.elevation_5_30(), n_rays=4, mean_rays=3.0)
    present = np.count_nonzero(rays_of(model).amplitude, axis=1)
    from scipy.stats import poisson

    assert np.max(present) == 4
    expect_count(np.count_nonzero(present == 4), float(poisson.sf(3, 3.0)), RAY_EPOCHS)


@pytest.mark.parametrize(("speed_mps", "life_m", "life_s"), [(1.5, 3.0, inf), (0.0, 3.0, 4.0), (1.5, 3.0, 4.0)])
@pytest.mark.parametrize("step_s", [0.2, 3.0])
def test_rays_die_after_an_exponential_life(speed_mps: float, life_m: float, life_s: float, step_s: float) -> None:
    model = LmsLiteMultipath(
        power_db=-15.8, mean_excess_m=40.0, speed_mps=speed_mps, mean_life_m=life_m, mean_life_s=life_s
    )
    changed = np.diff(rays_of(model, step_s=step_s).delay_m[:, 0]) != 0
    death = 1 - np.exp(-step_s * (speed_mps / life_m + 1 / life_s))
    expect_count(np.count_nonzero(changed), death, changed.size)
    pairs = changed[1::2] & changed[:-1:2]
    expect_count(np.count_nonzero(pairs), death**2, pairs.size)


# --- multipath as an error of the range

CHIP_M = C_MPS / 5.115e6
TAPS_M = 15.0 * np.arange(-5, 6)


def snapshot_error_m(rays: RayBlock) -> np.ndarray:
    """Range from the highest tap and its neighbours, without noise, line of sight on the middle tap."""

    def triangle(x: np.ndarray) -> np.ndarray:
        return np.clip(1 - np.abs(x) / CHIP_M, 0, None)

    taps = triangle(TAPS_M) + sum(
        rays.amplitude[:, i, None] * triangle(TAPS_M - rays.delay_m[:, i, None]) for i in range(rays.delay_m.shape[1])
    )
    c = np.abs(taps)
    peak, row = np.clip(np.argmax(c, axis=1), 1, 9), np.arange(c.shape[0])
    early, punctual, late = c[row, peak - 1], c[row, peak], c[row, peak + 1]
    return np.asarray(TAPS_M[peak] + 7.5 * (late - early) / (punctual - np.minimum(early, late)))


@pytest.mark.judged(
    by="reference model",
    what="range errors of multipath",
    figure="rms within 2 %, quantile 0.999 within 5 %",
)
@pytest.mark.parametrize(
    ("mean_excess_m", "power_db", "e6", "e1", "difference"),
    [
        (10, -17.7, (0.77, 3.2), (0.85, 4.0), (1.14, 6.1)),
        (20, -16.9, (0.98, 3.5), (1.17, 4.6), (1.52, 6.9)),
        (40, -15.8, (1.07, 3.9), (1.46, 5.3), (1.80, 7.9)),
        (80, -14.8, (1.00, 4.1), (1.61, 6.0), (1.88, 8.4)),
    ],
)
def test_range_errors_of_one_ray(
    mean_excess_m: float,
    power_db: float,
    e6: tuple[float, float],
    e1: tuple[float, float],
    difference: tuple[float, float],
) -> None:
    """Rms and 99.9 % quantile; the delays of the reference are exponential without a cut."""
    model = LmsLiteMultipath(power_db=power_db, mean_excess_m=mean_excess_m, max_excess_m=inf, mean_life_m=0.0)
    rays = rays_of(model, 200_000)
    on_e6 = snapshot_error_m(rays)
    on_e1 = e1_multipath_error_m(rays.delay_m, rays.amplitude_e1)
    for errors_m, (rms_m, quantile_m) in ((on_e6, e6), (on_e1, e1), (on_e6 - on_e1, difference)):
        assert np.sqrt(np.mean(errors_m**2)) == pytest.approx(rms_m, rel=0.02, abs=0.005)
        assert np.quantile(np.abs(errors_m), 0.999) == pytest.approx(quantile_m, rel=0.05, abs=0.05)


def test_range_errors_of_the_preset() -> None:
    """A cut of the delays at 500 ns puts 2 % more of the reflections where they change the range."""
    rays = rays_of(LmsLiteMultipath.elevation_5_30(), 200_000)
    errors_m = snapshot_error_m(rays) - e1_multipath_error_m(rays.delay_m, rays.amplitude_e1)
    assert np.sqrt(np.mean(errors_m**2)) == pytest.approx(1.80, rel=0.03)
    assert np.quantile(np.abs(errors_m), 0.999) == pytest.approx(7.9, rel=0.05)
