"""Distinguish two simultaneous signals from one signal that jumps to another code phase.

Theory of operation
-------------------
If a recorder loses samples, every signal jumps to another code phase. `search_e1` adds up to 24 periods and finds two
peaks, as under spoofing. But the two peaks of a jump are never present at the same time. So for two peaks of a
satellite the power of every single period is measured at both code phases. If the noise has variance 1 per dimension,
the power of noise alone is chi-squared with 2 · components degrees of freedom. While the signal is present, the
distribution has the non-centrality λ. Each peak may be present in all periods, only before some period k, or only from
period k on. The mean power of the peak in the periods in which the peak is present gives λ. The most likely pattern is
chosen. If one peak is present before k and the other peak from k on, the peaks belong to one signal. The stronger peak
then represents this signal.

If a second signal appears or ends while the first signal stays, there are two signals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64
from scipy import special

from vestige.constants import E1_CODE_PERIOD_S
from vestige.records import SampleBatch
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.period_taps import period_taps
from vestige.signals.definitions import SignalDefinition

_MIN_PERIODS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Jump:
    """Jump of a signal to another code phase.

    Attributes
    ----------
    at_s
        Time of the jump in s after the first sample, with an error of up to one code period (4 ms).
    by_s
        Increase of the delay in s, known modulo 4 ms and stated from −0.002 to 0.002. Missing samples reduce the delay.
    """

    svid: int
    at_s: float
    by_s: float


def find_jump(
    batch: SampleBatch, one: Acquisition, other: Acquisition, signals: tuple[SignalDefinition, ...], periods: int
) -> Jump | None:
    """Return the jump between two peaks of one signal; None for two signals, or with fewer than 3 periods.

    Parameters
    ----------
    batch
        E1 samples in which both peaks were found.
    signals, periods
        Components whose powers are added, and the largest number of code periods.
    """
    powers = [_powers(batch, found, signals)[:periods] for found in (one, other)]
    n = min(power.size for power in powers)
    if n < _MIN_PERIODS:
        return None
    _, jump_at, one_first = max(
        (
            sum(_log_likelihood(power[:n], on, 2 * len(signals)) for power, on in zip(powers, pair, strict=True)),
            k,
            first,
        )
        for pair, k, first in _patterns(n)
    )
    if jump_at == 0:
        return None
    before, after = (one, other) if one_first else (other, one)
    by_s = (after.code_start_s - before.code_start_s + E1_CODE_PERIOD_S / 2) % E1_CODE_PERIOD_S - E1_CODE_PERIOD_S / 2
    return Jump(svid=one.svid, at_s=before.code_start_s + jump_at * E1_CODE_PERIOD_S, by_s=by_s)


def _patterns(n: int) -> Iterator[tuple[tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]], int, bool]]:
    """Yield the periods in which each of two peaks is present, the period of a jump or 0, and a flag.

    The flag is True if there is a jump from the first peak to the second peak.
    """
    always = np.ones(n, bool)
    yield (always, always), 0, False
    for k in range(1, n):
        before = np.arange(n) < k
        for part in (before, ~before):
            yield (always, part), 0, False
            yield (part, always), 0, False
            yield (part, ~part), k, bool(part[0])


def _log_likelihood(power: Float64[np.ndarray, " n"], on: Bool[np.ndarray, " n"], freedom: int) -> float:
    """Return the log-likelihood ratio of powers: a signal in the periods where `on` is true, against noise alone.

    The likelihood ratio is the density of the non-central chi-squared distribution over the density of the central
    distribution.
    """
    x = power[on]
    shift = max(float(np.mean(x)) - freedom, 1e-6)
    root = np.sqrt(shift * x)
    order = freedom / 2 - 1
    bessel = np.log(special.ive(order, root)) + root
    return float(np.sum(bessel - order * np.log(root / 2) + special.gammaln(order + 1) - shift / 2))


def _powers(
    batch: SampleBatch, found: Acquisition, signals: tuple[SignalDefinition, ...]
) -> Float64[np.ndarray, " periods"]:
    """Return the power of every code period at a signal's peak, in units of the noise variance per dimension."""
    rows = []
    for signal in signals:
        taps, noise = period_taps(batch, signal, found.svid, found.code_start_s, found.doppler_hz)
        rows.append(np.abs(taps) ** 2 / max(noise / 2, np.finfo(np.float64).tiny))
    total = np.sum([row[: min(len(row) for row in rows)] for row in rows], axis=0)
    return np.maximum(total[:, np.argmax(np.sum(total, axis=0))], 1e-9)
