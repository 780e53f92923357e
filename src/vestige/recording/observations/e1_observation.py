"""Compute E1 observations from E1 samples, for recordings without an observation file.

`measure_e1` gives each satellite's time of transmission modulo 100 ms, the period of E1-C's secondary code. The travel
times of satellites in view differ by less than 25 ms, so the unknown multiple of 100 ms is common to all satellites.
The chosen multiple puts the median travel time nearest to 86 ms, the median travel time from Galileo's orbit. The
choice of the multiple is right if the error of the recording's time tag is below `TIME_TAG_TOLERANCE_S`. The choice is
also right if the error is known from the hand-over search (`time_tag_search`). A receiver with a tracking loop reads
the time of week from I/NAV instead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from vestige.constants import E1_CARRIER_HZ, MEDIAN_TRAVEL_TIME_S, SECONDARY_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.records import E1Observation, SampleBatch
from vestige.sample_processor.acquisition import acquire
from vestige.sample_processor.e1_snapshot import MIN_SECONDARY_MARGIN_DB, NOISE_FLOOR, E1Snapshot, measure_e1
from vestige.time import GalileoTime

TIME_TAG_TOLERANCE_S = (
    # limit in s, rounded: half of the secondary code's period, less the 9 ms by which a median travel time may differ
    # from 86 ms
    0.04
)


def observe(
    batch: SampleBatch,
    svids: Iterable[int],
    *,
    time_tag_error_s: float = 0.0,
    cn0_estimator: str = NOISE_FLOOR,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[GalileoTime, dict[int, E1Observation]]:
    """Return the time in the middle of a batch, and the E1 observations of the found satellites at this time.

    The best duration of the batch is 100 ms. `time_tag_error_s` is the known error of the batch's time tag in s,
    positive if the time tag is ahead of Galileo System Time. `progress` is called with the number of satellites
    searched so far and the number of all satellites.
    """
    acquired = acquire(batch, svids, progress=progress)
    tried = (measure_e1(batch, one, cn0_estimator=cn0_estimator) for one in acquired)
    measured = [found for found in tried if found is not None]
    kept = {one.svid: one for one in measured if one.secondary_margin_db >= MIN_SECONDARY_MARGIN_DB}
    middle = batch.start + batch.samples.size / batch.sample_rate_hz / 2
    phases_s = {svid: (one.time.fraction - one.transmit_phase_s) for svid, one in kept.items()}
    travel_s = place_travel_times(phases_s, MEDIAN_TRAVEL_TIME_S + time_tag_error_s)
    return middle, {svid: _at(one, travel_s[svid], middle) for svid, one in kept.items()}


def place_travel_times(phases_s: Mapping[int, float], median_s: float = MEDIAN_TRAVEL_TIME_S) -> dict[int, float]:
    """Return travel times in s from travel times modulo 100 ms, with a common multiple of 100 ms for all satellites.

    `phases_s` are the times of reception minus the times of transmission in s, modulo 100 ms. `median_s` is the
    expected median travel time in s, with an error below 50 ms.
    """
    if not phases_s:
        return {}
    turns = 2 * np.pi * np.array(list(phases_s.values())) / SECONDARY_PERIOD_S
    mean = np.angle(np.sum(np.exp(1j * turns)))
    together = mean + np.angle(np.exp(1j * (turns - mean)))  # all phases are within half a turn of the mean
    travel = together / (2 * np.pi) * SECONDARY_PERIOD_S
    shift = round((median_s - float(np.median(travel))) / SECONDARY_PERIOD_S)
    return {svid: float(time) for svid, time in zip(phases_s, travel + shift * SECONDARY_PERIOD_S, strict=True)}


def _at(one: E1Snapshot, travel_s: float, time: GalileoTime) -> E1Observation:
    """Return the observation moved from the time of its measurement to `time`."""
    wavelength_m = SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
    return E1Observation(
        svid=one.svid,
        pseudorange_m=travel_s * SPEED_OF_LIGHT_MPS - wavelength_m * one.doppler_hz * (time - one.time),
        carrier_phase_cycles=float("nan"),
        doppler_hz=one.doppler_hz,
        doppler_rate_hz_per_s=0.0,
        cn0_dbhz=one.cn0_dbhz,
    )
