"""Convert measurements to columns of the results, and columns back to measurements for the verdicts.

The workers call `measured_columns`. `measured_block` converts columns to measurements, from which the processor makes
verdicts. A run of a campaign calls `measured_block` chunk by chunk. Plots and the threat table call `measured_block` to
make verdicts at chosen mitigation levels. `measured_block` reads no column whose name begins with `truth_`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int64

from vestige.acas_processor.measurement import Availability, DetectedBlock, MeasurementBlock
from vestige.acas_processor.position.fix_measurement import LazyFix
from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.columns.own_check_columns import require_own_check_columns
from vestige.campaign.plan import column_table
from vestige.receiver.correlators.e1_taps import TAP_CHIPS
from vestige.receiver.osnma_reception import as_mask, of_mask, pages_due
from vestige.receiver.snapshots.assistance import recs_with_keys
from vestige.receiver.snapshots.osnma import PagesReceived
from vestige.receiver.snapshots.searches import KnownSearches, SearchFinds
from vestige.records import Band
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import BankBlock, E1Block, FrontEndBlock, SnapshotBlock, VelocityIncrements
from vestige.records.times import GalileoTimes
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.stored import StoredScenario
from vestige.theory.search_budget import SEARCH_P_FA
from vestige.time import GalileoTime

Columns = Mapping[str, np.ndarray]  # columns by name
_EPOCH, _SATELLITE = ("epoch",), ("epoch", "satellite")
_AVAILABILITY = {
    "availability": {
        "flag_values": [int(one) for one in Availability],
        "flag_meanings": " ".join(one.name.lower() for one in Availability),
    }
}


MEASURED_COLUMNS = column_table(
    ("time_s", _EPOCH, "float64", "s", "time of transmission after the start of the scenario"),
    ("recs", _EPOCH, "bool", "1", "whether a RECS is sent"),
    ("osnma_key", _EPOCH, "bool", "1", "whether the OSNMA key of a RECS of this epoch is received"),
    ("availability", _SATELLITE, "int8", "1", "whether E6 was correlated, or why not"),
    (
        "e6_received_s",
        _SATELLITE,
        "float64",
        "s",
        "time after the start of the scenario at which the last E6 sample was received, if too late for a proof",
    ),
    ("taps", (*_SATELLITE, "tap"), "complex64", "1", "correlator output"),
    ("noise_power", _SATELLITE, "float32", "1", "mean squared magnitude of noise in a correlator"),
    ("predicted_pd", _SATELLITE, "float32", "1", "probability of detection that the C/N0 of E1 predicts"),
    ("e1_pseudorange_m", _SATELLITE, "float64", "m", "E1 pseudorange; NaN if not tracked"),
    ("e1_cn0_dbhz", _SATELLITE, "float32", "dB Hz", "C/N0 of E1-C as the receiver estimates it"),
    ("predicted_phase_rad", _SATELLITE, "float32", "rad", "phase of correlators that E1 predicts, up to a constant"),
    ("e1_extrapolated_s", _SATELLITE, "float32", "s", "time over which E1 Doppler extrapolated the predicted phase"),
    attrs=_AVAILABILITY,
)

# additional measurements for the checks of levels 2 and 3
E1_COLUMNS = column_table(
    ("e1_doppler_hz", _SATELLITE, "float64", "Hz", "Doppler on E1, positive when the satellite approaches"),
    (
        "e1_taps",
        (*_SATELLITE, "e1_tap"),
        "complex64",
        "1",
        "E1 correlators, in standard deviations per dimension of the noise without interference",
    ),
    ("e1_power_db", _EPOCH, "float32", "dB", "power of the E1 band over the power without attack"),
    ("e6_power_db", _EPOCH, "float32", "dB", "power of the E6 band over the power without attack; NaN without RECS"),
    ("e1_signals", _SATELLITE, "float32", "1", "number of signals that the search of E1 finds; NaN without RECS"),
    ("handover_carrying", _SATELLITE, "float32", "1", "number of E1 signals with the encrypted chips in E6"),
    ("handover_earliest_m", _SATELLITE, "float64", "m", "delay after the E1 prediction of the earliest such signal"),
    ("exhaustive_signals", _SATELLITE, "float32", "1", "number of signals that an exhaustive search of E6 finds"),
    ("exhaustive_earliest_m", _SATELLITE, "float64", "m", "delay after the E1 prediction of the earliest such signal"),
    (
        "earliest_received_s",
        _SATELLITE,
        "float64",
        "s",
        "time after the start of the scenario at which the last sample of the earliest signal's RECS is received",
    ),
)

OSNMA_COLUMNS = column_table(
    ("in_view", _SATELLITE, "bool", "1", "whether the satellite is above the mask"),
    ("osnma_due", _EPOCH, "int16", "1", "I/NAV pages that were due since the previous epoch, as bits"),
    ("osnma_pages", _SATELLITE, "int16", "1", "due pages that were received, as bits"),
    ("osnma_differs", _SATELLITE, "bool", "1", "whether data of these pages differ from what the satellite sent"),
    ("osnma_data", _SATELLITE, "bool", "1", "whether OSNMA authenticates the navigation data of the satellite"),
    ("delta_velocity_mps", ("epoch", "local_axis"), "float64", "m s-1", "velocity change by the accelerometers"),
)

_FINDS = {
    "e1_signals": "e1_signals",
    "handover_carrying": "handover_carrying",
    "handover_earliest_m": "handover_earliest_m",
    "exhaustive_signals": "exhaustive_signals",
    "exhaustive_earliest_m": "exhaustive_earliest_m",
    "earliest_received_s": "earliest_s",
}


def measured_columns(start: GalileoTime, measured: MeasurementBlock) -> dict[str, np.ndarray]:
    """Return the values of `MEASURED_COLUMNS` except `time_s`."""
    snapshots = measured.snapshots
    too_late = measured.availability == Availability.NOT_PROVEN
    return {
        "e6_received_s": np.where(too_late, snapshots.received_at.since(start), np.nan),
        "recs": snapshots.recs,
        "osnma_key": measured.recs.with_key[:, 0],  # all satellites use the same key
        "availability": measured.availability,
        "taps": measured.banks.taps,
        "noise_power": measured.banks.noise_power,
        "predicted_pd": measured.predicted_pd,
        "e1_pseudorange_m": snapshots.e1.pseudorange_m,
        "e1_cn0_dbhz": snapshots.e1.cn0_dbhz,
        "predicted_phase_rad": measured.predicted_phase_rad,
        "e1_extrapolated_s": measured.extrapolated_s,
    }


def e1_columns(snapshots: SnapshotBlock, finds: SearchFinds) -> dict[str, np.ndarray]:
    """Return the values of `E1_COLUMNS`; `finds` are the results that searches with `SEARCH_P_FA` would give."""
    if snapshots.e1.taps is None:
        raise TypeError("E1 of this receiver is not tracked between RECS")
    return {
        "e1_doppler_hz": snapshots.e1.doppler_hz,
        "e1_taps": snapshots.e1.taps,
        "e1_power_db": snapshots.front_end[Band.E1].total_power_db,
        "e6_power_db": snapshots.front_end[Band.E6].total_power_db,
    } | {name: getattr(finds, of) for name, of in _FINDS.items()}


def osnma_columns(snapshots: SnapshotBlock, pages: PagesReceived) -> dict[str, np.ndarray]:
    """Return the values of `OSNMA_COLUMNS`."""
    if snapshots.data_authenticated is None:
        raise TypeError("data_authenticated: found nothing, expected which navigation data OSNMA authenticates")
    delta_velocity_mps = np.full((len(snapshots.time), 3), np.nan)
    if snapshots.increments is not None:
        delta_velocity_mps[snapshots.increments.epoch] = snapshots.increments.delta_velocity_mps
    return {
        "in_view": pages.in_view,
        "osnma_due": as_mask(pages.page >= 0),
        "osnma_pages": as_mask(pages.received),
        "osnma_differs": pages.forged,
        "osnma_data": snapshots.data_authenticated,
        "delta_velocity_mps": delta_velocity_mps,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """Campaign, and the processor that makes verdicts from the columns of the campaign."""

    scenario: CampaignScenario | StoredScenario  # scenario of the campaign, or the scenario that the results contain
    processor: AcasProcessor
    svids: tuple[int, ...]


def measured_block(of: Judged, epoch: Int64[np.ndarray, " n"], columns: Columns) -> MeasurementBlock:
    """Return the receiver's measurements in the given epochs.

    `epoch` has the numbers of the given epochs. `columns` contain only the given epochs, with the axes of the results.
    In the columns that the function reads, the axis of epochs is the first axis, except in columns with the axis
    `detector`. In these columns, `detector` is the first axis and the axis of epochs is the second axis.
    """
    scenario, processor = of.scenario, of.processor
    if scenario.processor.checks:
        require_own_check_columns(columns)
    time = _times(scenario, epoch)
    recs = _recs(scenario, time, columns, len(of.svids))
    e1 = _e1(columns)
    received_s = np.asarray(columns.get("e6_received_at_s", columns["e6_received_s"]))
    availability = columns["availability"].astype(np.int8)
    shape = availability.shape
    snapshots = SnapshotBlock(
        index=epoch,
        time=time,
        received_at=GalileoTimes.after(scenario.start_time, np.nan_to_num(received_s)),
        time_uncertainty_s=np.full(epoch.size, scenario.receiver.time_uncertainty_s, np.float64),
        svids=of.svids,
        asked=np.ones(shape, np.bool_),
        recs=columns["recs"].astype(np.bool_),
        e1=e1,
        front_end=_front_ends(columns),
        searches=_searches(scenario, columns, recs),
        **_of_sky(scenario, time, columns),
    )
    noise_power = _double(columns["noise_power"])
    return MeasurementBlock(
        snapshots=snapshots,
        recs=recs,
        availability=availability,
        banks=BankBlock(
            offsets_m=processor.offsets_m,
            taps=columns["taps"].astype(np.complex128),
            noise_power=noise_power,
            integration_s=np.where(np.isnan(noise_power), np.nan, scenario.recs.integration_s),
        ),
        detected=_detected(of, columns),
        predicted_pd=_double(columns["predicted_pd"]),
        expected_s=_known(columns, "e6_expected_s", shape),
        doppler_e6_hz=_known(columns, "e6_expected_doppler_hz", shape),
        predicted_phase_rad=_known(columns, "predicted_phase_rad", shape),
        extrapolated_s=_known(columns, "e1_extrapolated_s", shape),
        fixes=LazyFix(settings=processor.monitoring.fix, time=time, svids=of.svids, e1=e1),
    )


def _double(values: np.ndarray) -> Float[np.ndarray, "*n"]:
    return values.astype(np.float64)


def _known(columns: Columns, name: str, shape: tuple[int, ...]) -> Float[np.ndarray, "n m"]:
    """Return a column; NaN if the results do not have this column."""
    return _double(columns[name]) if name in columns else np.full(shape, np.nan)


def _times(scenario: CampaignScenario | StoredScenario, epoch: Int64[np.ndarray, " n"]) -> GalileoTimes:
    deciseconds = epoch * round(10 * scenario.interval_s)
    return GalileoTimes(scenario.start_time.gst_seconds + deciseconds // 10, deciseconds % 10 / 10)


def _recs(
    scenario: CampaignScenario | StoredScenario, time: GalileoTimes, columns: Columns, n_satellites: int
) -> RecsBlock:
    found = np.repeat(columns["recs"].astype(np.bool_)[:, None], n_satellites, axis=1)
    with_key = found & columns["osnma_key"].astype(np.bool_)[:, None]
    return recs_with_keys(time.second, found, with_key, key_delay=scenario.recs.key_delay)


def _e1(columns: Columns) -> E1Block:
    pseudorange_m = _double(columns["e1_pseudorange_m"])
    shape = pseudorange_m.shape
    with_taps = "e1_taps" in columns
    return E1Block(
        pseudorange_m=pseudorange_m,
        carrier_phase_cycles=_known(columns, "e1_carrier_phase_cycles", shape),
        doppler_hz=_known(columns, "e1_doppler_hz", shape),
        doppler_rate_hz_per_s=_known(columns, "e1_doppler_rate_hz_per_s", shape),
        cn0_dbhz=_double(columns["e1_cn0_dbhz"]),
        taps=columns["e1_taps"].astype(np.complex128) if with_taps else None,
        tap_chips=TAP_CHIPS if with_taps else (),
    )


def _front_ends(columns: Columns) -> dict[Band, FrontEndBlock]:
    found = {}
    if "e1_power_db" in columns:
        e1_db = _double(columns["e1_power_db"])
        never = np.zeros(e1_db.size, np.bool_)
        found[Band.E1] = FrontEndBlock(agc_gain_db=-e1_db, total_power_db=e1_db, saturated=never)
    if "e6_power_db" in columns:
        found[Band.E6] = FrontEndBlock(
            agc_gain_db=_double(columns["e6_agc_gain_db"]),
            total_power_db=_double(columns["e6_power_db"]),
            saturated=columns["e6_saturated"] > 0,
        )
    return found


def _searches(scenario: CampaignScenario | StoredScenario, columns: Columns, recs: RecsBlock) -> KnownSearches | None:
    if "e1_signals" not in columns:
        return None
    finds = SearchFinds(p_fa=SEARCH_P_FA, **{of: _double(columns[name]) for name, of in _FINDS.items()})
    return KnownSearches(finds=finds, start=scenario.start_time, recs=recs)


def _of_sky(scenario: CampaignScenario | StoredScenario, time: GalileoTimes, columns: Columns) -> dict[str, Any]:
    """Return the fields that only a snapshot block of a sky has; empty for a single line of sight."""
    if "osnma_pages" not in columns:
        return {}
    start = scenario.start_time
    pages = PagesReceived(
        start=start,
        interval_s=scenario.interval_s,
        page=pages_due(start.second + _double(columns["time_s"]), scenario.interval_s),
        in_view=columns["in_view"].astype(np.bool_),
        received=of_mask(columns["osnma_pages"].astype(np.int16)),
        forged=columns["osnma_differs"].astype(np.bool_),
    )
    delta_velocity_mps, increments = _double(columns["delta_velocity_mps"]), None
    if scenario.receiver.accelerometers is not None:
        rows = np.flatnonzero(np.isfinite(delta_velocity_mps[:, 0]))
        increments = VelocityIncrements(
            epoch=rows,
            time=time[rows],
            delta_velocity_mps=delta_velocity_mps[rows],
            covered=np.ones(delta_velocity_mps.shape[0], np.bool_),
        )
    return {
        "osnma": pages.block,
        "increments": increments,
        "data_authenticated": columns["osnma_data"].astype(np.bool_),
    }


def _detected(of: Judged, columns: Columns) -> DetectedBlock:
    """Return the result of the processor's detector from the columns."""
    place = list(of.scenario.processor.detectors).index(of.scenario.processor.detector)
    return DetectedBlock(
        tap=columns["tap_index"][place].astype(np.int64),
        magnitude_sigma=_double(columns["magnitude_sigma"][place]),
        phase_rad=_double(columns["phase_rad"][place]),
        range_offset_m=_double(columns["range_offset_m"][place]),
        threshold_sigma=of.processor.detection_threshold,
    )
