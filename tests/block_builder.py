"""Snapshots of a made-up sky for tests of the processor: any number of epochs, cut wherever a test likes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from vestige.acas_processor.checks.e6_phase import E6PhaseMonitor
from vestige.acas_processor.checks.power.e6_fading import E6FadingMonitor
from vestige.acas_processor.monitoring.baseline import Antenna, ReferenceLevels
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.acas_processor.position.pseudorange_errors import PseudorangeErrors
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.searches.handover import reception_s
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.ephemeris import Ephemeris
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.elevation import SatelliteRange
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Band, EncryptedSegment
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import (
    BankBlock,
    E1Block,
    FrontEndBlock,
    Handovers,
    OsnmaBlock,
    SearchBlock,
    SearchRequest,
    SnapshotBlock,
    VelocityIncrements,
)
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime

START = GalileoTime(1400, 345_600)
SVIDS = (6, 7, 8, 12, 13, 14, 23, 24)
N_CHIPS = 81_840
INTEGRATION_S = N_CHIPS / 5.115e6
TAP_CHIPS = (-0.15, -0.05, 0.0, 0.05, 0.15)


@dataclass(frozen=True, eq=False)
class DrawnE6:
    """Banks by row; it never asks for a hand-over."""

    taps: np.ndarray
    noise_power: np.ndarray

    def correlate(self, asked: np.ndarray, handovers: Handovers, offsets_m: np.ndarray) -> BankBlock:
        return BankBlock(
            offsets_m=offsets_m,
            taps=np.where(asked[..., None], self.taps, np.nan),
            noise_power=np.where(asked, self.noise_power, np.nan),
            integration_s=np.where(asked, INTEGRATION_S, np.nan),
        )


@dataclass(frozen=True, eq=False)
class DrawnSearches:
    """What searches find by row; with a clock that was never fixed E1 finds one signal more."""

    signals: np.ndarray
    earliest_m: np.ndarray

    def e1(self, request: SearchRequest) -> SearchBlock:
        signals = self.signals[request.epoch]
        return self._block(signals, request)

    def exhaustive(self, request: SearchRequest) -> SearchBlock:
        return self._block(self.signals[request.epoch], request)

    def _block(self, signals: np.ndarray, request: SearchRequest) -> SearchBlock:
        earliest_m = np.where(signals > 1, self.earliest_m[request.epoch], np.nan)
        return SearchBlock(
            signals=signals, carrying=signals, earliest_m=earliest_m, not_run=np.zeros(signals.shape, np.int8)
        )


@dataclass(frozen=True, eq=False)
class Keys:
    """A key for every RECS, on air 40 s later, but for the rows of some epochs."""

    without: tuple[int, ...] = ()

    group_delays = ()
    hardware_bias_e1_e6_s = 0.0
    ionosphere_e1_m = MappingProxyType({})

    def recs_of(self, snapshots: SnapshotBlock) -> Keys:
        object.__setattr__(self, "_snapshots", snapshots)
        return self

    @property
    def block(self) -> RecsBlock:
        snapshots: SnapshotBlock = self._snapshots  # type: ignore[attr-defined]
        shape = snapshots.asked.shape
        with_key = ~np.isin(snapshots.index, self.without)[:, None] & snapshots.recs[:, None] & np.ones(shape, bool)
        time = GalileoTimes(
            *(np.repeat(one[:, None], shape[1], axis=1) for one in (snapshots.time.second, snapshots.time.fraction))
        )
        return RecsBlock(
            found=snapshots.recs[:, None] & np.ones(shape, bool),
            with_key=with_key,
            key_time=time + np.full(shape, 30.0),
            disclosed=time + np.full(shape, 40.0),
            complete=time + np.full(shape, 50.0),
        )

    def segment(self, epoch: int, satellite: int) -> tuple[EncryptedSegment, object]:
        raise AssertionError("a model asks for no chips")


def orbits() -> tuple[Ephemeris, ...]:
    """Return the orbits of the satellites."""
    return tuple(one for one in walker_ephemerides(START) if one.svid in SVIDS)


def settings() -> MonitoringSettings:
    """Return settings of a receiver that knows its orbits, its antenna and the power of E1."""
    errors = PseudorangeErrors(floor_m=1.0, ionosphere_m=1.0, multipath_m=0.5)
    return MonitoringSettings(
        fix=FixSettings(ephemerides=orbits(), errors=errors),
        levels=ReferenceLevels(e1_power_db=0.0, antenna=Antenna(e1_dbhz=45.0, e6_dbhz=47.0, fall_db=3.0)),
        exhaustive_period_s=600.0,
    )


@dataclass(frozen=True, eq=False)
class MadeUpSky:
    """A run of n epochs, one each second, with a RECS every `every` of them.

    `trouble` is the share of epochs with each kind of trouble: lost satellites, pushed ranges, noise, second signals.
    """

    seed: int
    n: int = 40
    every: int = 3
    trouble: float = 0.1

    @property
    def whole(self) -> SnapshotBlock:
        rng = np.random.default_rng(self.seed)
        n, m = self.n, len(SVIDS)
        shape = (n, m)

        def some(*size: int) -> np.ndarray:
            return rng.random(size) < self.trouble

        elapsed_s = np.arange(n) * 1.0
        place = StaticTrajectory(latitude_deg=48.1, longitude_deg=11.6, height_m=500.0)
        paths = [SatelliteRange(ephemeris=one, start=START, trajectory=place) for one in orbits()]
        range_m = np.stack([path.range_m(elapsed_s) for path in paths], axis=1)
        rate_mps = np.stack([path.rate_mps(elapsed_s) for path in paths], axis=1)
        pushed_m = np.where(some(n, m), 300.0, 0.0)
        clock_m = 20.0 + 3.0 * elapsed_s
        pseudorange_m = range_m + clock_m[:, None] + rng.normal(size=shape) + pushed_m
        doppler_hz = (
            -(rate_mps + 3.0 + 0.05 * rng.normal(size=shape) + some(n, m) * 5.0) * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
        )
        lost = some(n, m) | (some(n)[:, None] & (np.arange(m) > 2))
        cn0 = 43.0 + 0.3 * rng.normal(size=shape) - some(n, m) * 15.0

        def seen(values: np.ndarray) -> np.ndarray:
            return np.where(lost, np.nan, values)

        offsets_m = AcasProcessor().offsets_m
        shift_m = 3.0 * rng.normal(size=shape) + some(n, m) * 40.0
        strength = np.where(some(n, m), 0.0, np.sqrt(2 * 10**4.5 * INTEGRATION_S))
        triangle = np.maximum(1 - np.abs(offsets_m - shift_m[..., None]) / 58.6, 0)
        second = np.where(some(n, m), 0.5, 0.0)[..., None] * np.maximum(1 - np.abs(offsets_m + 60.0) / 58.6, 0)
        noise = rng.normal(size=(*shape, offsets_m.size)) + 1j * rng.normal(size=(*shape, offsets_m.size))
        jammed = np.where(some(n), 4.0, 1.0)
        turning = np.random.default_rng([self.seed, 1])
        turned = np.where(turning.random(shape) < self.trouble, np.exp(2j * np.pi * turning.random(shape)), 1.0)
        taps = turned[..., None] * strength[..., None] * (triangle + second) + noise * np.sqrt(jammed)[:, None, None]
        e1_taps = (
            60.0 * (1 - np.abs(np.array(TAP_CHIPS))) + rng.normal(size=(*shape, 5)) + 1j * rng.normal(size=(*shape, 5))
        )
        power_db = 0.1 * rng.normal(size=n) + some(n) * 3.0
        e1 = E1Block(
            pseudorange_m=seen(pseudorange_m),
            carrier_phase_cycles=np.full(shape, np.nan),
            doppler_hz=seen(doppler_hz),
            doppler_rate_hz_per_s=seen(np.zeros(shape)),
            cn0_dbhz=seen(cn0),
            taps=np.where(lost[..., None], np.nan, e1_taps),
            tap_chips=TAP_CHIPS,
        )
        # E1 predicts the phase 0 at the start of each RECS: the phase of E6 without trouble
        e1 = replace(e1, carrier_phase_cycles=e1.doppler_hz * reception_s(e1))
        return SnapshotBlock(
            index=np.arange(n),
            time=GalileoTimes.after(START, elapsed_s),
            received_at=GalileoTimes(*(np.repeat(one[:, None], m, axis=1) for one in _later(elapsed_s))),
            time_uncertainty_s=np.full(n, 1.0),
            svids=SVIDS,
            asked=np.ones(shape, bool),
            recs=np.arange(n) % self.every == 0,
            e1=e1,
            front_end={
                Band.E1: FrontEndBlock(agc_gain_db=np.zeros(n), total_power_db=power_db, saturated=some(n) & some(n)),
                Band.E6: FrontEndBlock(
                    agc_gain_db=np.zeros(n),
                    total_power_db=10 * np.log10(jammed) + 0.1 * rng.normal(size=n),
                    saturated=np.zeros(n, bool),
                ),
            },
            e6=DrawnE6(taps, np.repeat(2.0 * jammed[:, None], m, axis=1) * (1 + 0.003 * rng.normal(size=shape))),
            searches=DrawnSearches(1.0 + (some(n, m) & some(n, m)), -1000.0 * rng.random(shape)),
            osnma=self._osnma(rng, n, m),
            increments=VelocityIncrements(
                epoch=np.arange(n),
                time=GalileoTimes.after(START, elapsed_s),
                delta_velocity_mps=0.003 * rng.normal(size=(n, 3)),
                covered=~some(n),
            ),
        )

    def _osnma(self, rng: np.random.Generator, n: int, m: int) -> OsnmaBlock:
        """A subframe of 15 pages, one each epoch."""
        page = np.arange(n) % 15
        due = np.repeat((1 << page)[:, None], m, axis=1)
        received = due * (rng.random((n, m)) > self.trouble)
        differs = received * (rng.random((n, m)) < self.trouble**3)
        return OsnmaBlock(
            epoch=np.arange(n),
            subframe=START.gst_seconds + 30 * (np.arange(n) // 15),
            due=due,
            received=received,
            differs=differs,
            last=page == 14,
        )


QUIET = 45  # epochs of `every_trouble` without trouble: 15 RECS, from which reference levels are learned
WINDOW = 4  # RECS of the monitors of the carrier on E6


def every_trouble(seed: int) -> SnapshotBlock:
    """Return a run in which each check is run, passes and fails, if the processor has `settings_of_every_check`.

    After `QUIET` epochs comes trouble of each kind. At first the pages of one satellite differ from those that were
    sent, and then OSNMA is denied. E1 is jammed for some epochs. The drift of the clock grows, and in some epochs the
    clock is late by more than the receiver states.
    """
    n = 150
    loud = MadeUpSky(seed=seed + 1, n=n, trouble=0.15).whole
    whole = spliced(MadeUpSky(seed=seed, n=n, trouble=0.0).whole, loud, QUIET)
    elapsed_s = np.maximum(np.arange(n) - QUIET, 0.0)
    drift_mps = np.where(elapsed_s > 30, 0.5 * (elapsed_s - 30), 0.0)
    late_m = np.cumsum(drift_mps) + np.where((elapsed_s > 15) & (elapsed_s < 20), 2e-3 * SPEED_OF_LIGHT_MPS, 0.0)
    doppler_hz = whole.e1.doppler_hz - drift_mps[:, None] * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    e1 = replace(whole.e1, pseudorange_m=whole.e1.pseudorange_m + late_m[:, None], doppler_hz=doppler_hz)
    jammed_db = np.where((elapsed_s > 20) & (elapsed_s < 30), 10.0, 0.0)
    front_end = whole.front_end[Band.E1]
    front_end = replace(front_end, total_power_db=front_end.total_power_db + jammed_db)
    assert whole.osnma is not None
    denied = (whole.osnma.epoch >= QUIET + 15)[:, None]
    received = np.where(denied, 0, whole.osnma.received)
    forged = (whole.osnma.epoch >= QUIET)[:, None] & (np.arange(len(SVIDS)) == 0)
    return replace(
        whole,
        e1=e1,
        front_end={**whole.front_end, Band.E1: front_end},
        osnma=replace(whole.osnma, received=received, differs=np.where(forged, received, 0)),
        time_uncertainty_s=np.full(n, 1e-3),
    )


def settings_of_every_check() -> MonitoringSettings:
    """Return `settings` with the optional monitors of the carrier on E6."""
    return replace(settings(), e6_phase=E6PhaseMonitor(window=WINDOW), e6_fading=E6FadingMonitor(window=WINDOW))


def spliced(before: SnapshotBlock, after: SnapshotBlock, epoch: int) -> SnapshotBlock:
    """Return the epochs before one of a made-up block, and those from there on of another."""

    def rows(one: object, other: object) -> object:
        return replace(
            one,  # type: ignore[type-var]
            **{
                name: np.concatenate([getattr(one, name)[:epoch], getattr(other, name)[epoch:]])
                for name in one.__dataclass_fields__  # type: ignore[attr-defined]
                if isinstance(getattr(one, name), np.ndarray)
            },
        )

    return replace(
        before,
        e1=rows(before.e1, after.e1),
        front_end={band: rows(one, after.front_end[band]) for band, one in before.front_end.items()},
        e6=rows(before.e6, after.e6),
        searches=rows(before.searches, after.searches),
        osnma=rows(before.osnma, after.osnma),
        increments=rows(before.increments, after.increments),
    )


def _later(elapsed_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    times = GalileoTimes.after(START, elapsed_s + 0.1)
    return times.second, times.fraction


def cut(block: SnapshotBlock, first: int, last: int) -> SnapshotBlock:
    """Return the epochs from `first` to before `last` of a made-up block."""
    part = slice(first, last)

    def rows(record: object) -> object:
        return replace(
            record,  # type: ignore[type-var]
            **{
                name: value[part]
                for name, value in ((name, getattr(record, name)) for name in record.__dataclass_fields__)  # type: ignore[attr-defined]
                if isinstance(value, np.ndarray)
            },
        )

    osnma, increments = block.osnma, block.increments
    assert osnma is not None
    assert increments is not None
    assert isinstance(block.e6, DrawnE6)
    assert isinstance(block.searches, DrawnSearches)
    pieces = (osnma.epoch >= first) & (osnma.epoch < last)
    steps = (increments.epoch >= first) & (increments.epoch < last)
    return replace(
        block,
        index=block.index[part],
        time=block.time[part],
        received_at=block.received_at[part],
        time_uncertainty_s=block.time_uncertainty_s[part],
        asked=block.asked[part],
        recs=block.recs[part],
        e1=rows(block.e1),
        front_end={band: rows(one) for band, one in block.front_end.items()},
        e6=DrawnE6(block.e6.taps[part], block.e6.noise_power[part]),
        searches=DrawnSearches(block.searches.signals[part], block.searches.earliest_m[part]),
        osnma=OsnmaBlock(
            epoch=osnma.epoch[pieces] - first,
            subframe=osnma.subframe[pieces],
            due=osnma.due[pieces],
            received=osnma.received[pieces],
            differs=osnma.differs[pieces],
            last=osnma.last[pieces],
        ),
        increments=VelocityIncrements(
            epoch=increments.epoch[steps] - first,
            time=increments.time[steps],
            delta_velocity_mps=increments.delta_velocity_mps[steps],
            covered=increments.covered[part],
        ),
    )
