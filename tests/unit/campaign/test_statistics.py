"""Intervals and tests against scipy.stats, which vestige itself does not load; counts against results made by hand."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.statistics import (
    binomial_interval,
    binomial_test,
    enough,
    false_alarms,
    proportion,
    summarise,
)

COUNTS = st.integers(1, 100_000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))

PROCESSOR = AcasProcessor(p_fa=exp(-2))  # threshold sqrt(-2 ln p_fa) = 2


@given(COUNTS, st.sampled_from([0.5, 0.95, 0.999, 1 - 1e-6]))
def test_interval_is_that_of_clopper_and_pearson(counts: tuple[int, int], confidence: float) -> None:
    reference = binomtest(*counts).proportion_ci(confidence, method="exact")
    assert binomial_interval(*counts, confidence=confidence) == pytest.approx((reference.low, reference.high), rel=1e-9)


@given(COUNTS, st.floats(0, 1))
def test_p_value_is_twice_the_smaller_tail(counts: tuple[int, int], probability: float) -> None:
    k, n = counts
    tails = binom.cdf(k, n, probability), binom.sf(k - 1, n, probability)
    assert binomial_test(k, n, probability) == pytest.approx(min(1.0, 2 * min(tails)), rel=1e-7, abs=1e-300)


@given(COUNTS)
def test_p_value_equals_other_definitions_where_the_law_is_symmetric(counts: tuple[int, int]) -> None:
    assert binomial_test(*counts, 0.5) == pytest.approx(binomtest(*counts, 0.5).pvalue, rel=1e-7, abs=1e-300)


@given(COUNTS, st.floats(1e-6, 1 - 1e-6), st.sampled_from([0.9, 0.99, 1 - 1e-6]))
def test_test_and_interval_never_disagree(counts: tuple[int, int], probability: float, confidence: float) -> None:
    low, high = binomial_interval(*counts, confidence=confidence)
    p_value = binomial_test(*counts, probability)
    if abs(p_value - (1 - confidence)) > 1e-9:
        assert (low < probability < high) == (p_value > 1 - confidence)


def test_interval_covers_with_at_least_its_confidence() -> None:
    n, p = 60, 0.03
    intervals = [binomial_interval(k, n) for k in range(n + 1)]
    assert sum(binom.pmf(k, n, p) for k, (low, high) in enumerate(intervals) if low <= p <= high) >= 0.95


def test_the_paper_s_52_misses() -> None:
    # the chi-square form of the interval of a rare event: 38.8 to 68.2 of 1e5
    low, high = binomial_interval(52, 100_000)
    assert low * 1e5 == pytest.approx(38.84, abs=0.02)
    assert high * 1e5 == pytest.approx(68.19, abs=0.03)


def test_nothing_is_known_without_trials() -> None:
    assert binomial_interval(0, 0) == (0.0, 1.0)
    assert np.isnan(proportion(0, 0).value)
    assert binomial_test(0, 0, 0.3) == 1.0


@pytest.mark.parametrize(("k", "n"), [(-1, 3), (4, 3)])
def test_impossible_counts(k: int, n: int) -> None:
    with pytest.raises(ValueError, match="successes"):
        binomial_interval(k, n)
    with pytest.raises(ValueError, match="successes"):
        binomial_test(k, n, 0.5)


def test_impossible_probabilities() -> None:
    with pytest.raises(ValueError, match="confidence"):
        binomial_interval(1, 2, confidence=1.0)
    with pytest.raises(ValueError, match="probability"):
        binomial_test(1, 2, 1.1)
    with pytest.raises(ValueError, match="width"):
        enough(1, 2, 0.0)


def test_enough_at_the_wished_width() -> None:
    # normal approximation at p = 1/2: width 2 · 1.96 · √(1/4/n) = 0.02 at n = 9604
    stop = next(n for n in range(2, 20_000, 2) if enough(n // 2, n, 0.02))
    assert 9604 <= stop <= 9604 + 110
    assert not enough(0, 0, 0.99)
    assert enough(0, 0, 1.0)


def results_by_hand() -> xarray.Dataset:
    """Five epochs of two satellites; the last epoch of the second one was not correlated."""
    tap_index = np.array([[2, 2], [1, 2], [2, -1], [-1, 2], [3, -1]])
    offset_m = np.array([[0.0, 1.0], [-22.5, 2.0], [3.0, np.nan], [np.nan, 4.0], [5.0, np.nan]])
    noise_power = np.full((5, 2), 2.0)
    noise_power[4, 1] = np.nan
    taps = np.zeros((5, 2, 3), np.complex64)
    taps[0, 0] = [1.9, 2.1j, -3.0]  # σ = 1 per dimension, threshold 2
    taps[4, 1] = np.nan
    maximum = np.full((5, 2), -1)
    return xarray.Dataset(
        {
            "tap_index": (("detector", "epoch", "satellite"), np.stack([tap_index, maximum]).astype(np.int8)),
            "range_offset_m": (
                ("detector", "epoch", "satellite"),
                np.stack([offset_m, np.full((5, 2), np.nan)]).astype(np.float32),
            ),
            "noise_power": (("epoch", "satellite"), noise_power.astype(np.float32)),
            "taps": (("epoch", "satellite", "tap"), taps),
        },
        coords={"detector": ["early", "maximum"]},
    )


def test_summary() -> None:
    summary = summarise(results_by_hand())
    assert (summary.epochs, summary.detections.successes, summary.detections.trials, summary.misses) == (5, 7, 9, 2)
    assert (summary.detections.low, summary.detections.high) == binomial_interval(7, 9)
    assert (summary.cluster.successes, summary.cluster.trials) == (1, 7)
    assert summary.percentiles_m[50.0] == 2.0
    assert summary.percentiles_m[0.01] == pytest.approx(-22.5 + 0.0006 * 22.5)
    assert summary.percentiles_m[99.99] == pytest.approx(5.0 - 0.0006)
    assert summary.range_offset_mean_m == pytest.approx((0 + 1 - 22.5 + 2 + 3 + 4 + 5) / 7)


def test_summary_without_detections() -> None:
    summary = summarise(results_by_hand(), "maximum")
    assert (summary.detections.value, summary.misses) == (0.0, 9)
    assert np.isnan(summary.range_offset_mean_m)
    assert all(np.isnan(value) for value in summary.percentiles_m.values())


def test_summary_of_an_unknown_detector() -> None:
    with pytest.raises(ValueError, match="late"):
        summarise(results_by_hand(), "late")


def test_taps_above_the_threshold() -> None:
    """Taps that were not correlated are no trial; a magnitude of 1.9 does not exceed 2, those of 2.1 and 3 do."""
    results = results_by_hand().assign_coords(tap_offset_m=("tap", [-60.0, 0.0, 60.0]))
    found = false_alarms(results.assign_attrs(signal=False), PROCESSOR)
    assert (found.successes, found.trials) == (2, 27)


def with_truth(signal: bool) -> xarray.Dataset:
    """Taps at −75, −45, −15, 15, 45 m: those a chip apart are the first, third and fifth; all exceed the threshold."""
    shape = ("epoch", "satellite")
    late_m = {"iono_diff": [-10.0, 4.0], "bias": [-8.0, 0.0], "e1_noise": [-1.0, 1.0], "e1_multipath": [-0.5, 0.5]}
    return xarray.Dataset(
        {
            "taps": (("epoch", "satellite", "tap"), np.full((2, 1, 5), 5.0 + 0j)),
            "noise_power": (shape, np.full((2, 1), 2.0)),
            **{f"truth_{name}_m": (shape, np.array(values)[:, None]) for name, values in late_m.items()},
        },
        coords={"tap_offset_m": ("tap", np.arange(-75.0, 60.0, 30.0))},
        attrs={"signal": signal},
    )


def test_false_alarms_are_counted_where_there_is_noise_alone() -> None:
    """The line of sight is at −16.5 m, a chip before it is −75.11 m; and at 2.5 m: −56.11 m."""
    assert false_alarms(with_truth(True), PROCESSOR).trials == 1
    silent = false_alarms(with_truth(False), PROCESSOR)
    assert (silent.successes, silent.trials) == (6, 6)


def test_false_alarms_are_counted_before_the_first_of_several_signals() -> None:
    """E1 follows a spoofing signal: the line of sight is 30 m before the prediction. Another is 40 m before it, or is
    not.

    A chip before the first signal is at −88.6 m or −128.6 m, and −56.1 m where E1 is not followed.
    """
    two, each = ("epoch", "satellite"), ("epoch", "satellite", "attack")
    attacked = with_truth(True).assign(
        truth_prediction_error_m=(two, np.array([[-30.0], [2.5]])),
        truth_spoofer_offset_m=(each, np.array([[[30.0, -40.0]], [[0.0, -40.0]]])),
    )

    def trials(powers_db: list[float], forged: bool, later_m: float = 0.0) -> int:
        power_db = np.broadcast_to(powers_db, (2, 1, 2))
        results = attacked.assign(truth_spoofer_power_db=(each, power_db))
        results["truth_spoofer_offset_m"] = results["truth_spoofer_offset_m"] + later_m
        return false_alarms(results.assign_coords(forged=("attack", [False, forged])), PROCESSOR).trials

    assert trials([3.0, -np.inf], forged=False) == 1
    assert trials([3.0, 3.0], forged=False) == 0
    assert trials([3.0, 3.0], forged=True) == 1
    assert trials([3.0, 3.0], forged=False, later_m=300.0) == 1


def test_counts_do_not_depend_on_the_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    def counts() -> tuple[object, ...]:
        return (
            summarise(results_by_hand()),
            false_alarms(with_truth(True), PROCESSOR),
            false_alarms(with_truth(False), PROCESSOR),
        )

    whole = counts()
    for block in (1, 2):
        monkeypatch.setattr("vestige.campaign.statistics.READ_EPOCHS", block)
        assert counts() == whole
