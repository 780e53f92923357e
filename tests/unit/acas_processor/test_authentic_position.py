"""The position of a snapshot: which ranges it rests on, when it is known. Orbits and exact ranges of a Walker sky."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np
import pytest

from vestige.acas_processor.authentic_position import AuthenticPosition, authentic_position
from vestige.acas_processor.fix_checks import FixChecks
from vestige.receiver.constellation import sky, walker_ephemerides
from vestige.receiver.trajectory import StaticTrajectory
from vestige.records import E1Observation, Status, Verdict
from vestige.time import GalileoTime

TIME = GalileoTime(1372, 480_600)
PLACE = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)
FIX = FixChecks(ephemerides=tuple(walker_ephemerides(GalileoTime(1372, 480_000))), sigma_m=5.0)
A, S = Status.AUTHENTIC, Status.SPOOFED
CLOCK_M = 1000.0


def _observations() -> dict[int, E1Observation]:
    at_s = np.array([-CLOCK_M / 299_792_458.0])
    view = sky(FIX.ephemerides, TIME, at_s, PLACE.motion(at_s), mask_deg=10.0)
    return {
        svid: E1Observation(
            svid=svid,
            pseudorange_m=float(view.range_m[0, k] + CLOCK_M - view.satellite_clock_m[0, k]),
            carrier_phase_cycles=nan,
            doppler_hz=0.0,
            doppler_rate_hz_per_s=0.0,
            cn0_dbhz=45.0,
        )
        for k, svid in enumerate(view.svids)
        if view.in_view[0, k]
    }


OBSERVATIONS = _observations()
SVIDS = sorted(OBSERVATIONS)


def _verdict(svid: int, status: Status = A, true_offset_m: float = nan) -> Verdict:
    return Verdict(
        index=0,
        time=TIME,
        available_at=TIME + (30.0 + svid),
        svid=svid,
        level=2,
        status=status,
        checks=(),
        range_offset_m=0.0,
        reason="",
        true_offset_m=true_offset_m,
    )


def _position(
    verdicts: list[Verdict], observations: dict[int, E1Observation] = OBSERVATIONS, shown: Status | None = None
) -> AuthenticPosition | None:
    state = {one.svid: one.status if shown is None else shown for one in verdicts}
    return authentic_position(FIX, TIME, observations, verdicts, state)


def _late(svids: list[int], late_m: float) -> dict[int, E1Observation]:
    return {
        svid: replace(one, pseudorange_m=one.pseudorange_m + (late_m if svid in svids else 0.0))
        for svid, one in OBSERVATIONS.items()
    }


def _is_the_place(found: AuthenticPosition | None) -> bool:
    assert found is not None
    return (found.latitude_deg, found.longitude_deg, found.height_m) == (
        pytest.approx(48.0, abs=1e-8),
        pytest.approx(11.0, abs=1e-8),
        pytest.approx(500.0, abs=1e-3),
    )


def test_it_is_the_place_and_is_known_when_the_last_key_is() -> None:
    found = _position([_verdict(svid) for svid in SVIDS])
    assert _is_the_place(found)
    assert found is not None
    assert (found.svids, found.earlier) == (tuple(SVIDS), ())
    assert found.available_at == TIME + (30.0 + SVIDS[-1])
    assert found.latency_s == 30.0 + SVIDS[-1]
    assert 2.0 < found.horizontal_sigma_m < 15.0
    assert found.horizontal_sigma_m < 2 * found.vertical_sigma_m


@pytest.mark.parametrize("status", [one for one in Status if one is not A])
@pytest.mark.parametrize("shown", [None, A], ids=["shown as it is", "shown as before"])
def test_a_range_that_is_not_authentic_is_not_used(status: Status, shown: Status | None) -> None:
    wrong = SVIDS[0]
    found = _position([_verdict(svid, status if svid == wrong else A) for svid in SVIDS], _late([wrong], 500.0), shown)
    assert _is_the_place(found)
    assert found is not None
    assert found.svids == tuple(SVIDS[1:])


def test_of_several_signals_the_earliest_is_used_whatever_the_verdict() -> None:
    twice = SVIDS[:5]
    found = _position(
        [_verdict(svid, S, -390e3) if svid in twice else _verdict(svid, Status.SUSPECT) for svid in SVIDS],
        _late(SVIDS, 390e3),
    )
    assert _is_the_place(found)
    assert found is not None
    assert found.svids == found.earlier == tuple(twice)


def test_three_ranges_are_no_position() -> None:
    assert _position([_verdict(svid) for svid in SVIDS[:3]]) is None
    assert _position([_verdict(svid) for svid in SVIDS[:4]]) is not None


def test_what_is_shown_as_an_alarm_is_not_used() -> None:
    assert _position([_verdict(svid) for svid in SVIDS], shown=S) is None


def test_without_orbits_there_is_none() -> None:
    verdicts = [_verdict(svid) for svid in SVIDS]
    assert authentic_position(FixChecks(), TIME, OBSERVATIONS, verdicts, dict.fromkeys(SVIDS, A)) is None
