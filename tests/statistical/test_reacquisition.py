"""How long the tracking receiver takes to acquire a satellite again: the value that campaigns assume.

One satellite at 45 dBHz. Noise replaces its samples from 0.8 s on, until it comes back after 4 s; by then the channel
is given up.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from builders import START, received_batch, satellite
from vestige.receiver.correlators.e1_loop import REACQUISITION_S
from vestige.records import Band, SampleBatch
from vestige.sample_processor.tracking.tracking_receiver import TrackingReceiver, recut

RATE_HZ = 3.2e6
SVID = 11


def _part(whole: SampleBatch, samples: np.ndarray, begin_s: float, end_s: float) -> SampleBatch:
    begin, end = round(begin_s * RATE_HZ), round(end_s * RATE_HZ)
    return replace(whole, samples=samples[begin:end], first_sample=begin, start=whole.start + begin_s)


def _seen_s(receiver: TrackingReceiver, batch: SampleBatch) -> np.ndarray:
    """Return the epochs with an observation, in s after the start."""
    epochs = [epoch for piece in recut([batch], 0.2) for epoch in receiver.track(piece).epochs]
    return np.array([epoch.time - START for epoch in epochs if SVID in epoch.observations])


@pytest.mark.judged(
    by="tracking loops on samples",
    what="time to acquire a satellite again, as campaigns assume it",
    figure="within 0.2 s",
)
def test_the_tracking_receiver_takes_a_second() -> None:
    """It looks for a lost satellite once a second, so the wait is uniform over a second; epochs are 0.1 s apart."""
    sky = [satellite(SVID, 2.41e7, -350.0, 45.0, 45.0, seed=2)]
    whole = received_batch(Band.E1, sky, duration_s=5.8, rate_hz=RATE_HZ, seed=4)
    noise = np.random.default_rng(9).standard_normal((whole.samples.size, 2), np.float32).view(np.complex64)[:, 0]
    noise *= np.sqrt(np.mean(np.abs(whole.samples) ** 2) / 2)
    gone, waits_s = round(0.8 * RATE_HZ), []
    silent = np.concatenate([whole.samples[:gone], noise[gone:]])
    receiver = TrackingReceiver(svids=(SVID,))
    seen_s = _seen_s(receiver, _part(whole, silent, 0.0, 4.0))
    assert 0.4 < np.min(seen_s) < np.max(seen_s) < 0.95
    assert receiver.tracks[SVID].channel.lost
    for back_s in (4.1, 4.3, 4.5, 4.7, 4.9):
        back = round(back_s * RATE_HZ)
        samples = np.concatenate([silent[:back], whole.samples[back:]])
        seen_s = _seen_s(deepcopy(receiver), _part(whole, samples, 4.0, 5.8))
        assert np.min(seen_s) > back_s
        waits_s.append(float(np.min(seen_s)) - back_s)
    assert min(waits_s) > 0.4
    assert max(waits_s) < 1.6
    assert abs(np.mean(waits_s) - REACQUISITION_S) < 0.2
