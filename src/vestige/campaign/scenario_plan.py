"""A campaign scenario as a plan: truth in order, banks and detection on any worker, both detectors on equal banks."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vestige.acas_processor.detection_block import DetectionBlock, detect_block
from vestige.acas_processor.detectors import DETECTORS
from vestige.acas_processor.levels import combine
from vestige.acas_processor.minimum_defence import Limits, minimum_block
from vestige.acas_processor.thresholds import probability_of_detection, threshold
from vestige.campaign.attack_columns import ATTACK_COLUMNS, attack_columns, attack_coords, e1_cn0_dbhz
from vestige.campaign.level_columns import LEVEL_COLUMNS, level_columns
from vestige.campaign.origin import PROCESSOR, processor_name
from vestige.campaign.osnma_columns import keys_received
from vestige.campaign.plan import Column, Coord
from vestige.campaign.rinex_export import NAVIGATION_TEXT
from vestige.campaign.sky_columns import E1_COLUMNS, SKY_COLUMNS, e1_columns, e1_coords, sky_columns, sky_coords
from vestige.receiver.simulation import NOT_RECEIVED, Banks, Simulation
from vestige.receiver.truth import TruthBlock, TruthProcess
from vestige.recording.rinex_navigation import rinex_navigation_text
from vestige.records import FrontEndStatus, Status
from vestige.scenario.campaign import CampaignScenario
from vestige.signals.definitions import E6C

_EPOCH, _SATELLITE = ("epoch",), ("epoch", "satellite")
_TAPS, _RAYS, _FOUND = ("epoch", "satellite", "tap"), ("epoch", "satellite", "ray"), ("detector", "epoch", "satellite")
_FLAGS = {
    "status": {"flag_values": list(range(len(Status))), "flag_meanings": " ".join(status.name for status in Status)},
    "e6_saturated": {"flag_values": [-1, 0, 1], "flag_meanings": "no_samples no yes"},
}

# name: dims, dtype, units, meaning
COLUMNS = {
    name: Column(dims=dims, dtype=dtype, units=units, long_name=text, attrs=_FLAGS.get(name, {}))
    for name, dims, dtype, units, text in (
        ("time_s", _EPOCH, "float64", "s", "time of transmission after the start"),
        ("taps", _TAPS, "complex64", "1", "correlator output"),
        ("noise_power", _SATELLITE, "float32", "1", "mean squared magnitude of noise in a correlator"),
        ("tap_index", _FOUND, "int8", "1", "index of the detecting correlator, -1 for none"),
        ("magnitude_sigma", _FOUND, "float32", "1", "magnitude of the detecting correlator in standard deviations"),
        ("phase_rad", _FOUND, "float32", "rad", "phase of the detecting correlator"),
        ("range_offset_m", _FOUND, "float32", "m", "measured minus predicted E6 range"),
        ("status", _SATELLITE, "int8", "1", "verdict"),
        ("e6_total_power_db", _EPOCH, "float32", "dB", "power of the E6 samples over that of noise alone"),
        ("e6_agc_gain_db", _EPOCH, "float32", "dB", "gain of the E6 front end over that for noise alone"),
        ("e6_saturated", _EPOCH, "int8", "1", "whether the E6 quantiser clips"),
        ("truth_range_m", _SATELLITE, "float64", "m", "geometric range"),
        ("truth_clock_m", _EPOCH, "float64", "m", "receiver clock"),
        ("truth_clock_drift_mps", _EPOCH, "float64", "m s-1", "receiver clock drift"),
        ("truth_iono_diff_m", _SATELLITE, "float64", "m", "differential ionosphere, E6 later"),
        ("truth_e1_noise_m", _SATELLITE, "float64", "m", "noise of the E1 pseudorange"),
        ("truth_e1_phase_noise_m", _SATELLITE, "float64", "m", "noise of the E1 carrier phase times the wavelength"),
        ("truth_e1_rate_noise_mps", _SATELLITE, "float64", "m s-1", "noise of the range rate from the E1 Doppler"),
        ("truth_e1_multipath_m", _SATELLITE, "float64", "m", "multipath error of the E1 pseudorange"),
        ("truth_bias_m", _SATELLITE, "float64", "m", "group delay and hardware residual, E6 later"),
        ("truth_ray_delay_m", _RAYS, "float64", "m", "excess delay of a ray"),
        ("truth_ray_amplitude", _RAYS, "complex64", "1", "amplitude of a ray over the line of sight, on E6"),
        ("truth_ray_doppler_hz", _RAYS, "float64", "Hz", "Doppler of a ray over the line of sight, on E6"),
    )
}


@dataclass(frozen=True, kw_only=True)
class ScenarioPlan:
    """A campaign scenario, ready to run.

    Attributes
    ----------
    scenario
        The scenario with all defaults filled in.
    """

    scenario: CampaignScenario

    @property
    def simulations(self) -> tuple[Simulation, ...]:
        """The receiver, once for each of its satellites."""
        return self.scenario.simulations

    @property
    def n_epochs(self) -> int:
        """How many epochs there are."""
        return self.scenario.epochs

    @property
    def columns(self) -> Mapping[str, Column]:
        """The variables of the results."""
        attack = ATTACK_COLUMNS if self.scenario.attack else {}
        if self.scenario.constellation:
            return COLUMNS | attack | SKY_COLUMNS | LEVEL_COLUMNS
        return COLUMNS | attack | (E1_COLUMNS | LEVEL_COLUMNS if self.scenario.processor.level > 1 else {})

    @property
    def coords(self) -> Mapping[str, Coord]:
        """The axes other than `epoch`."""
        simulation = self.simulations[0]
        svids = np.array([one.svid for one in self.simulations])
        offsets_m = simulation.processor.offsets_m
        rays = np.arange(simulation.models.n_rays)
        return (
            {
                "svid": Coord(dim="satellite", values=svids, units="1", long_name="satellite"),
                "tap_offset_m": Coord(dim="tap", values=offsets_m, units="m", long_name="offset from the prediction"),
                "detector": Coord(dim="detector", values=np.array(list(DETECTORS)), units="1", long_name="detector"),
                "ray": Coord(dim="ray", values=rays, units="1", long_name="ray beside the line of sight"),
            }
            | attack_coords(simulation)
            | (sky_coords() if self.scenario.constellation else {})
            | ({} if "e1_taps" not in self.columns else e1_coords())
        )

    @property
    def attrs(self) -> Mapping[str, Any]:
        """What identifies the work."""
        text = self.scenario.model_dump_json()
        processor = self.scenario.processor
        receiver = self.scenario.receiver
        return {
            "scenario": text,
            "scenario_digest": hashlib.sha256(text.encode()).hexdigest(),
            "seed": self.scenario.seed,
            "p_fa": processor.p_fa,
            "threshold_sigma": float(threshold(processor.p_fa)),
            "signal": receiver.signal,
            **({"cn0_dbhz": receiver.cn0_dbhz} if receiver.signal else {}),
            "integration_s": self.simulations[0].n_chips / E6C.chip_rate_hz,
            "fidelity": self.scenario.fidelity,
            **({PROCESSOR: processor_name()} if self.scenario.fidelity == "samples" else {}),
            **({NAVIGATION_TEXT: self._navigation()} if self.scenario.constellation else {}),
        }

    def _navigation(self) -> str:
        """Return the ephemerides of the satellites, so that results do not depend on a file that may be gone."""
        paths = [one.elevation.path for one in self.simulations if one.elevation is not None]
        return rinex_navigation_text(path.ephemeris for path in paths)

    def prepare(self) -> _Preparation:
        """Return the truth at its beginning."""
        return _Preparation(tuple(simulation.truth() for simulation in self.simulations))

    def measure(self, first: int, inputs: Mapping[str, Any]) -> Mapping[str, np.ndarray]:
        """Return every column for the epochs from `first` on."""
        truths = inputs["truth"]
        n = truths[0].time_s.size
        with_key = keys_received(self.scenario, truths) if self.scenario.constellation else np.ones(n, bool)
        each = [
            self._satellite(simulation, first, truth, with_key)
            for simulation, truth in zip(self.simulations, truths, strict=True)
        ]
        own = each[0].keys()
        together = {
            name: np.stack([values[name] for values in each], axis=column.dims.index("satellite"))
            if "satellite" in column.dims
            else each[0][name]
            for name, column in self.columns.items()
            if name in own
        }
        together |= _one_front_end(each)
        if self.scenario.constellation:
            together |= sky_columns(self.scenario, first, truths, together) | {"osnma_key": with_key}
        elif self.scenario.processor.level > 1:
            cn0_dbhz = e1_cn0_dbhz(self.simulations[0], truths[0])[:, None]
            e1 = e1_columns(self.scenario, first, truths, truths[0].view.in_view[:, None])
            together |= {"e1_cn0_dbhz": cn0_dbhz} | e1
        if "e6_power_db" in self.columns:
            together |= level_columns(
                self.simulations,
                first,
                truths,
                every=self.scenario.recs.every,
                total_power_db=together["e6_total_power_db"],
            )
        return {name: np.ascontiguousarray(together[name], dtype=column.dtype) for name, column in self.columns.items()}

    def _satellite(
        self, simulation: Simulation, first: int, truth: TruthBlock, with_key: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Return the columns of one satellite, without its axis; nothing is correlated without the epoch's key."""
        taps, noise_power, front_end = self._banks(simulation, first, truth)
        taps[~with_key], noise_power[~with_key] = np.nan, np.nan
        spacing = self.scenario.processor.spacing
        found = {
            name: detect_block(
                taps,
                noise_power,
                simulation.processor.offsets_m,
                detector=detector(spacing=spacing),
                threshold_sigma=float(threshold(simulation.processor.p_fa)),
            )
            for name, detector in DETECTORS.items()
        }
        values = (
            _truth_columns(truth, simulation)
            | _front_end_columns(front_end, truth.time_s.size)
            | {
                "taps": taps,
                "noise_power": noise_power,
                "tap_index": np.stack([block.tap for block in found.values()]),
                "magnitude_sigma": np.stack([block.magnitude_sigma for block in found.values()]),
                "phase_rad": np.stack([block.phase_rad for block in found.values()]),
                "range_offset_m": np.stack([block.range_offset_m for block in found.values()]),
                "status": self._status(
                    simulation, truth, found[self.scenario.processor.detector], ~np.isnan(noise_power)
                ),
            }
        )
        if self.scenario.attack:
            values |= attack_columns(simulation, truth)
        return values

    def _banks(self, simulation: Simulation, first: int, truth: TruthBlock) -> Banks:
        """Return the banks of all epochs, NaN in those without RECS."""
        every, n = self.scenario.recs.every, truth.time_s.size
        if every == 1:
            return simulation.banks(self.scenario.fidelity, first, truth)
        rows = slice(-first % every, n, every)
        taps, noise_power = np.full((n, simulation.processor.n_taps), np.nan + 0j), np.full(n, np.nan)
        statuses = [NOT_RECEIVED] * n
        if rows.start >= n:
            return Banks(taps, noise_power, tuple(statuses) if self.scenario.fidelity == "samples" else None)
        some = simulation.banks(self.scenario.fidelity, (first + rows.start) // every, truth.part(rows))
        taps[rows], noise_power[rows] = some.taps, some.noise_power
        if some.front_end is None:
            return Banks(taps, noise_power, None)
        statuses[rows] = some.front_end
        return Banks(taps, noise_power, tuple(statuses))

    def _status(
        self, simulation: Simulation, truth: TruthBlock, found: DetectionBlock, correlated: np.ndarray
    ) -> np.ndarray:
        processor = simulation.processor
        expected_dbhz, place = np.unique(e1_cn0_dbhz(simulation, truth) + processor.e6_over_e1_db, return_inverse=True)
        integration_s = simulation.n_chips / E6C.chip_rate_hz
        predicted_pd = probability_of_detection(expected_dbhz, integration_s, processor.p_fa)[place]
        limits = Limits(budget=processor.budget, kappa=processor.kappa, min_pd=processor.min_pd)
        failed, available = minimum_block(found.tap >= 0, found.range_offset_m, predicted_pd, limits)
        status = combine(1, failed, available[:, None])[0][:, 0]
        return np.where(correlated, status, list(Status).index(Status.NOT_AVAILABLE))


class _Preparation:
    """The truth, epoch after epoch, as inputs of `measure`."""

    def __init__(self, truth: tuple[TruthProcess, ...]) -> None:
        self._truth = truth

    def advance(self, first: int, count: int) -> Mapping[str, Any]:
        return {"truth": tuple(one.advance(first, count) for one in self._truth)}


def _truth_columns(truth: TruthBlock, simulation: Simulation) -> dict[str, np.ndarray]:
    return {
        "time_s": truth.time_s,
        "truth_range_m": truth.range_m,
        "truth_clock_m": truth.clock_m,
        "truth_clock_drift_mps": truth.clock_drift_mps,
        "truth_iono_diff_m": truth.iono_diff_m,
        "truth_e1_noise_m": truth.e1_noise_m,
        "truth_e1_phase_noise_m": truth.e1_phase_noise_m,
        "truth_e1_rate_noise_mps": truth.e1_rate_noise_mps,
        "truth_e1_multipath_m": simulation.e1_multipath_m(truth),
        "truth_bias_m": truth.bias_m,
        "truth_ray_delay_m": truth.rays.delay_m,
        "truth_ray_amplitude": truth.rays.amplitude,
        "truth_ray_doppler_hz": truth.rays.doppler_hz,
    }


def _front_end_columns(statuses: tuple[FrontEndStatus, ...] | None, n: int) -> dict[str, np.ndarray]:
    """Return what the front end said in each of `n` epochs; nothing at the fidelity without samples."""
    if statuses is None:
        unknown = np.full(n, np.nan)
        return {"e6_total_power_db": unknown, "e6_agc_gain_db": unknown, "e6_saturated": np.full(n, -1)}
    return {
        "e6_total_power_db": np.array([status.total_power_db for status in statuses]),
        "e6_agc_gain_db": np.array([status.agc_gain_db for status in statuses]),
        "e6_saturated": np.array([-1 if status is NOT_RECEIVED else status.saturated for status in statuses]),
    }


def _one_front_end(each: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return what the front end said around the RECS of all satellites: mean power and gain, whether any clipped."""
    if len(each) == 1:
        return {}
    together = {
        name: _mean(np.stack([values[name] for values in each])) for name in ("e6_total_power_db", "e6_agc_gain_db")
    }
    return together | {"e6_saturated": np.max([values["e6_saturated"] for values in each], axis=0)}


def _mean(values: np.ndarray) -> np.ndarray:
    """Return the mean over the first axis of what is not NaN."""
    known = np.isfinite(values)
    count = np.count_nonzero(known, axis=0)
    return np.where(count > 0, np.sum(np.where(known, values, 0.0), axis=0) / np.maximum(count, 1), np.nan)
