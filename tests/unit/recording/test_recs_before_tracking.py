"""Which RECS arrived before E1 was tracked: `vestige process --track` warns of them alone."""

from __future__ import annotations

from types import SimpleNamespace

from vestige.cli.live.follow import _EarlyRecs
from vestige.cli.recordings.process import _sent_before_tracking
from vestige.cli.recordings.verdicts import Tally
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


def warned(*sent_s: float, late_s: float = 0.0, svid: int = 7) -> str:
    epochs = tuple(ObservationEpoch(time=START + s, observations=SEEN if s > 0.4 else {}) for s in (0.0, 0.5, 0.6))
    tracked = TrackedRecording(epochs=epochs, pages=(), time_tag_error_s=late_s)
    sent = {START + s: [SimpleNamespace(svid=svid)] for s in sent_s}
    return _sent_before_tracking(SimpleNamespace(epochs=lambda: sent, time_tag_error_s=late_s), tracked)  # type: ignore[arg-type]


def test_only_those_that_arrived_before_the_first_observation() -> None:
    assert warned() == warned(0.45, 10.0) == ""  # sent at 0.45 s, it arrives while E1 is tracked
    assert warned(0.0, 10.0).startswith("1 RECS came before E1 was tracked")
    assert warned(0.0, 0.1).startswith("2 RECS came")


def test_a_satellite_that_was_never_tracked_is_another_matter() -> None:
    assert warned(0.0, svid=8) == ""


def test_a_time_tag_that_is_late() -> None:
    assert warned(0.0, late_s=10.0) == ""  # E1 was tracked 9.5 s before that RECS
    assert f"tracked, from {START + 10.5} on" in warned(0.0, late_s=-10.0)  # by the clock of the signal


def test_nothing_was_tracked() -> None:
    assert _sent_before_tracking(SimpleNamespace(), None) == ""  # type: ignore[arg-type]


def followed(*sent_s: float, svid: int = 7, first_s: float | None = 0.5) -> str:
    said: list[object] = []
    first = None if first_s is None else START + first_s
    tally = Tally()
    early = _EarlyRecs(SimpleNamespace(first_observed=first, seen={7}), tally, said.append)  # type: ignore[arg-type]
    for s in sent_s:
        segments = tuple(SimpleNamespace(svid=svid, transmit_time=START + other) for other in sent_s)
        assistance = SimpleNamespace(segments=segments)
        early.take(SimpleNamespace(sent=START + s, time_tag_error_s=0.0, assistance=assistance))  # type: ignore[arg-type]
    early.say()
    assert said == [tally.too_early] * bool(said)
    return tally.too_early


def test_live_warns_of_all_of_them_at_once() -> None:
    assert followed(0.0, 0.1, 10.0, 20.0) == warned(0.0, 0.1)
    assert followed(0.0) == warned(0.0)  # at the end
    assert followed(0.45, 10.0) == followed(0.0, svid=8) == followed(0.0, first_s=None) == ""
