"""Power, C/N0 and noise floor against what they usually are: step 3 of level 2, without a calibration [WFO, Sec. IV-B].

The monitors compare with a nominal value. A receiver that was not calibrated in the laboratory takes the first quiet
values for normal: the median of the last `WINDOW` of them, from `LEARNED` on. An attack that is there from the
beginning becomes the normal state, and what was seen while any check failed teaches nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from vestige.acas_processor.monitors.cn0_expectation import Cn0Monitor
from vestige.acas_processor.monitors.e6_strength import E6StrengthMonitor
from vestige.acas_processor.monitors.judgement import Monitor, not_run
from vestige.acas_processor.monitors.received_power import ReceivedPowerMonitor
from vestige.acas_processor.monitors.wrong_code_floor import WrongCodeFloorMonitor
from vestige.measurement import Measurement, SatelliteMeasurement
from vestige.records import Band, CheckResult, Snapshot
from vestige.signals.definitions import E6C

WINDOW = 20
LEARNED = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Usual:
    """The last quiet values of one quantity."""

    values: tuple[float, ...] = ()

    @property
    def known(self) -> bool:
        """Whether there are enough."""
        return len(self.values) >= LEARNED

    @property
    def value(self) -> float:
        """Their median, 0 while there are too few."""
        return median(self.values) if self.known else 0.0

    def learn(self, value: float) -> Usual:
        """Return the reference with one more quiet value; NaN teaches nothing."""
        return Usual(values=(*self.values, value)[-WINDOW:]) if math.isfinite(value) else self

    def learning(self, monitor: Monitor) -> CheckResult:
        """Return that a check was not run because its reference is not known yet."""
        return not_run(monitor, f"its usual level is being learned: {len(self.values)} of {LEARNED} quiet snapshots")


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedReferences:
    """What is usual of each band, and of each satellite: C/N0 on E1 and E6, noise floor."""

    power: Mapping[Band, Usual] = field(default_factory=dict)
    cn0: Mapping[int, Usual] = field(default_factory=dict)
    cn0_e6: Mapping[int, Usual] = field(default_factory=dict)
    floor: Mapping[int, Usual] = field(default_factory=dict)

    def learn(self, snapshot: Snapshot, measurement: Measurement) -> LearnedReferences:
        """Return the references with the values of a quiet snapshot."""
        satellites = {one.svid: one for one in measurement.satellites}
        return LearnedReferences(
            power={band: _at(self.power, band).learn(_power_db(snapshot, band)) for band in Band},
            cn0={**self.cn0} | {k: _at(self.cn0, k).learn(_cn0_dbhz(snapshot, one)) for k, one in satellites.items()},
            cn0_e6={**self.cn0_e6} | {k: _at(self.cn0_e6, k).learn(_cn0_e6_dbhz(one)) for k, one in satellites.items()},
            floor={**self.floor}
            | {k: _at(self.floor, k).learn(_floor_db(snapshot, one)) for k, one in satellites.items()},
        )

    def of_receiver(self, snapshot: Snapshot, p_fa: Mapping[str, float]) -> tuple[CheckResult, ...]:
        """Return the check of the power of each band."""
        return tuple(self._power(snapshot, band, p_fa[f"{band.value} received power"]) for band in Band)

    def of_satellite(
        self, snapshot: Snapshot, one: SatelliteMeasurement, p_fa: Mapping[str, float]
    ) -> tuple[CheckResult, ...]:
        """Return the checks of a satellite: C/N0 on both bands, noise floor behind its E6 correlators."""
        usual, monitor = _at(self.cn0, one.svid), Cn0Monitor(p_fa=p_fa["C/N0"])
        cn0_dbhz = _cn0_dbhz(snapshot, one)
        known = usual.known or math.isnan(cn0_dbhz)
        cn0 = monitor.check(cn0_dbhz, usual.value) if known else usual.learning(monitor)
        return (
            cn0,
            self._strength(one, p_fa["E6 C/N0"]),
            self._floor(snapshot, one, p_fa["wrong-code floor"]),
        )

    def _strength(self, one: SatelliteMeasurement, p_fa: float) -> CheckResult:
        usual, monitor = _at(self.cn0_e6, one.svid), E6StrengthMonitor(p_fa=p_fa)
        known = usual.known or one.bank is None
        return monitor.check(one.bank, usual.value) if known else usual.learning(monitor)

    def _power(self, snapshot: Snapshot, band: Band, p_fa: float) -> CheckResult:
        usual, status = _at(self.power, band), snapshot.front_end.get(band)
        monitor = ReceivedPowerMonitor(band=band, p_fa=p_fa, nominal_power_db=usual.value)
        known = usual.known or status is None or status.saturated
        return monitor.check(status) if known else usual.learning(monitor)

    def _floor(self, snapshot: Snapshot, one: SatelliteMeasurement, p_fa: float) -> CheckResult:
        usual, status = _at(self.floor, one.svid), snapshot.front_end.get(Band.E6)
        n_chips = 1 if one.bank is None else round(one.bank.integration_s * E6C.chip_rate_hz)
        monitor = WrongCodeFloorMonitor(nominal_floor_db=usual.value, n_chips=n_chips, p_fa=p_fa)
        if one.bank is None or status is None or usual.known:
            return monitor.check(
                None if one.bank is None else one.bank.noise_power, None if status is None else status.agc_gain_db
            )
        return usual.learning(monitor)


def _at(known: Mapping[Any, Usual], key: object) -> Usual:
    return known.get(key, Usual())


def _power_db(snapshot: Snapshot, band: Band) -> float:
    """Return the power of a band, or the negative of the gain against it; NaN if it is not known."""
    status = snapshot.front_end.get(band)
    if status is None or status.saturated:
        return math.nan
    return status.total_power_db if math.isfinite(status.total_power_db) else -status.agc_gain_db


def _cn0_dbhz(snapshot: Snapshot, one: SatelliteMeasurement) -> float:
    seen = snapshot.observations.get(one.svid)
    return math.nan if seen is None else seen.cn0_dbhz


def _cn0_e6_dbhz(one: SatelliteMeasurement) -> float:
    """Return the C/N0 that the largest correlator speaks for; NaN where nothing was correlated."""
    if one.bank is None or not one.bank.noise_power > 0:
        return math.nan
    snr = max(float(abs(one.bank.taps).max()) ** 2 / one.bank.noise_power - 1, 1e-3)
    return 10 * math.log10(snr / one.bank.integration_s)


def _floor_db(snapshot: Snapshot, one: SatelliteMeasurement) -> float:
    status = snapshot.front_end.get(Band.E6)
    if one.bank is None or status is None or not one.bank.noise_power > 0:
        return math.nan
    return 10 * math.log10(one.bank.noise_power) - status.agc_gain_db
