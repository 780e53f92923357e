"""Track one satellite on E1 in a channel, from the acquisition to the loss of the signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Float32

from vestige.constants import E1_CARRIER_HZ
from vestige.errors import VestigeError
from vestige.records import SampleBatch
from vestige.sample_processor.e1_snapshot import E1Snapshot
from vestige.sample_processor.tracking.channel_kernel import (
    CHANNEL_STATE,
    CODE_LENGTH,
    CONSTANTS,
    LOST,
    PERIOD,
    track_channels,
)
from vestige.sample_processor.tracking.correlator_bank_kernel import (
    REMOVED_STEPS,
    bank_replicas,
    bank_vectors,
    segments_in_half_chip,
)
from vestige.sample_processor.tracking.loop_gains import loop_gains
from vestige.sample_processor.tracking.settings import (
    DLL_DISCRIMINATORS,
    PERIODS_PER_SECONDARY,
    PLL_DISCRIMINATORS,
    TrackingSettings,
)
from vestige.signals.codes import primary_code, secondary_code
from vestige.signals.definitions import E1B, E1C
from vestige.signals.pulse import BOC11, CBOC_MINUS, Pulse, band_limited_correlation

MAX_SPACING_CHIPS = 1 / 3  # largest distance of a correlator from the prompt: the end of BOC(1,1)'s main peak
# at a lower sampling rate, a correlator one sample from the prompt is outside the main peak
MIN_SAMPLE_RATE_HZ = E1C.chip_rate_hz / MAX_SPACING_CHIPS
_SLOPE_STEP_CHIPS = 1e-4


def correlator_lags(settings: TrackingSettings, sample_rate_hz: float) -> list[int]:
    """Return the positions of the correlators in samples from the prompt, in ascending order; positive is later.

    Parameters
    ----------
    settings
        Settings with the number of correlators and the requested distance from early to late.
    sample_rate_hz
        Sampling rate in Hz.

    Raises
    ------
    VestigeError
        If the early and the late correlator would lie outside the main peak: the rate is too low, or the requested
        distance is too large.

    Examples
    --------
    >>> correlator_lags(TrackingSettings(), 12.5e6)
    [-2, -1, 0, 1, 2]
    """
    samples_per_chip = sample_rate_hz / E1C.chip_rate_hz
    spacing = max(1, round(settings.early_late_chips / 2 * samples_per_chip))
    if spacing / samples_per_chip >= MAX_SPACING_CHIPS:
        raise VestigeError(
            f"E1 samples at {sample_rate_hz:g} Hz, with the early correlator {spacing / samples_per_chip:.2f} chips "
            f"from the prompt, cannot be tracked: expected less than {MAX_SPACING_CHIPS:.2f} chips, a rate above "
            f"{MIN_SAMPLE_RATE_HZ:.3g} Hz"
        )
    reach = settings.n_correlators // 2
    return [spacing * place for place in range(-reach, reach + 1)]


def code_discriminator_scale(settings: TrackingSettings, sample_rate_hz: float, bandwidth_hz: float) -> float:
    """Return the factor that turns the code discriminator over A² into the code error in chips, for small errors.

    E, P and L are the early, prompt and late correlator, and A is the amplitude of P. The discriminator is |L|² − |E|²
    or Re((L − E) P*), depending on the settings.

    Parameters
    ----------
    settings
        Settings with the early-late distance, the replica and the code discriminator.
    sample_rate_hz
        Sampling rate in Hz.
    bandwidth_hz
        Two-sided bandwidth in front of the correlators in Hz.
    """
    lags = correlator_lags(settings, sample_rate_hz)
    half = lags[len(lags) // 2 + 1] / sample_rate_hz * E1C.chip_rate_hz
    replica: Pulse = BOC11 if settings.replica == "BOC(1,1)" else CBOC_MINUS
    places = np.array([0.0, half - _SLOPE_STEP_CHIPS, half, half + _SLOPE_STEP_CHIPS])
    peak, before, there, after = band_limited_correlation(
        CBOC_MINUS, replica, places, chip_rate_hz=E1C.chip_rate_hz, bandwidth_hz=bandwidth_hz
    )
    slope = (after - before) / (2 * _SLOPE_STEP_CHIPS)
    strength = peak if settings.dll_discriminator == "dot product" else 2 * there
    return float(peak**2 / (-2 * strength * slope))


@dataclass(frozen=True, slots=True, eq=False)
class TrackedPeriods:
    """Measurements of a channel in consecutive code periods.

    Attributes
    ----------
    periods
        `PERIOD` record of each code period.
    banks
        complex64[period, correlator], correlators of E1-C without the secondary chip.
    """

    periods: np.ndarray
    banks: Complex64[np.ndarray, "n k"]


class Channel:
    """Tracking loops of one satellite on E1.

    Parameters
    ----------
    found
        Measurement of the acquired signal in `batch`. The channel starts at the first code period that begins in
        `batch`.
    batch
        Samples of the acquisition. Only rate, centre frequency, start time and counter of these samples are used.
    settings
        Settings of loops and correlators.
    bandwidth_hz
        Two-sided bandwidth of the front end in Hz; None for the sampling rate.

    Raises
    ------
    VestigeError
        If the sampling rate is too low or the early-late distance is too large for the correlators, or if a loop cannot
        have the requested bandwidth.

    Notes
    -----
    `run` takes consecutive samples. The channel stores no samples, only the state of the loops and the sums over
    the unfinished code period and integration.
    """

    def __init__(
        self,
        found: E1Snapshot,
        batch: SampleBatch,
        settings: TrackingSettings | None = None,
        *,
        bandwidth_hz: float | None = None,
    ) -> None:
        settings = settings or TrackingSettings()
        rate = batch.sample_rate_hz
        self.svid = found.svid
        self.lags = np.array(correlator_lags(settings, rate), np.int64)
        self._secondary = secondary_code(E1C, found.svid).astype(np.float64)
        codes = primary_code(E1C, found.svid), primary_code(E1B, found.svid)
        self._starts, self._slots = bank_vectors(self.lags)
        self._replicas = bank_replicas(*codes, settings.replica)
        self._constants = self._constants_of(settings, batch, bandwidth_hz or rate)
        self._state = self._start(found, batch)
        self._pilot, self._total = np.zeros((2, self.lags.size), np.complex128)

    def _constants_of(self, settings: TrackingSettings, batch: SampleBatch, bandwidth_hz: float) -> np.ndarray:
        interval_s = settings.integration_periods * E1C.period_s
        middle = self.lags.size // 2
        constants = np.zeros(1, CONSTANTS)
        for name, value in {
            "sample_rate_hz": batch.sample_rate_hz,
            "chip_rate_hz": E1C.chip_rate_hz,
            "carrier_hz": E1_CARRIER_HZ,
            "intermediate_hz": E1_CARRIER_HZ - batch.center_frequency_hz,
            "interval_s": interval_s,
            "periods": settings.integration_periods,
            "pll": loop_gains(settings.pll_order, settings.pll_bandwidth_hz, interval_s),
            "dll": loop_gains(1, settings.dll_bandwidth_hz, interval_s),
            "fll": loop_gains(1, settings.fll_bandwidth_hz, interval_s)[0],
            "code_scale": code_discriminator_scale(settings, batch.sample_rate_hz, bandwidth_hz),
            "phase_kind": PLL_DISCRIMINATORS.index(settings.pll_discriminator),
            "code_kind": DLL_DISCRIMINATORS.index(settings.dll_discriminator),
            "early": middle - 1,
            "prompt": middle,
            "late": middle + 1,
            "pull_in": max(2, round(settings.pull_in_s / interval_s)),
            "min_cn0_dbhz": settings.min_cn0_dbhz,
            "min_phase_lock": settings.min_phase_lock,
            "slip_phase_lock": settings.slip_phase_lock,
            "patience": round(settings.patience_s / (PERIODS_PER_SECONDARY * E1C.period_s)),
            "segments": segments_in_half_chip(settings.replica),
        }.items():
            constants[name] = value
        return constants

    def _start(self, found: E1Snapshot, batch: SampleBatch) -> np.ndarray:
        """Return the `CHANNEL_STATE` at the first code period that begins in the batch."""
        constants = self._constants[0]
        rate = E1C.chip_rate_hz * (1 + found.doppler_hz / E1_CARRIER_HZ) / batch.sample_rate_hz
        elapsed = (found.time - batch.start) * batch.sample_rate_hz
        phase = found.transmit_phase_s * E1C.chip_rate_hz - elapsed * rate  # code phase of the first sample
        period = int(np.ceil(phase / CODE_LENGTH))
        skipped = int(np.ceil((period * CODE_LENGTH - phase) / rate))
        state = np.zeros(1, CHANNEL_STATE)
        for name, value in {
            "first_sample": batch.first_sample + skipped,
            "next_sample": batch.first_sample + skipped,
            "code_phase": max(phase + skipped * rate - period * CODE_LENGTH, 0.0),
            "code_rate": rate,
            "carrier_step": (constants["intermediate_hz"] + found.doppler_hz) / batch.sample_rate_hz,
            "doppler_hz": found.doppler_hz,
            "period": period % PERIODS_PER_SECONDARY,
            "cn0_dbhz": found.cn0_dbhz,
        }.items():
            state[name] = value
        return state

    @property
    def first_sample(self) -> int:
        """Number of the first sample of the code period that is not yet complete."""
        return int(self._state["first_sample"][0])

    @property
    def next_sample(self) -> int:
        """Number of the next sample that the channel needs; earlier samples have no effect."""
        return int(self._state["next_sample"][0])

    @property
    def lost(self) -> bool:
        """Whether the signal is lost; `run` has no effect after the loss."""
        return bool(self._state["mode"][0] == LOST)

    @property
    def doppler_hz(self) -> float:
        """Doppler in Hz from the integrator of the carrier loop."""
        return float(self._state["doppler_hz"][0])

    def run(self, samples: Complex64[np.ndarray, " n"], first: int) -> TrackedPeriods:
        """Track the given samples, and return the code periods that end in these samples; see `track_together`."""
        return track_together([self], samples, first)[0]


def track_together(
    channels: Sequence[Channel], samples: Complex64[np.ndarray, " n"], first: int
) -> list[TrackedPeriods]:
    """Track samples with several channels, and return the code periods of each channel that end in the samples.

    The result of a channel does not depend on the other channels. Together the channels are faster, because they share
    the running sums of the samples.

    Parameters
    ----------
    channels
        Channels with the same settings, for samples of the same rate and centre frequency.
    samples
        Samples of E1, from the smallest `next_sample` of the channels or earlier.
    first
        Number of the first sample.

    Raises
    ------
    ValueError
        If the samples begin too late for a channel.
    """
    if not channels:
        return []
    needed = min(channel.next_sample for channel in channels)
    if first > needed:
        raise ValueError(f"samples begin with number {first}, but a channel needs {needed}")
    x: Float32[np.ndarray, " n"] = samples.view(np.float32)
    constants, states = np.zeros(len(channels), CONSTANTS), np.zeros(len(channels), CHANNEL_STATE)
    for i, channel in enumerate(channels):  # a loop is faster than np.concatenate, which compares field types
        constants[i], states[i] = channel._constants[0], channel._state[0]
    pilots = np.stack([channel._pilot for channel in channels])
    totals = np.stack([channel._total for channel in channels])
    most = int(samples.size / (constants["sample_rate_hz"].min() * E1C.period_s) * 1.01) + 2
    periods = np.zeros((len(channels), most), PERIOD)
    banks = np.zeros((len(channels), most, totals.shape[1]), np.complex64)
    done = np.zeros(len(channels), np.int64)
    track_channels(
        x,
        first,
        round(constants["intermediate_hz"][0] / constants["sample_rate_hz"][0] * REMOVED_STEPS),
        np.stack([channel._secondary for channel in channels]),
        np.stack([channel._replicas for channel in channels]),
        np.stack([channel.lags for channel in channels]),
        np.stack([channel._starts for channel in channels]),
        np.stack([channel._slots for channel in channels]),
        constants,
        states,
        pilots,
        totals,
        periods,
        banks,
        done,
    )
    for channel, state, pilot, total in zip(channels, states, pilots, totals, strict=True):
        channel._state[0], channel._pilot[:], channel._total[:] = state, pilot, total
    return [TrackedPeriods(periods[i, :n], banks[i, :n]) for i, n in enumerate(done)]
