"""Evidence for tests of single checks: whatever a check looks at, the rest made up."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from vestige.acas_processor.checks.check import Check
from vestige.acas_processor.checks.osnma_subframes import Subframes
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import Availability, DetectedBlock, FixBlock, MeasurementBlock
from vestige.acas_processor.monitoring.baseline import Quantity, Reference
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.navigation.position_fix import Fix, Transmission
from vestige.records import Band
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import BankBlock, E1Block, FrontEndBlock, OsnmaBlock, SnapshotBlock
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime

START = GalileoTime(1372, 604_790)  # the week ends after 10 s
NO_SUBFRAMES = Subframes(**{name: np.zeros(0, np.int64) for name in Subframes.__dataclass_fields__})


def evidence(
    shape: tuple[int, int] = (1, 1),
    *,
    observed: Mapping[Quantity, Any] | None = None,
    usual: Mapping[Quantity, Any] | None = None,
    learned: float = np.inf,
    taps: Any = None,
    noise_power: Any = None,
    integration_s: float = 16e-3,
    offsets_m: Any = None,
    range_offset_m: Any = None,
    tap: Any = None,
    predicted_pd: Any = None,
    front_end: Mapping[Band, FrontEndBlock] | None = None,
    fix: FixBlock | None = None,
    e1_taps: Any = None,
    tap_chips: tuple[float, ...] = (),
    elevation_rad: Any = None,
    subframes: Subframes = NO_SUBFRAMES,
    osnma: OsnmaBlock | None = None,
    svids: tuple[int, ...] | None = None,
    time_s: Any = None,
    e1_cn0_dbhz: Any = None,
    memory: CheckMemory | None = None,
) -> Evidence:
    """Return evidence of n epochs and m satellites; what is None was not measured."""
    n, m = shape
    nothing = np.full(shape, np.nan)

    def full(value: Any, *, of: tuple[int, ...] = shape) -> np.ndarray:
        return np.full(of, np.nan) if value is None else np.broadcast_to(np.asarray(value, np.float64), of).copy()

    elapsed_s = np.arange(n) * 1.0 if time_s is None else np.asarray(time_s, np.float64)
    times = GalileoTimes.after(START, elapsed_s)
    received = GalileoTimes(*(np.repeat(one[:, None], m, axis=1) for one in (times.second, times.fraction)))
    e1 = E1Block(
        pseudorange_m=np.zeros(shape),
        carrier_phase_cycles=nothing,
        doppler_hz=nothing,
        doppler_rate_hz_per_s=nothing,
        cn0_dbhz=full(e1_cn0_dbhz),
        taps=e1_taps,
        tap_chips=tap_chips,
    )
    snapshots = SnapshotBlock(
        index=np.arange(n),
        time=times,
        received_at=received,
        time_uncertainty_s=np.zeros(n),
        svids=tuple(range(1, m + 1)) if svids is None else svids,
        asked=np.ones(shape, bool),
        recs=np.ones(n, bool),
        e1=e1,
        front_end=front_end or {},
        osnma=osnma,
    )
    power = full(noise_power)
    banks = BankBlock(
        offsets_m=np.zeros(1) if offsets_m is None else np.asarray(offsets_m),
        taps=np.full((*shape, 1), np.nan + 0j) if taps is None else np.asarray(taps, np.complex128),
        noise_power=power,
        integration_s=np.full(shape, integration_s),
    )
    correlated = power > 0
    detected = DetectedBlock(
        tap=np.full(shape, -1) if tap is None else np.asarray(tap, np.int64),
        magnitude_sigma=nothing,
        phase_rad=nothing,
        range_offset_m=full(range_offset_m),
        threshold_sigma=5.7,
    )
    measured = MeasurementBlock(
        snapshots=snapshots,
        recs=RecsBlock(found=correlated, with_key=correlated, key_time=received, disclosed=received, complete=received),
        availability=np.where(correlated, Availability.CORRELATED, Availability.NO_SAMPLES).astype(np.int8),
        banks=banks,
        detected=detected,
        predicted_pd=full(predicted_pd),
        expected_s=nothing,
        doppler_e6_hz=nothing,
        predicted_phase_rad=nothing,
        extrapolated_s=nothing,
        fixes=None if fix is None else SimpleNamespace(block=fix),
    )

    def of(quantity: Quantity, values: Mapping[Quantity, Any] | None) -> np.ndarray:
        return full((values or {}).get(quantity), of=(n,) if quantity.of_receiver else shape)

    references = {}
    for quantity in Quantity:
        value = of(quantity, usual)
        references[quantity] = Reference(value, np.full(value.shape, learned))
    return Evidence(
        measured=measured,
        time_s=elapsed_s,
        elevation_rad=full(elevation_rad),
        observed={quantity: of(quantity, observed) for quantity in Quantity},
        references=references,
        subframes=subframes,
        memory=memory or {},
    )


def outcome(check: Check, given: Evidence, epoch: int = 0, satellite: int = 0) -> Any:
    """Return the result of a check at one epoch and satellite."""
    return check.series(given).result(epoch, satellite)


def fix_block(fix: Fix, **values: Any) -> FixBlock:
    """Return a fix as measured, with NaN for what is not given."""
    n, m = fix.residual_m.shape
    nothing, of_satellites = np.full(n, np.nan), np.full((n, m), np.nan)
    known: dict[str, Any] = {
        "sent": Transmission(
            position_m=np.full((n, m, 3), np.nan),
            velocity_mps=np.full((n, m, 3), np.nan),
            clock_m=of_satellites,
            clock_mps=of_satellites,
        ),
        "sigma_m": of_satellites,
        "common_m": None,
        "bounded": False,
        "range_rate_mps": of_satellites,
        "static_range_rate_mps": of_satellites,
        "sigma_rate_mps": of_satellites,
        "drift_mps": nothing,
        "sigma_drift_mps": nothing,
        "own_sigma_clock_m": nothing,
        "raim_statistic": nothing,
        "separation_sigmas": np.full((n, 3), np.nan),
        "separation_modes": np.zeros(n, np.int64),
    }
    return FixBlock(fix=fix, **(known | values))
