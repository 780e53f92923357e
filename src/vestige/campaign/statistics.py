"""Count the detections and false alarms of a campaign, and compute confidence intervals of their probabilities.

Every probability is estimated from k successes in n independent trials. The interval of a probability is the exact
interval of Clopper and Pearson (Biometrika 26, 1934, 404–413). The two-sided test rejects a probability p at the
significance level α if and only if p is outside the interval of confidence 1 − α. The campaign must make trials
independent. Epochs that share a slow error, such as an ionosphere with a time constant of hours, are not independent
trials. With such epochs, an interval of the stated confidence must be wider.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int
from scipy.special import betainc, betaincc, betaincinv, chdtri

from vestige.acas_processor.processor import AcasProcessor
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records.snapshot_block import BankBlock
from vestige.signals.definitions import E6C

if TYPE_CHECKING:
    import xarray

CONFIDENCE = 0.95
# Limits in m of the cluster of range offsets of the early detector at −22.5 m [WFO, Sec. VI-A]. The limits are ± 0.3
# correlator spacings of 15 m from the centre.
CLUSTER_M = (-27.0, -18.0)
# percentages of the percentiles in [WFO, Sec. VI-A], and 100 % minus these percentages
PERCENTILES = (0.01, 0.1, 1.0, 50.0, 99.0, 99.9, 99.99)
E6_CHIP_M = SPEED_OF_LIGHT_MPS / E6C.chip_rate_hz
READ_EPOCHS = 10_000  # number of epochs that are read at once, so that memory does not grow with the campaign


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportion:
    """Number of successes in a number of trials, and the confidence interval of the probability of a success."""

    successes: int
    trials: int
    low: float  # lower end of the confidence interval
    high: float  # upper end of the confidence interval
    confidence: float  # confidence of the interval, such as 0.95

    @property
    def value(self) -> float:
        """Estimate of the probability of a success; NaN without trials."""
        return self.successes / self.trials if self.trials else float("nan")


def binomial_intervals(
    successes: Int[np.ndarray, " n"], trials: Int[np.ndarray, " n"] | int, *, confidence: float = CONFIDENCE
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the lower and upper ends of the intervals of `binomial_interval` for arrays of counts."""
    tail, rest = (1 - confidence) / 2, trials - successes
    low = np.where(successes > 0, betaincinv(np.maximum(successes, 1), rest + 1, tail), 0.0)
    high = np.where(rest > 0, betaincinv(successes + 1, np.maximum(rest, 1), 1 - tail), 1.0)
    return low, high


def binomial_interval(successes: int, trials: int, *, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return the exact confidence interval of a probability after `successes` in `trials`.

    If the true probability is a lower end above 0, a count of at least `successes` has the probability
    (1 − confidence)/2. If the true probability is an upper end below 1, a count of at most `successes` has the
    probability (1 − confidence)/2. Without successes the lower end is 0, and without failures the upper end is 1. The
    interval contains the true probability with at least the given confidence. Without trials the interval is (0, 1).

    The function raises `ValueError` unless 0 ≤ successes ≤ trials and 0 < confidence < 1.
    """
    _check_counts(successes, trials)
    if not 0 < confidence < 1:
        raise ValueError(f"confidence {confidence} is not between 0 and 1")
    low, high = binomial_intervals(np.array([successes]), trials, confidence=confidence)
    return float(low[0]), float(high[0])


def binomial_test(successes: int, trials: int, probability: float) -> float:
    """Return the two-sided p-value of `successes` in `trials` if the true probability is `probability`.

    The p-value is twice the smaller tail of the binomial distribution, and at most 1.

    The function raises `ValueError` unless 0 ≤ successes ≤ trials and 0 ≤ probability ≤ 1.
    """
    _check_counts(successes, trials)
    if not 0 <= probability <= 1:
        raise ValueError(f"probability {probability} is not between 0 and 1")
    # P(K ≥ k) = I_p(k, n − k + 1) and P(K ≤ k) = 1 − I_p(k + 1, n − k)
    at_least = float(betainc(successes, trials - successes + 1, probability)) if successes > 0 else 1.0
    at_most = float(betaincc(successes + 1, trials - successes, probability)) if successes < trials else 1.0
    return min(1.0, 2 * min(at_least, at_most))


def proportion(successes: int, trials: int) -> Proportion:
    """Return the proportion of `successes` in `trials`, with the exact confidence interval of the probability."""
    low, high = binomial_interval(successes, trials)
    return Proportion(successes=successes, trials=trials, low=low, high=high, confidence=CONFIDENCE)


def count_interval(count: float) -> tuple[float, float, float]:
    """Return a Poisson count, and the lower and upper ends of the exact confidence interval of its mean."""
    tail = (1 - CONFIDENCE) / 2
    low = float(chdtri(2 * count, 1 - tail)) / 2 if count else 0.0
    return float(count), low, float(chdtri(2 * count + 2, tail)) / 2


def enough(successes: int, trials: int, wished_width: float) -> bool:
    """Return whether the confidence interval after `successes` in `trials` is at most `wished_width` wide.

    A campaign of a sweep stops when the function returns True. Call the function after each chunk in the order of the
    chunks. Leave out all chunks after the first chunk for which the function returns True. With this procedure the
    result does not depend on the number of workers. The width of the interval depends on the estimate. With the same
    `wished_width`, the campaign stops slightly earlier if the estimate is nearer to 0 or 1 than the true probability.
    The confidence of the interval is therefore only nominal.

    The function raises `ValueError` unless 0 ≤ successes ≤ trials and wished_width > 0.
    """
    if not wished_width > 0:
        raise ValueError(f"a width of {wished_width} is never reached")
    low, high = binomial_interval(successes, trials)
    return high - low <= wished_width


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Statistics of one detector in a campaign."""

    detector: str
    epochs: int
    # proportion of detections among all decisions (correlated epochs × satellites). With a signal, this proportion
    # estimates the probability of detection. Without a signal, this proportion estimates the probability of a false
    # alarm.
    detections: Proportion
    misses: int  # number of decisions without a detection
    cluster: Proportion  # proportion of detections with a range offset in `cluster_m`
    cluster_m: tuple[float, float]  # limits of the cluster in m; both limits belong to the cluster
    range_offset_mean_m: float  # mean range offset of the detections; NaN without detections
    range_offset_std_m: float  # standard deviation of the range offsets; NaN without detections
    percentiles_m: dict[float, float]  # percentiles of the range offset in m, interpolated linearly between detections


def detectors_of(results: xarray.Dataset) -> tuple[str, ...]:
    """Return the names of the detectors that the results of a campaign have."""
    return tuple(str(name) for name in results["detector"].values)


def summarise(results: xarray.Dataset, detector: str = "early") -> Summary:
    """Return statistics of the detections, misses and range offsets of one detector.

    A satellite does not count at epochs with NaN as `noise_power`, because the satellite was not correlated at these
    epochs.

    The function raises `ValueError` if the results do not have this detector.
    """
    if detector not in (names := detectors_of(results)):
        raise ValueError(f"detector: found {detector!r}, expected one of {list(names)}")
    place = names.index(detector)
    decisions, offsets = 0, []
    for block in _blocks(results[["tap_index", "range_offset_m", "noise_power"]]):
        correlated = ~np.isnan(block["noise_power"].values)
        detected = (block["tap_index"].values[place] >= 0) & correlated
        decisions += int(np.count_nonzero(correlated))
        offsets.append(block["range_offset_m"].values[place][detected])
    offset_m: Float[np.ndarray, " n"] = np.concatenate(offsets or [np.zeros(0)]).astype(np.float64)
    detections = offset_m.size
    in_cluster = int(np.count_nonzero((offset_m >= CLUSTER_M[0]) & (offset_m <= CLUSTER_M[1])))
    at = np.percentile(offset_m, PERCENTILES) if detections else np.full(len(PERCENTILES), np.nan)
    return Summary(
        detector=detector,
        epochs=results.sizes["epoch"],
        detections=proportion(detections, decisions),
        misses=decisions - detections,
        cluster=proportion(in_cluster, detections),
        cluster_m=CLUSTER_M,
        range_offset_mean_m=float(offset_m.mean()) if detections else float("nan"),
        range_offset_std_m=float(offset_m.std()) if detections else float("nan"),
        percentiles_m=dict(zip(PERCENTILES, at.tolist(), strict=True)),
    )


def false_alarms(results: xarray.Dataset, processor: AcasProcessor) -> Proportion:
    """Return the proportion of correlators with noise only that exceed the threshold of the processor.

    Only correlators more than a chip apart are counted, so that the trials are independent. The correlation between the
    noise of two correlators is a triangle function of their distance, and is zero beyond one chip. A narrow filter
    makes the triangle slightly wider. If there is a signal, only correlators more than a chip before the line of sight
    and before any spoofing signal with true chips are counted. Reflections arrive later, so these correlators contain
    noise only.
    """
    apart = E6_CHIP_M / float(np.min(np.diff(results["tap_offset_m"].values)))
    independent = results.isel(tap=slice(None, None, int(np.floor(apart)) + 1))
    offset_m = independent["tap_offset_m"].values
    exceeding = trials = 0
    for block in _blocks(independent):
        taps, noise_power = block["taps"].values.astype(np.complex128), block["noise_power"].values.astype(np.float64)
        if results.attrs["signal"]:
            taps = np.where(offset_m < _first_arrival_m(block)[..., None] - E6_CHIP_M, taps, np.nan)
        banks = BankBlock(
            offsets_m=offset_m, taps=taps, noise_power=noise_power, integration_s=np.full(noise_power.shape, np.nan)
        )
        exceeding += int(np.count_nonzero(processor.exceeds_threshold(banks)))
        trials += int(np.count_nonzero(~np.isnan(taps) & (noise_power > 0)[..., None]))
    return proportion(exceeding, trials)


# Terms of the error of the predicted E6 range, with their signs. A positive error means that E6 arrives later than
# predicted.
_LATE = (("iono_diff", 1), ("bias", 1), ("e1_noise", -1), ("e1_multipath", -1))


def _first_arrival_m(block: xarray.Dataset) -> Float[np.ndarray, "epochs satellites"]:
    """Return the delay in m of the earliest signal on E6 with true chips, relative to the predicted E6 range."""
    if "truth_spoofer_offset_m" not in block:
        return np.sum([sign * block[f"truth_{name}_m"].values for name, sign in _LATE], axis=0)
    forged = block["forged"].values[:, None, None]
    power_db, offset_m = (
        block[name].transpose("attack", "epoch", "satellite").values
        for name in ("truth_spoofer_power_db", "truth_spoofer_offset_m")
    )
    first_m = np.where((power_db > -np.inf) & ~forged, offset_m, 0.0).min(axis=0)
    error_m: Float[np.ndarray, "epochs satellites"] = block["truth_prediction_error_m"].values
    return error_m + np.minimum(first_m, 0.0)


def _blocks(results: xarray.Dataset) -> Iterator[xarray.Dataset]:
    for first in range(0, results.sizes["epoch"], READ_EPOCHS):
        yield results.isel(epoch=slice(first, first + READ_EPOCHS))


def _check_counts(successes: int, trials: int) -> None:
    if not 0 <= successes <= trials:
        raise ValueError(f"found {successes} successes in {trials} trials, expected 0 to {trials}")
