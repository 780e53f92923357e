"""What tracking makes of a recording, as files that other programs read.

| file | what |
|---|---|
| `observations.rnx` | RINEX 3.05 observations of E1-C, ten a second |
| `navigation.rnx` | RINEX navigation: the ephemerides in the message |
| `inav_pages.csv` | I/NAV pages as the official OSNMA test vectors have them; a page that was not received is zero |
| `taps.csv` | correlators of E1-C every 100 ms: time, satellite, then in-phase and quadrature part of each |
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vestige.constants import SPEED_OF_LIGHT_MPS
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
PAGES_NAME, TAPS_NAME = "inav_pages.csv", "taps.csv"
_CLOCK_IS_SET_S = 1.0  # a clock that is wrong by more is set by the message in the files, to a second


def write_tracked(folder: Path, tracked: TrackedRecording) -> tuple[Path, ...]:
    """Write what there is of `OBSERVATIONS_NAME`, `NAVIGATION_NAME`, `PAGES_NAME` and `TAPS_NAME`; return the files.

    Parameters
    ----------
    folder
        Must exist.
    tracked
        Result of tracking a recording.
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
    """Return by how many whole seconds the files' clock is earlier than that of the recording; 0 if that was right."""
    error_s = tracked.time_tag_error_s or 0.0
    return round(error_s) if abs(error_s) > _CLOCK_IS_SET_S else 0


def _with_clock_set(epoch: ObservationEpoch, offset_s: int) -> ObservationEpoch:
    moved = {
        svid: replace(one, pseudorange_m=one.pseudorange_m - offset_s * SPEED_OF_LIGHT_MPS)
        for svid, one in epoch.observations.items()
    }
    return replace(epoch, time=_earlier(epoch.time, offset_s), observations=moved)


def _earlier(time: GalileoTime, seconds: int) -> GalileoTime:
    """Return a time whole seconds earlier, with the same fraction to the bit."""
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
                table.writerow([time.week, f"{time.second + time.fraction:.1f}", svid, *values])


def _without_gaps(pages: Sequence[InavPage]) -> dict[int, list[InavPage]]:
    """Return the pages of each satellite from a common first time on, zeros in place of those that are missing."""
    first, last = min(page.time for page in pages), max(page.time for page in pages)
    times = [first + PAGE_S * number for number in range(round((last - first) / PAGE_S) + 1)]
    received = {(page.svid, page.time): page for page in pages}
    return {
        svid: [received.get((svid, time)) or InavPage(svid=svid, time=time, data=bytes(PAGE_BYTES)) for time in times]
        for svid in sorted({page.svid for page in pages})
    }
