"""RECS of other times than the recording, and the sentence about them."""

from __future__ import annotations

import pytest

from vestige.recording.assistance.other_times import RecsOfOtherTimes
from vestige.time import GalileoTime

SENT = GalileoTime.parse("2026-11-21T12:00:16 GST")


def of(sent_after_s: tuple[float, ...], *, length_s: float = 2.0) -> RecsOfOtherTimes | None:
    return RecsOfOtherTimes.of([SENT + s for s in sent_after_s], (SENT, SENT + length_s))


def test_recs_in_the_window_are_not_of_another_time() -> None:
    assert of(()) is None
    assert of((0.0, 1.0, 2.0)) is None


def test_number_and_span_and_distance_are_said() -> None:
    found = of((-30.0, 1.0, 40.0))
    assert found is not None
    assert (found.n, found.first, found.last) == (2, SENT + -30.0, SENT + 40.0)
    line = found.line(SENT, SENT + 2.0)
    assert f"has 2, sent from {SENT + -30.0} to {SENT + 40.0}" in line
    assert f"the recording is from {SENT} to {SENT + 2.0}" in line
    assert "the nearest is 30.0 s before its start" in line
    assert "UTC" not in line


@pytest.mark.parametrize(
    ("sent_s", "advice"),
    [
        (18.5, "the start is UTC and was taken as GST (UTC is 18 s behind GST): write UTC"),
        (-17.5, "the start is GST and was taken as UTC (UTC is 18 s behind GST): write GST"),
        (25.0, "correct the start of the recording"),
        (-25.0, "correct the start of the recording"),
    ],
)
def test_leap_seconds_are_named_if_they_explain_the_distance(sent_s: float, advice: str) -> None:
    found = of((sent_s, 3600.0))
    assert found is not None
    assert advice in found.line(SENT, SENT + 2.0)


def test_the_leap_seconds_are_those_of_the_time() -> None:
    begin = GalileoTime.parse("2010-06-01T00:00:00 GST")
    found = RecsOfOtherTimes.of([begin + 15.5], (begin, begin + 1.0))
    assert found is not None
    assert found.leap_s == 15


def test_files_together_are_like_one_file() -> None:
    one, other, both = of((-30.0, 18.0)), of((-5.0, 90.0)), of((-30.0, 18.0, -5.0, 90.0))
    assert one is not None
    assert other is not None
    assert one | other == other | one == both
