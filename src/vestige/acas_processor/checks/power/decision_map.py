"""Compute decision regions of the (power, distortion) plane from simulated signals, and classify signals.

Theory of operation
-------------------
A signal belongs to one of four classes. Each class is a distribution of second signals or jammers [WESSON18].
`power_distortion.py` defines the symbols:

    clean       none
    multipath   one reflection: Rayleigh amplitude, exponential delay, on the tracked satellite only, no rise of power
    spoofed     η uniform in dB and Δτ uniform, on all satellites
    jammed      J/N uniform in dB

`simulate` draws (ΔP, D) for one class, with the closed forms of `power_distortion.py`. No samples are needed. Smoothed
histograms of many draws estimate the densities p(ΔP, D | class). Each cell with draws has the class of least expected
cost, and a cell without draws has the class of a neighbour. A false alarm costs `alarm_cost` times as much as a miss. A
larger `alarm_cost` gives fewer false alarms and more misses.

A map is valid for one C/N0 of the tracked satellite, because D grows with C/N0. The 64 maps that were used last are
kept in memory.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Int8, Int64

from vestige.acas_processor.checks.check import series_of
from vestige.acas_processor.checks.power.power_distortion import distortion_variance, mean_distortion, power_rise_db
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records.checks import CheckName, CheckSeries, SignalClass
from vestige.signals.pulse import BPSK, Pulse
from vestige.streams import stream


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypotheses:
    """Parameters of the receiver and of the four classes of signal: clean, multipath, spoofed and jammed."""

    cn0_dbhz: float = 45.0  # C/N0 of the tracked satellite without interference
    sky_cn0_dbhz: float = 45.0  # mean C/N0 of all satellites in the band
    integration_s: float = 0.1  # T, integration time of the taps
    half_spacing_chips: float = 0.15  # τ_d, distance of the early and the late tap from the prompt
    pulse: Pulse = BPSK  # pulse of the replica
    chip_rate_hz: float = 1.023e6  # chip rate of the replica
    bandwidth_hz: float = 2e6  # W, bandwidth of the power measurement
    n_satellites: int = 10  # number of satellites in the band
    sigma_power_db: float = 0.4  # standard deviation of ΔP that drifts of the front end cause
    ray_power_db: float = -16.0  # mean power of the reflection over the power of the direct signal
    ray_mean_excess_m: float = 40.0  # mean excess delay of the reflection
    spoofer_advantage_db: tuple[float, float] = (-1.0, 10.0)  # smallest and largest η
    spoofer_offset_chips: float = 1.0  # largest |Δτ|
    jam_to_noise_db: tuple[float, float] = (3.0, 20.0)  # smallest and largest J/N

    @property
    def signals_to_noise(self) -> float:
        """r, power of all satellites in the band over the power of the noise."""
        return self.n_satellites * 10 ** (self.sky_cn0_dbhz / 10) / self.bandwidth_hz

    def simulate(
        self, truth: SignalClass, rng: np.random.Generator, n: int
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return n random pairs of ΔP in dB and D in σ for a signal of the class `truth`."""
        zero = np.zeros(1)  # value that all draws share
        eta, offset, jam = zero, zero, zero
        if truth is SignalClass.MULTIPATH:
            eta = rng.standard_exponential(n) * 10 ** (self.ray_power_db / 10)
            offset = rng.standard_exponential(n) * self.ray_mean_excess_m * self.chip_rate_hz / SPEED_OF_LIGHT_MPS
        elif truth is SignalClass.SPOOFED:
            eta = 10 ** (rng.uniform(*self.spoofer_advantage_db, n) / 10)
            offset = rng.uniform(-self.spoofer_offset_chips, self.spoofer_offset_chips, n)
        elif truth is SignalClass.JAMMED:
            jam = 10 ** (rng.uniform(*self.jam_to_noise_db, n) / 10)
        # A reflection exists on one satellite only, so the power that it adds to the band is neglected.
        everywhere = eta if truth is SignalClass.SPOOFED else zero
        rise_db = power_rise_db(everywhere, jam, signals_to_noise=self.signals_to_noise)
        mean = zero
        if eta is not zero:
            amplitude = np.sqrt(2 * 10 ** (self.cn0_dbhz / 10) * self.integration_s * eta)
            mean = amplitude * mean_distortion(offset, self.half_spacing_chips, self.pulse)
        spread = np.sqrt(distortion_variance(self.half_spacing_chips, self.pulse) * (1 + jam))
        in_phase, quadrature = mean + spread * rng.standard_normal(n), spread * rng.standard_normal(n)
        measured_db = rise_db + self.sigma_power_db * rng.standard_normal(n)
        return measured_db, np.sqrt(in_phase**2 + quadrature**2) * 10 ** (-rise_db / 20)


_POWER_DB = (-3.0, 25.0, 0.25)  # first edge, last edge and step of the cells, in dB
_DISTORTION = (0.0, 7.0, 0.07)  # first edge, last edge and step of the cells, in ln(1 + D)
_SMOOTHING_CELLS = 1.0  # standard deviation of the smoothing, in cells
_SECOND_SIGNAL = (SignalClass.MULTIPATH, SignalClass.SPOOFED)  # classes in which D depends on C/N0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DecisionMap:
    """Decision map of the power–distortion plane: the `SignalClass` of each cell."""

    # edges of the cells; values beyond the edges belong to the outermost cells
    power_edges_db: Float[np.ndarray, " k"]
    distortion_edges: Float[np.ndarray, " l"]
    classes: Int8[np.ndarray, "a b"]  # `SignalClass` of each cell

    def classify(
        self, power_rise_db: Float[np.ndarray, " n"], distortion: Float[np.ndarray, " n"]
    ) -> Int8[np.ndarray, " n"]:
        """Return the `SignalClass` of each pair of ΔP and D."""
        row = np.searchsorted(self.power_edges_db, power_rise_db) - 1
        column = np.searchsorted(self.distortion_edges, distortion) - 1
        a, b = self.classes.shape
        return self.classes[np.clip(row, 0, a - 1), np.clip(column, 0, b - 1)]


@lru_cache(maxsize=64)
def simulated_decision_map(
    hypotheses: Hypotheses, *, alarm_cost: float = 1.0, seed: int = 0, draws: int = 400_000
) -> DecisionMap:
    """Return the decision map that has the least expected cost if all four classes of signal are equally likely.

    A false alarm (clean or multipath classified as an attack) costs `alarm_cost`, and every other error costs 1.
    `draws` is the number of draws for each class. Calls with equal arguments return equal maps.
    """
    edges = tuple(
        np.arange(round((last - first) / step) + 1) * step + first for first, last, step in (_POWER_DB, _DISTORTION)
    )
    without_cn0 = replace(hypotheses, cn0_dbhz=0.0)  # without a second signal, no draw depends on the C/N0
    densities = [
        _density(hypotheses if truth in _SECOND_SIGNAL else without_cn0, truth, seed, draws) for truth in SignalClass
    ]
    likelihood = np.stack(densities)
    cost = 1.0 - np.eye(len(SignalClass))  # cost of each decision (columns) for each true class (rows)
    cost[: SignalClass.SPOOFED, SignalClass.SPOOFED :] = alarm_cost
    expected = np.einsum("tpd,tc->cpd", likelihood, cost)
    classes = np.argmin(expected, axis=0)
    classes = _filled(classes, likelihood.sum(axis=0) > 1e-12)
    return DecisionMap(power_edges_db=edges[0], distortion_edges=np.expm1(edges[1]), classes=classes.astype(np.int8))


@lru_cache(maxsize=64)
def _density(hypotheses: Hypotheses, truth: SignalClass, seed: int, draws: int) -> Float[np.ndarray, "a b"]:
    """Return the smoothed share of the draws of one class that lie in each cell."""
    from scipy.ndimage import gaussian_filter  # noqa: PLC0415  (loads slowly, and few runs make a map)

    rise_db, distortion = hypotheses.simulate(truth, stream(seed, "decision map", truth.name), draws)
    counts = _counts(rise_db, np.log1p(distortion))
    return np.asarray(gaussian_filter(counts / draws, _SMOOTHING_CELLS, mode="reflect", truncate=4.0))


def _counts(power_db: Float[np.ndarray, " n"], distortion: Float[np.ndarray, " n"]) -> Int64[np.ndarray, "a b"]:
    """Return the number of pairs in each cell. All cells have the same size, so a division finds the cell of a pair."""
    cells, shape = np.zeros(power_db.size, np.int64), []
    for value, (first, last, step) in ((power_db, _POWER_DB), (distortion, _DISTORTION)):
        shape.append(round((last - first) / step))
        cells = cells * shape[-1] + np.clip((value - first) * (1 / step), 0, shape[-1] - 1).astype(np.int64)
    return np.bincount(cells, minlength=shape[0] * shape[1]).reshape(shape)


def _filled(classes: Int[np.ndarray, "a b"], drawn: Bool[np.ndarray, "a b"]) -> Int[np.ndarray, "a b"]:
    """Return the class of every cell; a cell without draws takes the class of a neighbour.

    The neighbour with less power comes first, then the neighbour with less distortion. So an attack beyond the
    simulated range gets the class at the end of that range.
    """
    classes, drawn = classes.copy(), drawn.copy()
    low, high = slice(None, -1), slice(1, None)
    every = slice(None)
    moves = [((low, every), (high, every)), ((every, low), (every, high))]
    moves += [(to, source) for source, to in moves]
    while not drawn.all():
        for source, to in moves:
            known = drawn[source] & ~drawn[to]
            classes[to] = np.where(known, classes[source], classes[to])
            drawn[to] |= known
    return classes


def confusion(decisions: DecisionMap, hypotheses: Hypotheses, *, seed: int, draws: int) -> Int64[np.ndarray, "4 4"]:
    """Return the confusion matrix: how often a true class (rows) is classified as each class (columns).

    The draws are independent of the draws of the map. `hypotheses` may differ from the parameters of the map. `draws`
    is the number of draws of each class.
    """
    rows = []
    for truth in SignalClass:
        rng = stream(seed, "held apart", truth.name)
        rows.append(
            np.bincount(decisions.classify(*hypotheses.simulate(truth, rng, draws)), minlength=len(SignalClass))
        )
    return np.stack(rows).astype(np.int64)


class PowerAndDistortion(NamedTuple):
    """ΔP of the band in dB, D in σ, and the C/N0 of the map in use; NaN where a value is unknown."""

    map_dbhz: Float[np.ndarray, "n m"]
    rise_db: Float[np.ndarray, "n m"]
    distortion: Float[np.ndarray, "n m"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerDistortionMonitor:
    """Monitor that classifies power and distortion of a satellite: clean, multipath, spoofed or jammed.

    The statistic is the `SignalClass`. The threshold is MULTIPATH, so multipath is no alarm.
    """

    name: ClassVar = CheckName.POWER_DISTORTION
    unit: ClassVar = "class"
    # parameters of the map; the expected C/N0, rounded to a multiple of `cn0_step_db`, replaces `hypotheses.cn0_dbhz`
    hypotheses: Hypotheses = field(default_factory=Hypotheses)
    alarm_cost: float = 10.0  # cost of a false alarm over the cost of a miss
    cn0_step_db: float = 3.0  # step of C/N0 from one map to the next, in dB
    # published false-alarm probability [WESSON18]; the unit tests confirm this value for clean and multipath
    p_fa: float = 0.006

    def map_for(self, expected_cn0_dbhz: float) -> DecisionMap:
        """Return the decision map for a satellite with the given expected C/N0."""
        rounded = round(expected_cn0_dbhz / self.cn0_step_db) * self.cn0_step_db
        return simulated_decision_map(replace(self.hypotheses, cn0_dbhz=rounded), alarm_cost=self.alarm_cost)

    def probability_of_detection(
        self, eta_db: Float[np.ndarray, " k"], expected_cn0_dbhz: float, *, seed: int = 0, draws: int = 20_000
    ) -> Float[np.ndarray, " k"]:
        """Return, for each advantage η, the share of `draws` simulated spoofers that is classified as an attack."""
        decisions, rates = self.map_for(expected_cn0_dbhz), []
        for eta in eta_db.tolist():
            strength = replace(self.hypotheses, cn0_dbhz=expected_cn0_dbhz, spoofer_advantage_db=(eta, eta))
            rng = stream(seed, "detection curve", repr(eta))
            found = decisions.classify(*strength.simulate(SignalClass.SPOOFED, rng, draws))
            rates.append(np.count_nonzero(found >= SignalClass.SPOOFED) / draws)
        return np.array(rates)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block: a class where power, distortion and expected C/N0 are known."""
        measured = self.measured(evidence)
        statistic = np.full(evidence.shape, np.nan)
        known = np.isfinite(measured.map_dbhz) & np.isfinite(measured.distortion) & np.isfinite(measured.rise_db)
        for cn0_dbhz in np.unique(measured.map_dbhz[known]).tolist():
            here = known & (measured.map_dbhz == cn0_dbhz)
            statistic[here] = self.map_for(cn0_dbhz).classify(measured.rise_db[here], measured.distortion[here])

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if evidence.measured.snapshots.e1.taps is None:
                return "E1 was not tracked between the last two RECS"
            if np.isnan(statistic[here]):
                return "received power, E1 correlators or expected C/N0 are not known"
            name = SignalClass(int(statistic[here])).name.lower()
            return f"power {measured.rise_db[here]:+.1f} dB, distortion {measured.distortion[here]:.1f} sigma: {name}"

        return series_of(self, statistic, np.full(evidence.shape, float(SignalClass.MULTIPATH)), explain)

    def measured(self, evidence: Evidence) -> PowerAndDistortion:
        """Return power and distortion of every epoch and satellite, and the C/N0 of the map in use."""
        e1 = evidence.measured.snapshots.e1
        expected_dbhz = evidence.references[Quantity.E1_CN0_DBHZ].value
        rise_db = evidence.observed[Quantity.E1_POWER_DB] - evidence.references[Quantity.E1_POWER_DB].value
        distortion = np.full(evidence.shape, np.nan)
        if e1.taps is not None:
            half, chips = self.hypotheses.half_spacing_chips, np.array(e1.tap_chips)
            early, late = int(np.argmin(np.abs(chips + half))), int(np.argmin(np.abs(chips - half)))
            distortion = np.abs(e1.taps[..., early] - e1.taps[..., late])
        return PowerAndDistortion(
            map_dbhz=np.round(expected_dbhz / self.cn0_step_db) * self.cn0_step_db,
            rise_db=np.broadcast_to(rise_db[:, None], evidence.shape),
            distortion=distortion,
        )
