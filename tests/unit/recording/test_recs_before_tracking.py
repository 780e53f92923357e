"""Which RECS arrived before E1 was tracked: `vestige process --track` warns of them alone."""

from __future__ import annotations

from vestige.cli.recordings.process import _recs_before_tracking
from vestige.recording.tracked.track_recording import TrackedRecording
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

START = GalileoTime.from_gst_seconds(1_000_000)
SEEN = {
    7: E1Observation(
        svid=7, pseudorange_m=2.5e7, carrier_phase_cycles=0.0, doppler_hz=0.0, doppler_rate_hz_per_s=0.0, cn0_dbhz=45.0
    )
}


def warned(*sent_s: float, late_s: float | None = 0.0) -> str:
    epochs = tuple(ObservationEpoch(time=START + s, observations=SEEN if s > 0.4 else {}) for s in (0.0, 0.5, 0.6))
    tracked = TrackedRecording(epochs=epochs, pages=(), time_tag_error_s=late_s)
    return _recs_before_tracking([START + s for s in sent_s], tracked)


def test_only_those_that_arrived_before_the_first_observation() -> None:
    assert warned() == warned(0.45, 10.0) == ""  # sent at 0.45 s, it arrives while E1 is tracked
    assert warned(0.0, 10.0).startswith("1 of 2 RECS times are before E1 was tracked")


def test_a_time_tag_that_is_late() -> None:
    assert warned(0.0, late_s=10.0) == ""  # E1 was tracked 9.5 s before that RECS
    assert warned(0.0, late_s=None).startswith("1 of 1")


def test_nothing_was_tracked() -> None:
    assert _recs_before_tracking([START], TrackedRecording(epochs=(), pages=(), time_tag_error_s=None)) == ""
