"""What a recorder writes: the samples of one band with all its satellites, as long as one likes.

Theory of operation
-------------------
**Stretches.** A band is made in stretches of some 10 ms, whole blocks of the synthesis kernel. About the middle t_m of
a stretch the pseudorange is P + v x + ½ a x²: what the third derivative j adds within 5 ms, j x³/6, is below a
micrometre for any receiver on Earth. The chip that arrives at t_m is counted from the Galileo second in integers; it
arrives x after t_m, where t − P(t)/c is the time at which it was sent. Stretches are cut on the sample counter, so
any recording of the same scenario has the same bits where it overlaps another.

**Group delay.** What differs between the bands (ionosphere, biases) and the rays hold for a while and then change at
once. They move the code of the line of sight and not its carrier, so that a tracking loop is not thrown off: a carrier
has no group delay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Complex128, Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import Band, ChipSequence, SampleBatch
from vestige.signal_generator.rectangular import rectangular_parts
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.signal_generator.waveform import Component
from vestige.signals.definitions import CARRIER_HZ
from vestige.signals.rotator_kernel import BLOCK
from vestige.time import GalileoTime

STRETCH_S = 0.01
_MARGIN_S = 2e-5  # of chips on both sides of a stretch: 6 km, for rays and group delay


@runtime_checkable
class Pseudorange(Protocol):
    """Pseudorange against receiver time in s after the reference, with its derivatives."""

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return P(t) in m."""
        ...

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return dP/dt in m/s."""
        ...

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return d²P/dt² in m/s²."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagation:
    """What holds for a while between satellite and receiver."""

    delay_m: float  # group delay of the line of sight beyond the pseudorange, in m
    at_s: float  # receiver time after the reference at which all amplitudes hold
    ray_delay_m: Float[np.ndarray, " n_rays"]  # excess delay against the line of sight
    ray_amplitude: Complex128[np.ndarray, " n_rays"]  # relative to the line of sight
    ray_doppler_hz: Float[np.ndarray, " n_rays"]  # relative to the line of sight
    amplitude: complex = 1.0 + 0j  # of the line of sight, beyond its C/N0; 0 is nothing on air
    doppler_hz: float = 0.0  # of the line of sight, beyond that of its pseudorange


def straight(delay_m: float = 0.0) -> Propagation:
    """Return a line of sight alone."""
    nothing = np.zeros(0)
    return Propagation(
        delay_m=delay_m, at_s=0.0, ray_delay_m=nothing, ray_amplitude=nothing + 0j, ray_doppler_hz=nothing
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedSatellite:
    """One satellite in one band."""

    svid: int
    components: tuple[Component, ...]  # its components in the band, counted from the reference
    cn0_dbhz: float  # C/N0 of each of them
    pseudorange: Pseudorange  # P(t), which moves code and carrier
    propagation: Callable[[float], Propagation]  # what holds at a receiver time in s after the reference


def stretch_samples(sample_rate_hz: float) -> int:
    """Return the number of samples of a stretch."""
    return BLOCK * max(1, round(STRETCH_S * sample_rate_hz / BLOCK))


def record_band(
    band: Band,
    sky: tuple[ReceivedSatellite, ...],
    *,
    reference: GalileoTime,
    sample_rate_hz: float,
    first_sample: int = 0,
    n_samples: int,
    noise_key: np.uint64 | None,
    noise_power: Callable[[float], float] = lambda _: 1.0,
) -> Iterator[SampleBatch]:
    """Yield the samples of one band as batches in time order; the receiver's noise has variance 1 a sample.

    `reference` is the receiver-clock time of sample 0, a whole second. Without `noise_key` there is no noise;
    `noise_power` is its variance with interference as white, against receiver time in s after the reference.
    """
    if reference.fraction:
        raise ValueError(f"the reference must be a whole second, not {reference}")
    carrier_hz, length = CARRIER_HZ[band], stretch_samples(sample_rate_hz)
    first, end = first_sample, first_sample + n_samples
    while first < end:
        number = first // length
        last = min(end, (number + 1) * length)
        middle = number * length + length // 2
        whole, fraction = _seconds(middle, sample_rate_hz)
        signals = tuple(
            signal
            for satellite in sky
            for signal in _signals(
                satellite, reference, whole, fraction, length / 2 / sample_rate_hz, carrier_hz, sample_rate_hz
            )
        )
        samples = synthesize(
            signals,
            sample_rate_hz=sample_rate_hz,
            n_samples=last - first,
            noise_key=noise_key,
            noise_power=noise_power(whole + fraction),
            first_sample=first,
            origin_sample=middle,
            carrier_hz=carrier_hz,
            center_frequency_hz=carrier_hz,
        )
        start_whole, start_fraction = _seconds(first, sample_rate_hz)
        yield SampleBatch(
            band=band,
            samples=samples,
            sample_rate_hz=sample_rate_hz,
            center_frequency_hz=carrier_hz,
            first_sample=first,
            start=GalileoTime.normalized(reference.week, reference.second + start_whole, start_fraction),
        )
        first = last


def _seconds(sample: int, sample_rate_hz: float) -> tuple[int, float]:
    """Return the time of a sample as whole seconds and the rest, which float64 alone would round to 15 ps in a day."""
    time = Fraction(sample) / Fraction(sample_rate_hz)
    whole = time.numerator // time.denominator
    return whole, float(time - whole)


def _signals(
    satellite: ReceivedSatellite,
    reference: GalileoTime,
    whole: int,
    fraction: float,
    half_s: float,
    carrier_hz: float,
    sample_rate_hz: float,
) -> Iterator[ReceivedSignal]:
    """Yield the rectangular parts of a satellite over `half_s` on both sides of t_m = `whole` + `fraction`."""
    middle = np.array([whole + fraction])
    path = satellite.pseudorange
    range_m, rate_mps = float(path.range_m(middle)[0]), float(path.rate_mps(middle)[0])
    acceleration_mps2 = float(path.acceleration_mps2(middle)[0])
    held = satellite.propagation(float(middle[0]))
    if not held.amplitude:
        return
    sent_s = fraction - (range_m + held.delay_m) / SPEED_OF_LIGHT_MPS  # after the whole second
    for component in satellite.components:
        rate_hz = component.signal.chip_rate_hz
        chip = int(np.floor(sent_s * rate_hz))
        lead = int(np.ceil((half_s + _MARGIN_S) * rate_hz))
        late_s = (chip / rate_hz - sent_s) / (1.0 - rate_mps / SPEED_OF_LIGHT_MPS)
        cycles = carrier_hz / SPEED_OF_LIGHT_MPS * (range_m + rate_mps * late_s)
        strength = amplitude(satellite.cn0_dbhz, sample_rate_hz) * np.exp(-2j * np.pi * (cycles - np.floor(cycles)))
        dopplers_hz = np.concatenate([[held.doppler_hz], held.ray_doppler_hz])
        turns = dopplers_hz * (float(middle[0]) + late_s - held.at_s)
        rays = np.concatenate([[held.amplitude], held.ray_amplitude]) * np.exp(2j * np.pi * (turns - np.floor(turns)))
        first = GalileoTime.normalized(reference.week, reference.second + whole, (chip - lead) / rate_hz)
        for part in rectangular_parts(component, chip + whole * round(rate_hz) - lead, 2 * lead):
            yield ReceivedSignal(
                chips=ChipSequence(
                    svid=satellite.svid,
                    transmit_time=first,
                    chip_rate_hz=rate_hz * part.per_chip,
                    chips=part.chips,
                ),
                start_s=late_s,
                doppler_hz=-carrier_hz / SPEED_OF_LIGHT_MPS * rate_mps,
                doppler_rate_hz_per_s=-carrier_hz / SPEED_OF_LIGHT_MPS * acceleration_mps2,
                delay_m=np.concatenate([[0.0], held.ray_delay_m]),
                amplitude=part.weight * strength * rays,
                ray_doppler_hz=dopplers_hz,
                lead_chips=part.per_chip * lead,
            )
