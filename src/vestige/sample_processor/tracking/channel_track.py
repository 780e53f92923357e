"""Compute the observables of a channel at given moments: time of transmission, carrier phase, Doppler and C/N0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Float, Int64

from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SECONDS_PER_WEEK
from vestige.navigation.inav.page import InavPage
from vestige.navigation.inav.words import time_in_word
from vestige.sample_processor.tracking.channel import Channel, TrackedPeriods
from vestige.sample_processor.tracking.channel_kernel import PERIOD
from vestige.sample_processor.tracking.page_sync import PageSync, ReceivedPage
from vestige.sample_processor.tracking.settings import PERIODS_PER_SECONDARY
from vestige.signals.definitions import E1C
from vestige.time import GalileoTime

DOPPLER_SPAN_S = 0.1  # duration in s of the carrier phase from which a Doppler is computed
HISTORY_S = 0.4  # duration in s of the code periods that are kept for observables
_WEEKS = 4096  # number of weeks after which the week number of the message starts again [OS-ICD, 5.1.2]
_PERIOD_MS = 4  # duration of a code period in ms


@dataclass(frozen=True, slots=True, eq=False)
class Observables:
    """Observables of one channel at n moments; NaN where the channel was not locked.

    Attributes
    ----------
    transmit_s
        Satellite time of transmission, in s after the transmission of the channel's code period 0.
    carrier_phase_cycles
        Accumulated carrier phase in cycles; the phase grows when the range grows.
    doppler_hz
        Mean Doppler in Hz over `DOPPLER_SPAN_S` around the moment.
    cn0_dbhz
        C/N0 of E1-C in dBHz.
    """

    transmit_s: Float[np.ndarray, " n"]
    carrier_phase_cycles: Float[np.ndarray, " n"]
    doppler_hz: Float[np.ndarray, " n"]
    cn0_dbhz: Float[np.ndarray, " n"]


class ChannelTrack:
    """Tracking channel, with a reader of its message pages, and with its code periods of the last `HISTORY_S`.

    Parameters
    ----------
    channel
        Channel whose loops have just started.
    sample_rate_hz
        Sampling rate in Hz.
    center_frequency_hz
        Radio frequency in Hz that is at 0 Hz in the samples.

    Attributes
    ----------
    zero
        Time of transmission of the channel's code period 0; None until a page of the channel has given this time.
    """

    def __init__(self, channel: Channel, sample_rate_hz: float, center_frequency_hz: float) -> None:
        self.channel = channel
        self.zero: GalileoTime | None = None
        self._sync = PageSync(svid=channel.svid)
        self._rate_hz = sample_rate_hz
        self._intermediate_hz = E1_CARRIER_HZ - center_frequency_hz
        self._past = np.zeros(0, PERIOD)
        self._banks = np.zeros((0, channel.lags.size), np.complex64)

    @property
    def svid(self) -> int:
        """SVID of the satellite."""
        return self.channel.svid

    def take(self, tracked: TrackedPeriods) -> list[ReceivedPage]:
        """Store tracked code periods, and return the message pages that end in these periods."""
        kept = np.searchsorted(self._past["first_sample"], self._oldest(tracked), side="left")
        past = np.empty(self._past.size - kept + tracked.periods.size, PERIOD)
        past[: self._past.size - kept], past[self._past.size - kept :] = self._past[kept:], tracked.periods
        self._past = past
        self._banks = np.concatenate((self._banks[kept:], tracked.banks))
        locked = tracked.periods[tracked.periods["locked"]]
        return self._sync.take(locked["number"], locked["data"]) if locked.size else []

    def _oldest(self, tracked: TrackedPeriods) -> float:
        if not tracked.periods.size:
            return -np.inf
        return float(tracked.periods["first_sample"][0]) - HISTORY_S * self._rate_hz

    @property
    def reach(self) -> float:
        """Sample number of the latest moment with observables, with a fraction."""
        return float(self.channel.first_sample) - DOPPLER_SPAN_S / 2 * self._rate_hz

    def newest(self) -> tuple[int, float] | None:
        """Return the first sample of the newest code period and the sample's time of transmission, even without lock.

        The time is in s after the transmission of the channel's code period 0. The result is None if no period was
        tracked yet.
        """
        if not self._past.size:
            return None
        period = self._past[-1]
        sent_s = period["number"] * E1_CODE_PERIOD_S + period["code_phase"] / E1C.chip_rate_hz
        return int(period["first_sample"]), float(sent_s)

    def learn_time(self, page: ReceivedPage, near: GalileoTime) -> GalileoTime | None:
        """Return the time of transmission of a page from its word, and set `zero`; None if the page has no valid time.

        Parameters
        ----------
        page
            A page of this channel.
        near
            Time near the reception. The error of this time may be up to 2047 weeks if the word has a week number,
            otherwise up to half a week.
        """
        unplaced = InavPage(svid=self.svid, time=GalileoTime(near.week, 0), data=page.data)
        time = None if unplaced.is_alert else time_in_word(unplaced.word)
        if time is None or not 0 <= time[1] < SECONDS_PER_WEEK:
            return None
        told, second = time
        week = near.week
        if told is None:
            week += round((near.second - second) / SECONDS_PER_WEEK)
        else:
            week += (told - week + _WEEKS // 2) % _WEEKS - _WEEKS // 2
        start = GalileoTime.normalized(week, second)
        whole, rest_ms = divmod(_PERIOD_MS * page.period, 1000)
        self.zero = GalileoTime.normalized(week, second - whole, -rest_ms * 1e-3)
        return start

    def observables(self, samples: Float[np.ndarray, " n"]) -> Observables:
        """Return the observables of the channel at the given moments.

        Parameters
        ----------
        samples
            Sample numbers of the moments, with fractions, in ascending order, none later than `reach`.
        """
        past = self._past
        row = np.searchsorted(past["first_sample"], samples, side="right") - 1
        half = DOPPLER_SPAN_S / 2 * self._rate_hz
        before = np.searchsorted(past["first_sample"], samples - half, side="right") - 1
        known = (before >= 0) & (samples <= self.reach)
        row = np.maximum(row, 0)
        known &= past["locked"][row] & past["locked"][np.maximum(before, 0)]
        behind = samples - past["first_sample"][row]
        chips = past["code_phase"][row] + behind * past["code_rate"][row]
        transmit_s = past["number"][row] * E1_CODE_PERIOD_S + chips / E1C.chip_rate_hz
        later, earlier = self._cycles(samples + half), self._cycles(samples - half)
        return Observables(
            transmit_s=np.where(known, transmit_s, np.nan),
            carrier_phase_cycles=np.where(known, -self._cycles(samples), np.nan),
            doppler_hz=np.where(known, (later - earlier) / DOPPLER_SPAN_S, np.nan),
            cn0_dbhz=np.where(known, past["cn0_dbhz"][row], np.nan),
        )

    def taps(self, sample: float) -> Complex64[np.ndarray, " k"]:
        """Return the sum of the banks of the last 25 code periods (100 ms) that ended before a sample.

        Parameters
        ----------
        sample
            Sample number, not larger than `reach`.
        """
        end = int(np.searchsorted(self._past["first_sample"], sample, side="right")) - 1
        return np.sum(self._banks[max(end - PERIODS_PER_SECONDARY, 0) : max(end, 0)], axis=0)

    def _cycles(self, samples: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the carrier phase at the given samples in cycles, minus the phase of a carrier without Doppler."""
        past = self._past
        row: Int64[np.ndarray, " n"] = np.maximum(np.searchsorted(past["first_sample"], samples, side="right") - 1, 0)
        turned = past["carrier_cycles"][row] + (samples - past["first_sample"][row]) * past["carrier_step"][row]
        return turned - samples * (self._intermediate_hz / self._rate_hz)
