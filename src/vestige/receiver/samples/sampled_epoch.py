"""Make the received E6 signal of an epoch, and the E6 samples around the RECS, at the `samples` fidelity.

The first chip of the RECS is sent at `sent` and arrives dt later along the line of sight. The travel time dt solves the
equation

    dt = P6(sent + dt)/c

Doppler and Doppler rate are computed for the time of arrival. P6 is the pseudorange of the code on E6. The carrier
phase at the arrival is −f6 L6/c cycles. L6 is P6 without bias and ionospheric delay, and less the ionospheric advance
of the carrier (`TruthBlock.carrier_advance_m`). The bias affects only the code. In a recording the carrier has the
phase −f6 L6/c in the middle of each RECS (`continuous`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from jaxtyping import Complex64, Complex128, Float

from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.crypto.osnma.operator.osnma_service import OsnmaService
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.truth import TruthBlock
from vestige.records import Band, ChipSequence, FrontEndStatus, SampleBatch
from vestige.signal_generator.range_model import RangeHistory
from vestige.signal_generator.synthesis import ReceivedSignal, synthesize
from vestige.signals.definitions import E6C
from vestige.streams import stream_key
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

# number of subframes that are broadcast before the run, because a key for ADKD 12 is sent 12 subframes after the data
SUBFRAMES_BEFORE = 12
# margin in s of the samples before the RECS (1.5 km), for taps, reflections and errors; the margin after the RECS is
# twice as long
_MARGIN_S = 5e-6


@dataclass(frozen=True, kw_only=True)
class Arrival:
    """Arrival of chips along the line of sight in E6: travel time, carrier range L6, range rate and acceleration."""

    dt_s: Float[np.ndarray, " n"]
    carrier_range_m: Float[np.ndarray, " n"]  # L6, the pseudorange of the carrier
    rate_mps: Float[np.ndarray, " n"]
    acceleration_mps2: Float[np.ndarray, " n"]

    @cached_property
    def carrier(self) -> Complex128[np.ndarray, " n"]:
        """Phasor of the carrier at the arrival, e^{−j2π f6 L6/c}."""
        cycles = E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * self.carrier_range_m
        return np.exp(-2j * np.pi * (cycles - np.floor(cycles)))


def arrival(line_of_sight: RangeHistory, truth: TruthBlock, rows: slice = slice(None), later_s: float = 0.0) -> Arrival:
    """Return the arrival of the chips that are sent `later_s` seconds after the epochs."""
    sent_s = truth.time_s[rows] + later_s
    late_m = truth.clock_m[rows] + truth.iono_diff_m[rows] + truth.bias_m[rows]
    code_only_m = truth.iono_diff_m[rows] + truth.bias_m[rows]
    drift_mps = truth.clock_drift_mps[rows]
    dt_s = np.zeros(sent_s.size)
    ahead_s = truth.geometry.clock_offset_s[rows]
    for _ in range(4):  # the range rate is below 1 km/s, so each iteration gains five decimals
        pseudorange_m = line_of_sight.range_m(sent_s + dt_s - ahead_s) + late_m + drift_mps * (later_s + dt_s)
        dt_s = pseudorange_m / SPEED_OF_LIGHT_MPS
    return Arrival(
        dt_s=dt_s,
        carrier_range_m=pseudorange_m - code_only_m - truth.carrier_advance_m(Band.E6)[rows],
        rate_mps=line_of_sight.rate_mps(sent_s + dt_s - ahead_s) + drift_mps,
        acceleration_mps2=line_of_sight.acceleration_mps2(sent_s + dt_s - ahead_s),
    )


def received_signal(
    chips: ChipSequence,
    arrived: Arrival,
    truth: TruthBlock,
    row: int,
    *,
    amplitude: float,
    later_s: float = 0.0,
) -> ReceivedSignal:
    """Return the received signal of the epoch in row `row` of a block: the line of sight and its reflections.

    The field `start_s` of the signal is in s after the epoch. The first chip is sent `later_s` seconds after the epoch.
    `arrived` is the arrival of this first chip.
    """
    to_hz, paths = -E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS, truth.rays.with_line_of_sight
    return ReceivedSignal(
        chips=chips,
        start_s=later_s + float(arrived.dt_s[row]),
        doppler_hz=to_hz * float(arrived.rate_mps[row]),
        doppler_rate_hz_per_s=to_hz * float(arrived.acceleration_mps2[row]),
        delay_m=paths.delay_m[row],
        amplitude=amplitude * complex(arrived.carrier[row]) * paths.amplitude[row],
        ray_doppler_hz=paths.doppler_hz[row],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Window of samples around a RECS."""

    expected_s: float  # time at which the receiver expects the first chip of the RECS, in s after transmission
    first: int  # number of the first output sample, counted at the output rate from the time of transmission
    n_samples: int  # number of output samples
    start_s: float  # start of the required input signals in s after transmission, including the margin of the filter
    stop_s: float  # end of the required input signals in s after transmission, including the margin of the filter


def recorded_until_s(expected_s: Float[np.ndarray, " n"], n_chips: int, front_end: FrontEnd) -> Float[np.ndarray, " n"]:
    """Return the end of the samples of each RECS, in s after the transmission of the RECS.

    `expected_s` is the time at which the receiver expects the first chip of each RECS, in s after the transmission.
    """
    first = np.floor((expected_s - _MARGIN_S) * front_end.sample_rate_hz)
    return (first + _n_samples(n_chips, front_end)) / front_end.sample_rate_hz


def _n_samples(n_chips: int, front_end: FrontEnd) -> int:
    return math.ceil((n_chips / E6C.chip_rate_hz + 3 * _MARGIN_S) * front_end.sample_rate_hz)


def window(expected_s: float, n_chips: int, front_end: FrontEnd) -> Window:
    """Return the window of samples around a RECS, from the expected start to the end of the RECS, with margins.

    `expected_s` is the time at which the receiver expects the first chip, in s after the transmission.
    """
    rate_hz = front_end.sample_rate_hz
    first = math.floor((expected_s - _MARGIN_S) * rate_hz)
    n_samples = _n_samples(n_chips, front_end)
    margin_s = front_end.margin_samples / front_end.input_rate_hz
    return Window(
        expected_s=expected_s,
        first=first,
        n_samples=n_samples,
        start_s=first / rate_hz - margin_s,
        stop_s=(first + n_samples) / rate_hz + margin_s,
    )


def recording_window(expected_s: float, n_chips: int, front_end: FrontEnd) -> range:
    """Return the numbers of the samples around a RECS in a recording.

    Sample 0 of the recording is at the scenario's start. `expected_s` is the time at which the receiver expects the
    first chip, in s after the scenario's start.
    """
    first = math.floor((expected_s - _MARGIN_S) * front_end.sample_rate_hz)
    return range(first, first + _n_samples(n_chips, front_end))


def e6_samples(
    signals: tuple[ReceivedSignal, ...],
    sent: GalileoTime,
    taken: Window,
    *,
    front_end: FrontEnd,
    noise_key: np.uint64 | None,
    noise_power: float = 1.0,
    jam: Callable[[Complex64[np.ndarray, " n"]], None] = lambda _: None,
) -> tuple[SampleBatch, FrontEndStatus]:
    """Return the E6 samples around the RECS of an epoch, and the status of the front end.

    The field `start_s` of a signal is in s after `sent`. `noise_power` is the power of the white noise, and the
    receiver's own noise has power 1. `jam` adds jamming waveforms to the samples at the front end's input rate.
    """
    rate_hz, input_hz = front_end.sample_rate_hz, front_end.input_rate_hz
    at_antenna = synthesize(
        signals,
        sample_rate_hz=input_hz,
        n_samples=front_end.input_samples(taken.n_samples),
        noise_key=noise_key,
        noise_power=noise_power,
        first_sample=-front_end.margin_samples,
        origin_s=taken.first / rate_hz,
    )
    jam(at_antenna)
    samples, status = front_end.process(at_antenna)
    batch = SampleBatch(
        band=Band.E6,
        samples=samples,
        sample_rate_hz=rate_hz,
        center_frequency_hz=E6_CARRIER_HZ,
        first_sample=taken.first,
        start=sent + taken.first / rate_hz,
    )
    return batch, status


def osnma_operator(seed: int, start: GalileoTime, subframes: int, service: OsnmaService) -> OsnmaOperator:
    """Return the OSNMA operator of a run, in its state before the first broadcast.

    The first broadcast is `SUBFRAMES_BEFORE` subframes before the run, so that the tags of the run's first subframes
    have data to cover.
    """
    first = start.subframe + -SUBFRAME_S * SUBFRAMES_BEFORE
    return service.operator(stream_key(seed, "OSNMA chain"), first, subframes + SUBFRAMES_BEFORE)


@lru_cache(maxsize=2)
def osnma_keys(seed: int, start: GalileoTime, subframes: int, service: OsnmaService) -> dict[GalileoTime, ValidatedKey]:
    """Return the OSNMA keys of a run by time of the key, each validated up to a signed root key."""
    return {key.time: key for key in osnma_operator(seed, start, subframes, service).validated_keys()}
