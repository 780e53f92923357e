"""Detect replayed E1-B symbols from correlations over the beginnings of the symbols.

An attacker who replays E1-B without delay has to estimate each unpredictable symbol while the symbol arrives. So the
beginning of a symbol is wrong more often than the rest of the symbol [SECO-GRANADOS20]. For the tests, a receiver that
tracks E1-B correlates the beginning and the rest of each symbol. The receiver removes the sign of the decoded symbol
from the correlations, and compares the beginnings with one of two references.

**The later parts of the same symbols** (`symbol_replay_test`). Let the signal have the amplitude 1 and C/N0 = c. The
mean over a part of w seconds then has noise of variance 1/(2 c w) per dimension. Let first_k and later_k be the mean
correlations over the two parts of the symbol b_k, with the carrier in phase. For n unpredictable symbols the test uses

    d_k = b_k Re(later_k − first_k)        T = √n mean(d) / std(d)

Without an attack d_k is Gaussian with mean 0. So T has Student's distribution with n − 1 degrees of freedom, for any
C/N0 and signal strength. The test raises an alarm if T > t, where P(T > t) = P_fa. A narrow filter of the front end
affects the first chips of a symbol differently from the average chip. With such a filter the mean of d_k is not 0, and
the threshold is not exact.

**The beginnings of predictable symbols** (`predictable_reference_test`). The attacker knows predictable symbols before
they arrive, so their beginnings are as strong as the rest. A filter has the same effect on predictable and
unpredictable symbols, so the effect of the filter cancels. `vestige.theory.scer.partial_correlations` has the metrics
of this test, the thresholds, and the detection probabilities of both tests.

**Unpredictable symbols** are symbols that nobody can know before reception. A symbol that an attacker can know before
reception is predictable. `unpredictable_symbols` marks the 32 unpredictable symbols among the 500 symbols of an I/NAV
page. An OSNMA subframe of 30 s has at most 480 unpredictable symbols.

**Limit of the tests**: the tests cannot detect a spoofing signal whose delay gives the attacker enough time to learn a
symbol. Tests of the beginnings of chips are not possible for E6-C. The attacker estimates a whole chip of 195 ns and
transmits the estimate when the chip is over. So all parts of a transmitted chip are equally good.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Complex128, Float, Int64
from scipy.special import stdtrit

from vestige.navigation.inav.coding.channel_coding import page_symbols
from vestige.navigation.inav.page import OSNMA_BYTES, encode_page
from vestige.records import SampleBatch
from vestige.sample_processor.tracking.channel import TrackedPeriods
from vestige.sample_processor.tracking.correlator_bank_kernel import bank_replicas, bank_vectors, correlate_part
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C
from vestige.theory.scer.partial_correlations import FIRST_CHIPS, ReferenceMetric, metric_threshold, metric_value

MIN_SYMBOLS = 10  # smallest number of symbols in a test; fewer symbols do not give a reliable standard deviation


@dataclass(frozen=True, slots=True, eq=False)
class PartialPrompts:
    """Mean correlations over the beginnings of E1-B symbols and over the rest of these symbols, for n code periods.

    Attributes
    ----------
    numbers
        Numbers of the code periods, counted by the channel.
    first, later
        Correlation over the first chips of the period, and over the rest of the period. Each correlation is divided by
        the number of its samples.
    """

    numbers: Int64[np.ndarray, " n"]
    first: Complex128[np.ndarray, " n"]
    later: Complex128[np.ndarray, " n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SymbolReplayTest:
    """Result of a test for replayed symbols; the test fails if `statistic` exceeds `threshold`.

    `n_symbols` is the number of all symbols in `symbol_replay_test`, and of unpredictable symbols in
    `predictable_reference_test`.
    """

    statistic: float
    threshold: float
    n_symbols: int

    @property
    def failed(self) -> bool:
        """Whether the beginnings of the symbols are too weak for a signal without replay."""
        return self.statistic > self.threshold


def partial_prompts(
    batch: SampleBatch, tracked: TrackedPeriods, svid: int, *, first_chips: int = FIRST_CHIPS
) -> PartialPrompts:
    """Correlate the beginnings and the rest of the E1-B symbols that a channel has tracked.

    Parameters
    ----------
    batch
        Samples of E1.
    tracked
        Code periods of a channel; the locked periods that lie completely in the samples are used.
    svid
        SVID of the satellite of the channel.
    first_chips
        Length of the first part in chips, 1 to 4091.

    Raises
    ------
    ValueError
        If one of the parts is empty.
    """
    if not 1 <= first_chips < E1B.code_length:
        raise ValueError(f"the first part has 1 to {E1B.code_length - 1} chips, found {first_chips}")
    x = np.ascontiguousarray(batch.samples).view(np.float32)
    replicas = bank_replicas(primary_code(E1C, svid), primary_code(E1B, svid))
    lags, bank = np.zeros(1, np.int64), np.zeros(1, np.complex128)
    starts, slots = bank_vectors(lags)
    numbers, parts = [], []
    for one in tracked.periods[tracked.periods["locked"]]:
        phase, rate = float(one["code_phase"]), float(one["code_rate"])
        begin = int(one["first_sample"]) - batch.first_sample
        middle = begin + int(np.ceil((first_chips - phase) / rate))
        end = begin + int(np.ceil((E1B.code_length - phase) / rate))
        if begin < 0 or end > batch.samples.size:
            continue
        both = [
            correlate_part(
                x[2 * start : 2 * stop],
                replicas,
                2 * (phase + (start - begin) * rate),
                2 * rate,
                float(one["carrier_cycles"]) + (start - begin) * float(one["carrier_step"]),
                float(one["carrier_step"]),
                lags,
                starts,
                slots,
                bank,
            )
            / (stop - start)
            for start, stop in ((begin, middle), (middle, end))
        ]
        numbers.append(int(one["number"]))
        parts.append(both)
    found = np.array(parts, np.complex128).reshape(-1, 2)
    return PartialPrompts(np.array(numbers, np.int64), found[:, 0], found[:, 1])


def replay_threshold(n_symbols: int, p_fa: float) -> float:
    """Return the threshold t of `symbol_replay_test`, with P(T > t) = p_fa for n symbols of an authentic signal.

    Examples
    --------
    >>> round(replay_threshold(1000, 1e-3), 2)
    3.1
    """
    return float(-stdtrit(n_symbols - 1, p_fa))


def symbol_replay_test(
    first: Complex128[np.ndarray, " n"],
    later: Complex128[np.ndarray, " n"],
    symbols: Float[np.ndarray, " n"] | None = None,
    *,
    p_fa: float = 1e-6,
) -> SymbolReplayTest:
    """Test whether the beginnings of E1-B symbols are weaker than the rest of these symbols.

    Parameters
    ----------
    first, later
        Mean correlations of the two parts of each symbol, with the carrier in phase (`PartialPrompts`).
    symbols
        Symbols of ±1 from a page with a good checksum; a wrong sign of all symbols together does not matter. If
        `symbols` is None, the test uses the sign of the later part of each symbol. This sign is reliable if the C/N0 of
        E1-B is 33 dBHz or more.
    p_fa
        False-alarm probability.

    Raises
    ------
    ValueError
        If there are fewer than `MIN_SYMBOLS` symbols.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> later = rng.choice([-1.0, 1.0], 500) + 0j
    >>> noise = 0.8 * rng.standard_normal(500)
    >>> symbol_replay_test(later + noise, later).failed
    False
    >>> symbol_replay_test(0.7 * later + noise, later).failed
    True
    """
    if first.size < MIN_SYMBOLS:
        raise ValueError(f"a test of replayed symbols needs {MIN_SYMBOLS} symbols or more, found {first.size}")
    missing = _signs(later, symbols) * (later - first).real
    statistic = np.sqrt(missing.size) * np.mean(missing) / np.std(missing, ddof=1)
    return SymbolReplayTest(
        statistic=float(statistic), threshold=replay_threshold(missing.size, p_fa), n_symbols=missing.size
    )


def predictable_reference_test(
    first: Complex128[np.ndarray, " n"],
    later: Complex128[np.ndarray, " n"],
    unpredictable: Bool[np.ndarray, " n"],
    symbols: Float[np.ndarray, " n"] | None = None,
    *,
    metric: ReferenceMetric = "real",
    p_fa: float = 1e-6,
) -> SymbolReplayTest:
    """Test whether the beginnings of unpredictable E1-B symbols are weaker than the beginnings of predictable symbols.

    Parameters
    ----------
    first, later, symbols
        Correlations and symbols as in `symbol_replay_test`, for predictable and unpredictable symbols. The later parts
        give the amplitude of the signal, on which the thresholds of `magnitudes` and `ratio` depend.
    unpredictable
        Mask of the symbols that nobody can predict.
    metric
        Comparison of the mean first part of the unpredictable symbols with the mean first part of the predictable
        symbols. `real` and `distance` have exact thresholds. `real` needs a carrier in phase. `distance`, `magnitudes`
        and `ratio` use magnitudes, which do not depend on the carrier's phase.
    p_fa
        False-alarm probability, below 0.5.

    Raises
    ------
    ValueError
        If there are fewer than `MIN_SYMBOLS` predictable or unpredictable symbols, `p_fa` is not between 0 and 0.5, or
        `metric` is unknown.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> later, unpredictable = rng.choice([-1.0, 1.0], 2000) + 0j, np.arange(2000) < 500
    >>> noise = 0.8 * (rng.standard_normal(2000) + 1j * rng.standard_normal(2000))
    >>> predictable_reference_test(0.9 * later + noise, later, unpredictable).failed
    False
    >>> predictable_reference_test((0.9 - 0.3 * unpredictable) * later + noise, later, unpredictable).failed
    True
    """
    signs = _signs(later, symbols)
    kinds = [(signs * first)[unpredictable], (signs * first)[~unpredictable]]
    n_u, n_p = (kind.size for kind in kinds)
    if min(n_u, n_p) < MIN_SYMBOLS:
        found = f"{n_u} unpredictable and {n_p} predictable symbols"
        raise ValueError(f"a test of replayed symbols needs {MIN_SYMBOLS} symbols or more of each kind, found {found}")
    squares = sum(float(np.sum(np.square(kind.real - np.mean(kind.real)))) for kind in kinds)
    noise = float(np.sqrt(squares / (n_u + n_p - 2)))
    amplitude = float(np.mean(signs * later.real)) / noise
    statistic = metric_value(complex(np.mean(kinds[0])), complex(np.mean(kinds[1])), noise, n_u, n_p, metric)
    threshold = metric_threshold(n_u, n_p, p_fa, amplitude, metric)
    return SymbolReplayTest(statistic=statistic, threshold=threshold, n_symbols=n_u)


def _signs(later: Complex128[np.ndarray, " n"], symbols: Float[np.ndarray, " n"] | None) -> Float[np.ndarray, " n"]:
    """Return the symbols with a sign that agrees with the later parts; without symbols, the sign of each later part."""
    return np.sign(later.real) if symbols is None else symbols * np.sign(np.sum(symbols * later.real))


@cache
def unpredictable_symbols() -> Bool[np.ndarray, " 500"]:
    """Return which symbols of an I/NAV page nobody can predict, in the order of transmission.

    The 32 bits of a page's MACK message are taken as unknown, and all other bits as known. The code and the checksum
    are linear. So every symbol that depends on unknown bits is a sum of some of these bits and of known bits. A symbol
    may follow from sums of earlier symbols. An attacker who has received the earlier symbols then knows the later
    symbol. So there are as many unpredictable symbols as unknown bits. From earlier subframes an attacker can predict
    some bits of the MACK message, such as parts of the header of a tag. So the true number of unpredictable symbols is
    smaller.

    Examples
    --------
    >>> found = unpredictable_symbols()
    >>> int(found.sum()), int(np.flatnonzero(found)[0])
    (32, 267)
    """
    plain = page_symbols(encode_page(0))
    depends = [page_symbols(encode_page(0, osnma=(1 << bit).to_bytes(OSNMA_BYTES, "big"))) ^ plain for bit in range(32)]
    basis: dict[int, int] = {}  # sums of unknown bits that the attacker has learned, by their highest bit
    found = np.zeros(plain.size, np.bool_)
    for place, column in enumerate(np.array(depends).T):
        rest = sum(int(one) << bit for bit, one in enumerate(column))
        while rest and rest.bit_length() in basis:
            rest ^= basis[rest.bit_length()]
        if rest:
            basis[rest.bit_length()] = rest
            found[place] = True
    return found
