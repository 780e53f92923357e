"""Simulate the receiver of a campaign scenario, measure its snapshots, make verdicts, and record the truth.

`measure` makes the snapshots of a chunk on any worker, and the processor measures these snapshots. In `judge`, the
processor assesses the measurements in order of time. The processor alone decides about checks, alarms and ranges in
use, at the level of the scenario.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.measurement import Availability, MeasurementBlock
from vestige.acas_processor.monitoring.state import ReceiverState
from vestige.campaign.columns.attack_columns import ATTACK_COLUMNS, attack_columns, attack_coords, phase_columns
from vestige.campaign.columns.judged_columns import JUDGED_COLUMNS, judged_columns
from vestige.campaign.columns.measured_columns import (
    E1_COLUMNS,
    MEASURED_COLUMNS,
    OSNMA_COLUMNS,
    Judged,
    e1_columns,
    measured_block,
    measured_columns,
    osnma_columns,
)
from vestige.campaign.columns.own_check_columns import OWN_CHECK_COLUMNS, own_check_columns
from vestige.campaign.columns.sky_columns import SKY_COLUMNS, fix_columns, sky_coords, view_columns
from vestige.campaign.plan import CHUNK_EPOCHS, Column, Coord, column_table
from vestige.campaign.store.attributes import NAVIGATION_TEXT
from vestige.campaign.store.build_id import PARTS, PROCESSOR
from vestige.own_parts import blamed_on_own_parts
from vestige.receiver.correlators.e1_taps import TAP_CHIPS
from vestige.receiver.simulation import Simulation
from vestige.receiver.snapshots.osnma import OsnmaReception
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.snapshots.simulated_receiver import SimulatedReceiver
from vestige.receiver.truth import TruthBlock, TruthProcess
from vestige.receiver.truth_around import TruthAround
from vestige.records import Band
from vestige.records.snapshot_block import FrontEndBlock, SnapshotBlock
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.scenario_processor import Overhead, navigation_text, overhead_of, receiver_processor
from vestige.source_version import processor_name
from vestige.theory.search_budget import SEARCH_P_FA

_log = logging.getLogger(__name__)
_MANY_EPOCHS = 10_000  # number of epochs in a chunk if writing the store takes longer than measuring
_EPOCH, _SATELLITE = ("epoch",), ("epoch", "satellite")
_RAYS, _FOUND = ("epoch", "satellite", "ray"), ("detector", "epoch", "satellite")
_FLAGS = {"e6_saturated": {"flag_values": [-1, 0, 1], "flag_meanings": "no_samples no yes"}}

SCENARIO_COLUMNS = column_table(
    ("tap_index", _FOUND, "int8", "1", "index of the detecting correlator, -1 for none"),
    ("magnitude_sigma", _FOUND, "float32", "1", "magnitude of the detecting correlator in standard deviations"),
    ("phase_rad", _FOUND, "float32", "rad", "phase of the detecting correlator"),
    ("range_offset_m", _FOUND, "float32", "m", "measured minus predicted E6 range"),
    ("e6_total_power_db", _EPOCH, "float32", "dB", "power of the E6 samples over the power of noise alone"),
    ("e6_agc_gain_db", _EPOCH, "float32", "dB", "gain of the E6 front end over the gain for noise alone"),
    ("e6_saturated", _EPOCH, "int8", "1", "whether the E6 quantiser clips"),
    ("truth_range_m", _SATELLITE, "float64", "m", "geometric range"),
    ("truth_clock_m", _EPOCH, "float64", "m", "error of the receiver clock"),
    ("truth_clock_drift_mps", _EPOCH, "float64", "m s-1", "rate of the error of the receiver clock"),
    ("truth_iono_diff_m", _SATELLITE, "float64", "m", "ionospheric delay of E6 minus ionospheric delay of E1"),
    ("truth_e1_noise_m", _SATELLITE, "float64", "m", "noise of the E1 pseudorange"),
    ("truth_e1_phase_noise_m", _SATELLITE, "float64", "m", "noise of the E1 carrier phase times the wavelength"),
    ("truth_e1_rate_noise_mps", _SATELLITE, "float64", "m s-1", "noise of the range rate from the E1 Doppler"),
    ("truth_e1_multipath_m", _SATELLITE, "float64", "m", "multipath error of the E1 pseudorange"),
    ("truth_bias_m", _SATELLITE, "float64", "m", "residual group delay and hardware bias, E6 minus E1"),
    ("truth_ray_delay_m", _RAYS, "float64", "m", "excess delay of a reflection"),
    ("truth_ray_amplitude", _RAYS, "complex64", "1", "amplitude of a reflection relative to the line of sight, on E6"),
    ("truth_ray_doppler_hz", _RAYS, "float64", "Hz", "Doppler of a reflection minus line-of-sight Doppler, on E6"),
    attrs=_FLAGS,
)


@dataclass(frozen=True, kw_only=True)
class ScenarioPlan:
    """Plan that runs the campaign of a scenario; see `Plan`."""

    scenario: CampaignScenario
    # whether a campaign with an attack has the column `truth_phase_rad`; this column needs the arrival of E6 at all
    # epochs, and not only at the epochs with RECS
    with_phases: bool = True

    @property
    def simulations(self) -> tuple[Simulation, ...]:
        """Simulations of the receiver, one for each satellite."""
        return self.scenario.simulations

    @property
    def n_epochs(self) -> int:
        """Number of epochs."""
        return self.scenario.epochs

    @property
    def chunk_epochs(self) -> int:
        """Default number of epochs in a chunk: 2000, or 10,000 for a single line of sight with drawn correlators."""
        drawn = self.scenario.fidelity == "correlators" and self.scenario.constellation is None
        return _MANY_EPOCHS if drawn else CHUNK_EPOCHS

    @property
    def columns(self) -> Mapping[str, Column]:
        """Variables of the results, by name."""
        found = MEASURED_COLUMNS | SCENARIO_COLUMNS | JUDGED_COLUMNS | (ATTACK_COLUMNS if self.scenario.attack else {})
        if self._receiver.with_taps:
            found |= E1_COLUMNS
        if self.scenario.processor.checks:
            found |= OWN_CHECK_COLUMNS
        return found | (OSNMA_COLUMNS | SKY_COLUMNS if self.scenario.constellation else {})

    @cached_property
    def coords(self) -> Mapping[str, Coord]:
        """Coordinates of the axes other than `epoch`, by name."""
        simulation = self.simulations[0]
        svids = np.array([one.svid for one in self.simulations])
        offsets_m = self._judged.processor.offsets_m
        rays = np.arange(simulation.models.n_rays)
        checks = np.array([str(spec.name) for spec in self._judged.processor.specs])
        e1_taps = Coord(
            dim="e1_tap", values=np.array(TAP_CHIPS), long_name="offset from the tracked code phase in chips of E1"
        )
        return (
            {
                "svid": Coord(dim="satellite", values=svids, long_name="satellite"),
                "tap_offset_m": Coord(dim="tap", values=offsets_m, units="m", long_name="offset from the prediction"),
                "detector": Coord(
                    dim="detector",
                    values=np.array(list(self.scenario.processor.detectors)),
                    long_name="detector",
                ),
                "check": Coord(dim="check", values=checks, long_name="check"),
                "ray": Coord(dim="ray", values=rays, long_name="number of the reflection"),
            }
            | attack_coords(simulation)
            | (sky_coords() if self.scenario.constellation else {})
            | ({"e1_tap_chips": e1_taps} if self._receiver.with_taps else {})
        )

    @property
    def attrs(self) -> Mapping[str, Any]:
        """Attributes that identify the scenario and its results; see `Plan`."""
        text = self.scenario.model_dump_json()
        processor, receiver = self.scenario.processor, self.scenario.receiver
        navigation = self._navigation
        return {
            "scenario": text,
            "scenario_digest": hashlib.sha256(text.encode()).hexdigest(),
            "seed": self.scenario.seed,
            "p_fa": processor.p_fa,
            "threshold_sigma": self._judged.processor.detection_threshold,
            "signal": receiver.signal,
            **({"cn0_dbhz": receiver.cn0_dbhz} if receiver.signal else {}),
            "integration_s": self.scenario.recs.integration_s,
            "fidelity": self.scenario.fidelity,
            "satellites_expected": self._overhead.satellites,
            "cn0_e1_expected_dbhz": self._overhead.cn0_e1_dbhz,
            **({PROCESSOR: processor_name()} if self.scenario.fidelity == "samples" else {}),
            **({} if navigation is None else {NAVIGATION_TEXT: navigation}),
            **({PARTS: " ".join(parts)} if (parts := self.scenario.own_parts) else {}),
        }

    @cached_property
    def _overhead(self) -> Overhead:
        return overhead_of(self.scenario)

    @cached_property
    def _navigation(self) -> str | None:
        """Text of the satellites' ephemerides, which the results keep because the file may be deleted later."""
        return navigation_text(self.scenario)

    @cached_property
    def _receiver(self) -> SimulatedReceiver:
        return self.scenario.simulated_receiver

    @cached_property
    def _judged(self) -> Judged:
        """Scenario of the campaign, together with the processor that makes verdicts from the columns."""
        processor = receiver_processor(self.scenario, self._overhead, self._navigation)
        _log.info("%s", processor.limits)
        return Judged(scenario=self.scenario, processor=processor, svids=tuple(one.svid for one in self.simulations))

    def prepare(self) -> _Preparation:
        """Return the simulation of the truth in its state before the first epoch."""
        return _Preparation(self._receiver.truth())

    def measure(self, first: int, inputs: Mapping[str, Any]) -> Mapping[str, np.ndarray]:
        """Return the columns of measurements and truth for the epochs of `inputs`, which begin at epoch `first`."""
        with blamed_on_own_parts():
            return self._measured(first, inputs)

    def _measured(self, first: int, inputs: Mapping[str, Any]) -> Mapping[str, np.ndarray]:
        truths: tuple[TruthBlock, ...] = inputs["truth"]
        of = ReceiverTruth(simulations=self.simulations, truth=truths, first=first, every=self.scenario.recs.every)
        sky = self.scenario.constellation is not None
        pages = OsnmaReception(of=of).pages(self.scenario.interval_s) if sky else None
        snapshots = self._receiver.snapshots_of(of, pages)
        measured = self._judged.processor.measure(snapshots, self._receiver.assistance)
        columns = (
            measured_columns(self.scenario.start_time, measured)
            | self._detections(measured)
            | self._front_end(snapshots)
        )
        columns |= {"time_s": truths[0].time_s} | _side_by_side(
            [_truth_columns(one, of.e1_multipath_m[:, column]) for column, one in enumerate(truths)]
        )
        if self.scenario.attack:
            columns |= _side_by_side(
                [
                    attack_columns(truth, e1_multipath_m)
                    for truth, e1_multipath_m in zip(truths, of.e1_multipath_m.T, strict=True)
                ]
            )
            if self.with_phases:
                columns |= _side_by_side([phase_columns(one) for one in of.arrived_at_epochs])
        if self._receiver.with_taps:
            columns |= e1_columns(snapshots, self._receiver.searches(of).finds(SEARCH_P_FA))
        if self.scenario.processor.checks:
            columns |= own_check_columns(self.scenario.start_time, measured)
        if pages is not None:
            columns |= osnma_columns(snapshots, pages)
            columns |= view_columns(truths)
        return {name: np.ascontiguousarray(values, dtype=self.columns[name].dtype) for name, values in columns.items()}

    def judge(
        self, state: ReceiverState | None, first: int, columns: Mapping[str, np.ndarray]
    ) -> tuple[ReceiverState, Mapping[str, np.ndarray]]:
        """Return the receiver's state after the epochs of `columns`, and `columns` with verdicts and positions added.

        The epochs begin at epoch `first`, and `state` is the receiver's state before this epoch. `columns` has at least
        the columns of `measure`.
        """
        n = columns["time_s"].size
        measured = measured_block(self._judged, first + np.arange(n, dtype=np.int64), columns)
        block, after = self._judged.processor.assess(state, measured, self._receiver.assistance)
        found = judged_columns(block)
        if self.scenario.constellation:
            found |= fix_columns(self.scenario, block, columns)
        return after, {
            **columns,
            **{name: np.ascontiguousarray(values, dtype=self.columns[name].dtype) for name, values in found.items()},
        }

    def _detections(self, measured: MeasurementBlock) -> dict[str, np.ndarray]:
        """Return the result of each detector on the correlator banks."""
        correlated = measured.availability == Availability.CORRELATED
        found = [
            replace(self._judged.processor, detector=detector()).detect(measured.banks, correlated)
            for detector in self.scenario.processor.detectors.values()
        ]
        return {
            "tap_index": np.stack([block.tap for block in found]),
            "magnitude_sigma": np.stack([block.magnitude_sigma for block in found]),
            "phase_rad": np.stack([block.phase_rad for block in found]),
            "range_offset_m": np.stack([block.range_offset_m for block in found]),
        }

    def _front_end(self, snapshots: SnapshotBlock) -> dict[str, np.ndarray]:
        """Return power, gain and saturation of the E6 front end; unknown values are NaN or −1."""
        unknown = np.full(len(snapshots.time), np.nan)
        sampled = self.scenario.fidelity == "samples"
        if not (sampled or self._receiver.with_taps or self.scenario.processor.checks):
            return {"e6_total_power_db": unknown, "e6_agc_gain_db": unknown, "e6_saturated": np.full(unknown.size, -1)}
        said: FrontEndBlock = snapshots.front_end[Band.E6]
        clips = np.where(np.isnan(said.total_power_db), -1, said.saturated)
        return {
            "e6_total_power_db": said.total_power_db if sampled else unknown,
            "e6_agc_gain_db": said.agc_gain_db,
            "e6_saturated": clips if sampled else np.full(unknown.size, -1),
        }


class _Preparation:
    """Simulation of the truth in order of epochs; the truth is the input of `measure`."""

    def __init__(self, truth: tuple[TruthProcess | TruthAround, ...]) -> None:
        self._truth = truth

    def advance(self, first: int, count: int) -> Mapping[str, Any]:
        with blamed_on_own_parts():
            return {"truth": tuple(one.advance(first, count) for one in self._truth)}


def _side_by_side(each: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return the columns of all satellites, stacked from `each`, which has the columns of every single satellite.

    Columns of the receiver have no satellite axis, so these columns are taken from the first satellite.
    """
    return {
        name: first if name in _OF_RECEIVER else np.stack([values[name] for values in each], axis=1)
        for name, first in each[0].items()
    }


_OF_RECEIVER = frozenset(name for name, column in SCENARIO_COLUMNS.items() if "satellite" not in column.dims)


def _truth_columns(truth: TruthBlock, e1_multipath_m: Float[np.ndarray, " n"]) -> dict[str, np.ndarray]:
    return {
        "truth_range_m": truth.range_m,
        "truth_clock_m": truth.clock_m,
        "truth_clock_drift_mps": truth.clock_drift_mps,
        "truth_iono_diff_m": truth.iono_diff_m,
        "truth_e1_noise_m": truth.e1_noise_m,
        "truth_e1_phase_noise_m": truth.e1_phase_noise_m,
        "truth_e1_rate_noise_mps": truth.e1_rate_noise_mps,
        "truth_e1_multipath_m": e1_multipath_m,
        "truth_bias_m": truth.bias_m,
        "truth_ray_delay_m": truth.rays.delay_m,
        "truth_ray_amplitude": truth.rays.amplitude,
        "truth_ray_doppler_hz": truth.rays.doppler_hz,
    }
