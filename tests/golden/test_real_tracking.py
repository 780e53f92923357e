"""The tracking loops on the real recording: 86 ms of eight satellites, real samples at an intermediate frequency.

Behind them samples were lost. The first 40 ms pull the carrier in. Then the phase of every prompt is close to that of
the loop, and the loop has the Doppler that `measure_e1` finds in all of it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.recording.samples.sample_format import SampleFormat, decode
from vestige.records import Band, SampleBatch
from vestige.sample_processor.acquisition import acquire
from vestige.sample_processor.e1_snapshot import measure_e1
from vestige.sample_processor.tracking.channel import Channel
from vestige.sample_processor.tracking.settings import TrackingSettings
from vestige.time import GalileoTime

INTACT = 1_032_000  # samples in front of the gap
IN_THE_SKY = (2, 3, 5, 7, 8, 13, 15, 25)


@pytest.fixture(scope="module")
def e1(recording_data: Path) -> SampleBatch:
    stored = np.fromfile(recording_data / "L1_20211125_004000_12MHz_I.bin", np.int8, INTACT)
    return SampleBatch(
        band=Band.E1,
        samples=decode(stored, SampleFormat(component="int8", layout="real"), inverted=False),
        sample_rate_hz=12e6,
        center_frequency_hz=1572.42e6,
        first_sample=0,
        start=GalileoTime(1372, 480_616),
    )


@pytest.mark.judged(
    by="real recording",
    what="tracking loops",
    figure="Doppler within 6.0 Hz, phase noise below 0.35 rad",
)
def test_all_eight_satellites_are_tracked(e1: SampleBatch) -> None:
    found = {one.svid: one for one in acquire(e1, IN_THE_SKY)}
    assert sorted(found) == list(IN_THE_SKY)
    for svid, acquisition in found.items():
        measured = measure_e1(e1, acquisition)
        assert measured is not None
        channel = Channel(measured, e1, TrackingSettings(pull_in_s=0.032))
        tracked = channel.run(e1.samples, 0)
        late = tracked.banks[10:, 2]
        assert late.size >= 9
        # at the weakest, 40 dBHz, one prompt has 0.11 rad of noise and the loop 0.04
        assert np.std(np.angle(late)) < 0.35, svid
        assert np.abs(np.mean(np.angle(late))) < 0.25, svid
        # prompt, and the correlators beside it, 0.085 chip away: a peak, and the loop is on it
        early, prompt, late_tap = np.abs(tracked.banks[10:, 1:4].sum(axis=0))
        assert prompt > early > 0.7 * prompt
        assert prompt > late_tap > 0.7 * prompt
        assert channel.doppler_hz == pytest.approx(measured.doppler_hz, abs=6.0), svid
