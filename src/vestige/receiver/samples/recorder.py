"""Make the samples of all satellites in one band, for any length of time.

Theory of operation
-------------------
**Stretches.** The samples of a band are made in stretches of about 10 ms, a whole number of blocks of the synthesis
kernel. Around the middle t_m of a stretch the pseudorange is P(t_m + x) = P(t_m) + v x + ½ a x². v and a are the rate
and the acceleration of the pseudorange at t_m. The neglected term j x³/6 of the third derivative j is less than a
micrometre within 5 ms of t_m for j below 48 m/s³. The chip that arrives at the time t was sent at t − P(t)/c. Chips are
counted in integers from the reference, which is a whole second. Each stretch begins at a fixed number of the sample
counter, so two recordings of the same scenario have the same bits where they overlap.

**Propagation.** All effects in addition to the pseudorange are computed once per stretch. A group delay moves the code
of all paths and not the carrier. The ionosphere delays the code and advances the carrier. The delay of the code changes
over a stretch with its rate in the middle of the stretch, so that no step disturbs a tracking loop. The excess delays
of reflections are constant over a stretch. The amplitude of a spoofing signal changes in steps of a block of the
synthesis kernel.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import islice
from threading import Lock
from typing import Protocol

import numpy as np
from jaxtyping import Complex64, Complex128, Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.records import Band, FrontEndStatus, SampleBatch
from vestige.signal_generator.levels import BandModulation
from vestige.signal_generator.noise_kernel import fill_normals, noise_key
from vestige.signal_generator.path_kernel import add_path
from vestige.signal_generator.range_model import RangeHistory
from vestige.signal_generator.synthesis import SIGMA, amplitude
from vestige.signal_generator.waveform import Component
from vestige.signals.definitions import CARRIER_HZ
from vestige.signals.rotator_kernel import BLOCK
from vestige.time import GalileoTime

STRETCH_S = 0.01
_NOISE = {Band.E1: 61, Band.E6: 66}  # stream numbers
_AHEAD = 8  # number of stretches that are being made or wait for the consumer
_TOGETHER = 20  # number of stretches whose geometry is computed together
_MARGIN_S = 2e-5  # duration of chips on either side of a stretch: 6 km, for reflections and group delay


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagation:
    """Effects of the propagation that the pseudorange does not contain, around the middle of a stretch."""

    delay_m: float  # group delay of the line of sight in addition to the pseudorange, in m
    at_s: float  # receiver time of all amplitudes, in s after the reference
    ray_delay_m: Float[np.ndarray, " n_rays"]  # excess delay relative to the line of sight in m
    ray_amplitude: Complex128[np.ndarray, " n_rays"]  # amplitude relative to the line of sight
    ray_doppler_hz: Float[np.ndarray, " n_rays"]  # Doppler relative to the line of sight in Hz
    amplitude: complex = 1.0 + 0j  # amplitude of the line of sight, in addition to its C/N0; 0 means no signal
    growth_per_s: float = 0.0  # relative growth of `amplitude` per s
    doppler_hz: float = 0.0  # Doppler of the line of sight in Hz, in addition to the Doppler of its pseudorange
    doppler_rate_hz_per_s: float = 0.0  # rate of all Dopplers, in addition to the rate from the pseudorange
    delay_rate_mps: float = 0.0  # rate of the group delay in m/s


def straight(delay_m: float = 0.0) -> Propagation:
    """Return the propagation of a line of sight without reflections."""
    nothing = np.zeros(0)
    return Propagation(
        delay_m=delay_m, at_s=0.0, ray_delay_m=nothing, ray_amplitude=nothing + 0j, ray_doppler_hz=nothing
    )


class Interference(Protocol):
    """Noise and jamming in one band, as functions of receiver time in s after the reference."""

    def white(self, t_s: float) -> float:
        """Return the density of the added white noise, relative to the receiver's own noise."""

    def jam(self, samples: Complex64[np.ndarray, " n"], t_s: float, first_sample: int, sample_rate_hz: float) -> None:
        """Add the jamming waveforms around the time `t_s` to samples, which begin at number `first_sample`."""


@dataclass(frozen=True, kw_only=True)
class ReceivedSatellite:
    """The signals of one satellite in one band, as the recorder receives them."""

    svid: int
    components: tuple[Component, ...]  # components in the band; their chips are counted from the reference
    cn0_dbhz: float  # C/N0 of each component
    pseudorange: RangeHistory  # P(t), which moves code and carrier, at receiver times in s after the reference
    propagation: Callable[[float], Propagation]  # propagation at a receiver time in s after the reference

    @cached_property
    def modulation(self) -> BandModulation:
        """Modulation of the satellite's signals in the band."""
        return BandModulation(components=self.components)


def stretch_samples(sample_rate_hz: float) -> int:
    """Return the number of samples of a stretch."""
    return BLOCK * max(1, round(STRETCH_S * sample_rate_hz / BLOCK))


@dataclass(frozen=True, kw_only=True)
class BandRecorder:
    """Recorder that makes the samples of one band, stretch by stretch.

    All signals are summed at the antenna, where the receiver's noise has variance 1 per sample. The sum goes through
    one front end: filter, gain control over a stretch, quantiser. With a quantiser the samples are its integer levels.
    """

    band: Band
    sky: tuple[ReceivedSatellite, ...]  # all satellites that the band receives
    reference: GalileoTime  # receiver-clock time of sample 0, a whole second
    front_end: FrontEnd  # front end and its sampling rate; a filter or oversampling makes the recorder slower
    noise_key: np.uint64 | None  # key of the noise generator; None for no noise
    interference: Interference | None = None  # noise and jamming; None for no interference

    def __post_init__(self) -> None:
        if self.reference.fraction:
            raise ValueError(f"the reference must be a whole second, not {self.reference}")

    @property
    def length(self) -> int:
        """Number of samples of a stretch."""
        return stretch_samples(self.front_end.sample_rate_hz)

    @cached_property
    def _middles(self) -> _Middles:
        return _Middles(length=self.length, sample_rate_hz=self.front_end.sample_rate_hz)

    def stretch(self, number: int) -> tuple[Complex64[np.ndarray, " n"], FrontEndStatus]:
        """Return the samples of a stretch and the status of the front end.

        The samples do not depend on the stretches that were made before. Sample 0 is the first sample of stretch 0.
        """
        front_end, input_hz = self.front_end, self.front_end.input_rate_hz
        begin, length = number * self.length, self.length
        whole, fraction = self._middles.time(number)
        first_input = begin * front_end.oversampling - front_end.margin_samples
        # middle of the stretch, as a number of input samples
        middle = (begin + length // 2) * front_end.oversampling - first_input
        x = np.zeros(2 * front_end.input_samples(length), np.float32)
        if self.noise_key is not None:
            white = 0.0 if self.interference is None else self.interference.white(whole + fraction)
            fill_normals(self.noise_key, np.int64(first_input), SIGMA * np.float32(np.sqrt(1.0 + white)), x)
        for satellite in self.sky:
            motion = self._middles.motion(satellite, number)
            _add(x, middle, satellite, motion, whole, fraction, CARRIER_HZ[self.band], input_hz)
        at_antenna = x.view(np.complex64)
        if self.interference is not None:
            self.interference.jam(at_antenna, whole + fraction, first_input, input_hz)
        return front_end.process(at_antenna)

    def batch(self, first: int, samples: Complex64[np.ndarray, " n"]) -> SampleBatch:
        """Return samples with their time; `first` is the number of the first sample."""
        whole, fraction = _seconds(first, self.front_end.sample_rate_hz)
        return SampleBatch(
            band=self.band,
            samples=samples,
            sample_rate_hz=self.front_end.sample_rate_hz,
            center_frequency_hz=CARRIER_HZ[self.band],
            first_sample=first,
            start=GalileoTime.normalized(self.reference.week, self.reference.second + whole, fraction),
        )


def record_band(
    band: Band,
    sky: tuple[ReceivedSatellite, ...],
    *,
    reference: GalileoTime,
    front_end: FrontEnd,
    first_sample: int = 0,
    n_samples: int,
    noise_key: np.uint64 | None,
    interference: Interference | None = None,
    pool: Executor | None = None,
) -> Iterator[SampleBatch]:
    """Yield the samples of one band as batches in time order.

    Each batch is a stretch, or the requested part of a stretch. The bits of a
    sample do not depend on `first_sample`, `n_samples` and `pool`.

    Parameters
    ----------
    band, sky, reference, front_end, noise_key, interference
        Attributes of `BandRecorder`.
    first_sample, n_samples
        Number of the first sample, and number of samples.
    pool
        Threads that make stretches in parallel; None to make them one after the other.
    """
    recorder = BandRecorder(
        band=band,
        sky=sky,
        reference=reference,
        front_end=front_end,
        noise_key=noise_key,
        interference=interference,
    )
    length, end = recorder.length, first_sample + n_samples

    def made(number: int) -> SampleBatch:
        begin = number * length
        first, last = max(begin, first_sample), min(begin + length, end)
        samples, _ = recorder.stretch(number)
        return recorder.batch(first, samples[first - begin : last - begin])

    numbers = iter(range(first_sample // length, -(-end // length)))
    if pool is None:
        yield from map(made, numbers)
        return
    waiting = deque(pool.submit(made, number) for number in islice(numbers, _AHEAD))
    try:
        while waiting:
            yield waiting.popleft().result()
            waiting.extend(pool.submit(made, number) for number in islice(numbers, 1))
    finally:
        for future in waiting:
            future.cancel()


def band_noise_key(seed: int, band: Band) -> np.uint64:
    """Return the key of the generator of the receiver's noise in a band.

    A recording and a campaign with a sky use the same key.
    """
    return noise_key(seed, 0, _NOISE[band])


class _Middles:
    """Middle times of the stretches and the motion of satellites at these times, for twenty stretches at once."""

    def __init__(self, *, length: int, sample_rate_hz: float) -> None:
        self._length, self._rate_hz = length, sample_rate_hz
        self._motion = dict[tuple[int, int], Float[np.ndarray, "3 n"]]()
        self._block: int | None = None  # number of the block whose times are in `_t_s`
        self._t_s = np.zeros(0)
        self._lock = Lock()

    def time(self, number: int) -> tuple[int, float]:
        """Return the time of the middle of a stretch, as whole seconds and the rest."""
        return _seconds(number * self._length + self._length // 2, self._rate_hz)

    def _times_s(self, block: int) -> Float[np.ndarray, " n"]:
        if self._block != block:
            self._block = block
            self._t_s = np.array([sum(self.time(block * _TOGETHER + k)) for k in range(_TOGETHER)])
        return self._t_s

    def motion(self, satellite: ReceivedSatellite, number: int) -> Float[np.ndarray, " 3"]:
        """Return pseudorange, rate and acceleration of a satellite in the middle of a stretch."""
        block, place = divmod(number, _TOGETHER)
        key = block, id(satellite)
        with self._lock:
            if key not in self._motion:
                self._motion = {known: motion for known, motion in self._motion.items() if known[0] >= block - 1}
                t_s = self._times_s(block)
                path = satellite.pseudorange
                rate_mps = path.rate_mps(t_s)  # The rate comes first, because its computation also gives the range.
                self._motion[key] = np.stack([path.range_m(t_s), rate_mps, path.acceleration_mps2(t_s)])
            return self._motion[key][:, place]


def _seconds(sample: int, sample_rate_hz: float) -> tuple[int, float]:
    """Return the time of a sample after sample 0 in whole seconds, and the remaining fraction of a second in s.

    A single float64 with both would have steps of 15 ps after a day.
    """
    time = Fraction(sample) / Fraction(sample_rate_hz)
    whole = time.numerator // time.denominator
    return whole, float(time - whole)


def _add(
    x: Float[np.ndarray, " n"],
    middle: int,
    satellite: ReceivedSatellite,
    motion: Float[np.ndarray, " 3"],
    whole: int,
    fraction: float,
    carrier_hz: float,
    sample_rate_hz: float,
) -> None:
    """Add a satellite with its paths to a stretch, whose sample number `middle` is at t_m = `whole` + `fraction`."""
    range_m, rate_mps, acceleration_mps2 = (float(value) for value in motion)
    held = satellite.propagation(whole + fraction)
    if not held.amplitude:
        return
    modulation, before = satellite.modulation, max(middle, x.size // 2 - middle)
    rate_hz, dt_s = modulation.rate_hz, 1.0 / sample_rate_hz
    sent_s = fraction - (range_m + held.delay_m) / SPEED_OF_LIGHT_MPS  # time of transmission after the whole second
    lead = int(np.ceil((before * dt_s + _MARGIN_S) * modulation.chip_rate_hz))
    first_chip = int(np.floor(sent_s * modulation.chip_rate_hz)) - lead
    levels = modulation.levels(first_chip + whole * round(modulation.chip_rate_hz), 2 * lead)
    cycles = carrier_hz / SPEED_OF_LIGHT_MPS * range_m
    strength = amplitude(satellite.cn0_dbhz, sample_rate_hz) * np.exp(-2j * np.pi * (cycles - np.floor(cycles)))
    dopplers_hz = held.doppler_hz + np.concatenate([[0.0], held.ray_doppler_hz])
    turns = dopplers_hz * (whole + fraction - held.at_s)
    rays = held.amplitude * np.concatenate([[1.0], held.ray_amplitude]) * np.exp(2j * np.pi * (turns - np.floor(turns)))
    to_hz = -carrier_hz / SPEED_OF_LIGHT_MPS
    for delay_m, ray, doppler_hz in zip([0.0, *held.ray_delay_m], rays, dopplers_hz, strict=True):
        if not ray:
            continue
        add_path(
            x,
            levels,
            middle,
            dt_s,
            (sent_s - delay_m / SPEED_OF_LIGHT_MPS) * rate_hz - first_chip * modulation.per_chip,
            rate_hz * (1.0 - (rate_mps + held.delay_rate_mps) / SPEED_OF_LIGHT_MPS),
            -rate_hz * acceleration_mps2 / SPEED_OF_LIGHT_MPS,
            complex(strength * ray),
            to_hz * rate_mps + doppler_hz,
            to_hz * acceleration_mps2 + held.doppler_rate_hz_per_s,
            held.growth_per_s,
        )
