"""One epoch at the `samples` fidelity: the signal as it arrives, the E6 samples around it, what E1 tracking says.

The server sends at `sent`. The line of sight arrives dt later, the solution of

    dt = P6(sent + dt)/c

with the Doppler, its rate and the carrier phase −f6 P6/c of that moment.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Complex128, Float

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.crypto.simulated_chain import SimulatedChain, make_chain
from vestige.receiver.front_end import FrontEnd
from vestige.receiver.truth import TruthBlock
from vestige.records import Band, ChipSequence, E1Observation, FrontEndStatus, SampleBatch, ValidatedKey
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.synthesis import ReceivedSignal, synthesize
from vestige.signals.definitions import E6C
from vestige.streams import stream_key
from vestige.time import GalileoTime

_MARGIN_S = 5e-6  # of samples on both sides of the RECS: 1.5 km, for taps, rays and errors


def received_signal(
    chips: ChipSequence, line_of_sight: RangeModel, truth: TruthBlock, row: int, *, amplitude: float
) -> ReceivedSignal:
    """Return the line of sight and its rays as they arrive; `start_s` counts from the transmission of the first chip.

    Parameters
    ----------
    chips
        What the satellite sends.
    line_of_sight
        Range against time.
    truth, row
        The truth of a block, and the epoch's place in it.
    amplitude
        Of the line of sight.
    """
    t0, late_m = truth.time_s[row], truth.clock_m[row] + truth.iono_diff_m[row] + truth.bias_m[row]
    dt = 0.0
    for _ in range(4):  # P changes by < 1 km/s · 0.1 s: each step gains five decimals
        at = np.array([t0 + dt])
        pseudorange_m = float(line_of_sight.range_m(at)[0]) + late_m + truth.clock_drift_mps[row] * dt
        dt = pseudorange_m / SPEED_OF_LIGHT_MPS
    at = np.array([t0 + dt])
    to_hz = -E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    direct = amplitude * complex(carrier(np.array([pseudorange_m]))[0])
    return ReceivedSignal(
        chips=chips,
        start_s=dt,
        doppler_hz=to_hz * float(line_of_sight.rate_mps(at)[0] + truth.clock_drift_mps[row]),
        doppler_rate_hz_per_s=to_hz * float(line_of_sight.acceleration_mps2(at)[0]),
        delay_m=np.concatenate([[0.0], truth.rays.delay_m[row]]),
        amplitude=direct * np.concatenate([[1.0], truth.rays.amplitude[row]]),
        ray_doppler_hz=np.concatenate([[0.0], truth.rays.doppler_hz[row]]),
    )


def e6_samples(
    signals: tuple[ReceivedSignal, ...],
    sent: GalileoTime,
    *,
    arrival_s: float,
    n_chips: int,
    front_end: FrontEnd,
    noise_key: np.uint64,
) -> tuple[SampleBatch, FrontEndStatus]:
    """Return the E6 samples of an epoch, and what the front end says of itself.

    Parameters
    ----------
    signals
        All that is in the band, at the front end's input rate; `start_s` counts from `sent`.
    sent
        Time of transmission of the RECS.
    arrival_s
        Where the samples lie: from a little before `sent + arrival_s` to a little after the RECS has passed.
    n_chips
        Length of the RECS.
    front_end
        What they go through.
    noise_key
        Key of the noise.
    """
    rate_hz = front_end.sample_rate_hz
    first = int(np.floor((arrival_s - _MARGIN_S) * rate_hz))
    n_samples = int(np.ceil((n_chips / E6C.chip_rate_hz + 3 * _MARGIN_S) * rate_hz))
    at_antenna = synthesize(
        tuple(replace(signal, start_s=signal.start_s - first / rate_hz) for signal in signals),
        sample_rate_hz=front_end.input_rate_hz,
        n_samples=front_end.input_samples(n_samples),
        noise_key=noise_key,
        first_sample=-front_end.margin_samples,
    )
    samples, status = front_end.process(at_antenna)
    batch = SampleBatch(
        band=Band.E6,
        samples=samples,
        sample_rate_hz=rate_hz,
        center_frequency_hz=E6_CARRIER_HZ,
        first_sample=first,
        start=sent + first / rate_hz,
    )
    return batch, status


def observation(svid: int, truth: TruthBlock, row: int, *, error_m: float, cn0_dbhz: float) -> E1Observation:
    """Return what E1 tracking says at the time of transmission on the receiver's clock.

    Parameters
    ----------
    svid
        The satellite.
    truth, row
        The truth of a block, and the epoch's place in it.
    error_m
        Error of the pseudorange.
    cn0_dbhz
        C/N0 of E1-C.
    """
    to_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    rate_mps = truth.rate_mps[row] + truth.clock_drift_mps[row] + truth.e1_rate_noise_mps[row]
    return E1Observation(
        svid=svid,
        pseudorange_m=float(truth.range_m[row] + truth.clock_m[row] + error_m),
        carrier_phase_cycles=float("nan"),
        doppler_hz=float(to_hz * rate_mps),
        doppler_rate_hz_per_s=float(to_hz * truth.acceleration_mps2[row]),
        cn0_dbhz=cn0_dbhz,
    )


def carrier(pseudorange_m: Float[np.ndarray, " n"]) -> Complex128[np.ndarray, " n"]:
    """Return e^{−j2π f6 P/c}."""
    cycles = E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * pseudorange_m
    return np.exp(-2j * np.pi * (cycles - np.floor(cycles)))


@lru_cache(maxsize=2)
def osnma_chain(seed: int, start: GalileoTime, subframes: int) -> SimulatedChain:
    """Return the OSNMA chain of a run."""
    return make_chain(stream_key(seed, "OSNMA chain"), start, subframes)


@lru_cache(maxsize=2)
def osnma_keys(seed: int, start: GalileoTime, subframes: int) -> dict[GalileoTime, ValidatedKey]:
    """Return the OSNMA keys of a run by time, each validated down to a signed root key."""
    return {key.time: key for key in osnma_chain(seed, start, subframes).validated_keys()}
