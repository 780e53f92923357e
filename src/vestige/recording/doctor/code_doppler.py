"""Test whether code and carrier of E1 have Dopplers of opposite sign, which shows a reversed spectrum.

Theory of operation
-------------------
E1-B, E1-C and E6-B modulate their carrier with real values, not with complex values. If the carrier is at 0 Hz, the
conjugate samples contain the same codes with carrier Dopplers of the opposite sign. However, the code rate changes by
the factor 1 + f_d/f_c in either direction of the spectrum, with the Doppler f_d and the carrier frequency f_c. So the
code phases of two windows give a Doppler of each satellite that does not depend on the direction of the spectrum. The
slope of the code Dopplers over the carrier Dopplers is +1, or −1 for a reversed spectrum. With three or more
satellites, the slope does not change if the samples jump, because the code phases of all satellites jump by the same
time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SECONDARY_PERIOD_S
from vestige.recording.description import BandFile
from vestige.recording.doctor.reading import head
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.e1_snapshot import E1Snapshot, measure_e1

CODE_WINDOW_S = 0.06  # duration in s of the samples for one code phase, the shortest for an E1 measurement
# shortest and longest time in s between the windows; the code must stay within the bank of correlators
APART_S = (0.02, 0.2)
CODE_SIGMA_S = 2e-8  # standard deviation of one code phase in a window of `CODE_WINDOW_S` at 40 dBHz
SIGNIFICANCE = 4.0  # smallest number of standard deviations between a slope of 0 and a slope of 1
_SLOPES = (-1.6, -0.4)  # range of the slope for a reversed spectrum


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Satellite:
    """Measurements of a satellite on E1."""

    svid: int
    doppler_hz: float
    cn0_dbhz: float
    snapshot: E1Snapshot | None  # measurement; None if the samples are too short, so that Doppler and C/N0 are coarse


def code_runs_backwards(file: BandFile, satellites: Sequence[E1Satellite]) -> bool:
    """Return whether the code phases change as if all carrier Dopplers had the opposite sign.

    If the test is uncertain, the result is False.

    Parameters
    ----------
    file
        E1 file, with the description that was used for the measurement of the satellites.
    satellites
        At least two satellites with a measurement. For windows 100 ms apart, the root of the sum of the squared
        Dopplers must be at least 1.8 kHz. With three or more satellites, the median Doppler is subtracted first.
    """
    whole = head(file, CODE_WINDOW_S + APART_S[1])
    if whole is None:
        return False
    apart_s = min(whole.samples.size / whole.sample_rate_hz - CODE_WINDOW_S, APART_S[1])
    if apart_s < APART_S[0]:
        return False
    first, second = head(file, CODE_WINDOW_S), head(file, CODE_WINDOW_S, apart_s)
    if first is None or second is None:
        return False
    dopplers, ahead_s = [], []
    for one in satellites:
        if one.snapshot is None:
            continue
        early = measure_e1(first, _at(one, one.snapshot, first.start - one.snapshot.time))
        late = measure_e1(second, _at(one, one.snapshot, second.start - one.snapshot.time))
        if early is not None and late is not None:
            span_s = late.time - early.time
            half = SECONDARY_PERIOD_S / 2
            dopplers.append((early.doppler_hz + late.doppler_hz) / 2)
            ahead_s.append(
                ((late.transmit_phase_s - early.transmit_phase_s - span_s + half) % SECONDARY_PERIOD_S - half)
                * (apart_s / span_s)
            )
    if len(dopplers) < 2:
        return False
    expected_s = np.array(dopplers) / E1_CARRIER_HZ * apart_s
    measured_s = np.array(ahead_s)
    if len(dopplers) > 2:
        expected_s = expected_s - np.median(expected_s)
        measured_s = measured_s - np.median(measured_s)
    power = float(np.sum(expected_s**2))
    if power < 2 * (SIGNIFICANCE * CODE_SIGMA_S) ** 2:
        return False
    slope = float(np.sum(expected_s * measured_s)) / power
    return _SLOPES[0] < slope < _SLOPES[1]


def _at(one: E1Satellite, snapshot: E1Snapshot, ahead_s: float) -> Acquisition:
    """Predict the acquisition in samples that start `ahead_s` after a measurement.

    With a Doppler of 4 kHz, the predicted code phase has an error of about half a chip after 0.2 s.
    """
    period_s = E1_CODE_PERIOD_S
    phase_s = snapshot.transmit_phase_s + ahead_s
    return Acquisition(
        svid=one.svid,
        code_start_s=-phase_s % period_s,
        doppler_hz=one.doppler_hz,
        statistic=0.0,
        threshold=0.0,
        cn0_dbhz=one.cn0_dbhz,
    )
