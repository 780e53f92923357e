"""Write the products of tracking a recording as files for other programs.

| file | content |
|---|---|
| `observations.rnx` | RINEX 3.05 observations of E1-C, ten epochs a second or the requested number |
| `navigation.rnx` | RINEX navigation file with the ephemerides from the navigation messages |
| `inav_pages.csv` | I/NAV pages in the format of the official OSNMA test vectors; all bits of a missing page are zero |
| `taps.csv` | E1-C correlators over 100 ms: time, satellite, and in-phase and quadrature part of each correlator |
| `power.csv` | C/N0 (time constant 1 s) and power (over 100 ms) of E1-C, and power of the samples (over 200 ms) |
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vestige.constants import SECONDARY_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.navigation.inav.page import PAGE_BYTES, PAGE_S, InavPage
from vestige.output import replacement
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.recording.samples.test_vector_csv import write_test_vector
from vestige.recording.tracked.message_navigation import ephemerides_in
from vestige.recording.tracked.track_recording import TrackedRecording
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

OBSERVATIONS_NAME, NAVIGATION_NAME = "observations.rnx", "navigation.rnx"
PAGES_NAME, TAPS_NAME, POWER_NAME = "inav_pages.csv", "taps.csv", "power.csv"
_CLOCK_IS_SET_S = 1.0  # largest clock error in s that stays in the files; a larger error is corrected by whole seconds


def write_tracked(folder: Path, tracked: TrackedRecording, sample_rate_hz: float) -> tuple[Path, ...]:
    """Write the results of tracking as files, and return the paths of the files.

    Only files that have content are written.

    Parameters
    ----------
    folder
        Existing folder.
    tracked
        Result of tracking a recording.
    sample_rate_hz
        Sampling rate of E1 in Hz.
    """
    epochs = [epoch for epoch in tracked.epochs if epoch.observations]
    offset_s = clock_set_s(tracked)
    written = []
    if epochs:
        written.append(folder / OBSERVATIONS_NAME)
        with replacement(written[-1]) as part:
            write_rinex_observations(part, (_with_clock_set(epoch, offset_s) for epoch in epochs))
        written.append(folder / TAPS_NAME)
        with replacement(written[-1]) as part:
            _write_taps(part, epochs, offset_s)
        written.append(folder / POWER_NAME)
        with replacement(written[-1]) as part:
            _write_power(part, epochs, offset_s, sample_rate_hz)
    ephemerides = ephemerides_in(tracked.pages)
    if ephemerides:
        written.append(folder / NAVIGATION_NAME)
        with replacement(written[-1]) as part:
            write_rinex_navigation(part, ephemerides)
    if tracked.pages:
        written.append(folder / PAGES_NAME)
        with replacement(written[-1]) as part:
            write_test_vector(part, _without_gaps(tracked.pages))
    return tuple(written)


def clock_set_s(tracked: TrackedRecording) -> int:
    """Return the whole seconds by which the clock of the recording is ahead of Galileo System Time.

    The result is negative if the clock is behind. The result is 0 if the error is at most 1 s, or is not known.
    """
    error_s = tracked.time_tag_error_s or 0.0
    return round(error_s) if abs(error_s) > _CLOCK_IS_SET_S else 0


def _with_clock_set(epoch: ObservationEpoch, offset_s: int) -> ObservationEpoch:
    moved = {
        svid: replace(one, pseudorange_m=one.pseudorange_m - offset_s * SPEED_OF_LIGHT_MPS)
        for svid, one in epoch.observations.items()
    }
    return replace(epoch, time=_earlier(epoch.time, offset_s), observations=moved)


def _earlier(time: GalileoTime, seconds: int) -> GalileoTime:
    """Return a time moved back by whole seconds, without a change of the fraction of a second."""
    return GalileoTime.normalized(time.week, time.second - seconds, time.fraction)


def _write_taps(path: Path, epochs: Sequence[ObservationEpoch], offset_s: int) -> None:
    with path.open("w", encoding="ascii", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        places = [f"{chips:+.4f}" for chips in epochs[0].tap_chips]
        table.writerow(["gst_week", "gst_second", "svid", *(f"{part}{place}" for place in places for part in "iq")])
        for epoch in epochs:
            time = _earlier(epoch.time, offset_s)
            for svid, taps in sorted(epoch.taps.items()):
                values = [f"{value:.3f}" for tap in taps for value in (tap.real, tap.imag)]
                table.writerow([time.week, f"{time.second + time.fraction:.3f}", svid, *values])


def signal_power_db(prompt: complex, samples_power_db: float, sample_rate_hz: float) -> float:
    """Return the power of E1-C in dB relative to one squared unit of the sample values; NaN without a signal.

    The sum of N noise samples of power p has a variance of N p/2 per dimension. A signal of power C adds √C · N to the
    prompt. So the prompt z in standard deviations has a mean square of 2 C N/p + 2.

    Parameters
    ----------
    prompt
        Prompt correlator over 100 ms. The unit is the standard deviation per dimension that a correlator would have if
        the samples were noise alone.
    samples_power_db
        Mean power of the samples in dB relative to one squared unit of the sample values.
    sample_rate_hz
        Sampling rate in Hz.

    Examples
    --------
    >>> round(signal_power_db(80.0 + 0j, 3.0, 4e6), 2)
    -17.97
    """
    excess = abs(prompt) ** 2 - 2.0
    if not (excess > 0 and math.isfinite(samples_power_db)):
        return math.nan
    return 10 * math.log10(excess / (2 * SECONDARY_PERIOD_S * sample_rate_hz)) + samples_power_db


def _write_power(path: Path, epochs: Sequence[ObservationEpoch], offset_s: int, sample_rate_hz: float) -> None:
    with path.open("w", encoding="ascii", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(["gst_week", "gst_second", "svid", "cn0_dbhz", "e1c_power_db", "samples_power_db"])
        for epoch in epochs:
            time = _earlier(epoch.time, offset_s)
            prompt = len(epoch.tap_chips) // 2
            for svid, one in sorted(epoch.observations.items()):
                taps = epoch.taps.get(svid)
                power_db = math.nan
                if taps is not None and taps.size:
                    power_db = signal_power_db(complex(taps[prompt]), epoch.power_db, sample_rate_hz)
                values = ["" if math.isnan(one) else f"{one:.2f}" for one in (one.cn0_dbhz, power_db, epoch.power_db)]
                table.writerow([time.week, f"{time.second + time.fraction:.3f}", svid, *values])


def _without_gaps(pages: Sequence[InavPage]) -> dict[int, list[InavPage]]:
    """Return the pages of each satellite from a common first time on, with zeros in place of missing pages."""
    first, last = min(page.time for page in pages), max(page.time for page in pages)
    times = [first + PAGE_S * number for number in range(round((last - first) / PAGE_S) + 1)]
    received = {(page.svid, page.time): page for page in pages}
    return {
        svid: [received.get((svid, time)) or InavPage(svid=svid, time=time, data=bytes(PAGE_BYTES)) for time in times]
        for svid in sorted({page.svid for page in pages})
    }
