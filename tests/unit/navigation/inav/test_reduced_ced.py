from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from real_ephemerides import ECCENTRIC, recorded_ephemerides
from vestige.errors import VestigeError
from vestige.navigation.inav.reduced_ced import ReducedCed, reference_time
from vestige.navigation.orbit import satellite_state
from vestige.navigation.reissue import referred_to
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

START = GalileoTime(1372, 604_770)  # the last subframe of a week: most of its validity is in the next one
MINUTES_S = np.array([0.0, 120.0, 300.0, 600.0])
EPHEMERIS = replace(walker_ephemerides(START + -3000.0)[4], af0_s=-3e-4, af1=-7e-11, crs_m=150.0, cus_rad=7e-6)


def test_it_refers_to_the_first_page_of_its_subframe() -> None:
    assert reference_time(START + 29.0) == reference_time(START) == GalileoTime(1372, 604_771)


def test_position_and_clock_are_those_of_the_ephemeris_to_tens_of_metres() -> None:
    found = ReducedCed.from_ephemeris(EPHEMERIS, START + 15.0)
    assert found is not None
    sent = ReducedCed.from_word(found.word)
    assert sent.word == found.word
    start = reference_time(START)
    told, true = (satellite_state(one, start, MINUTES_S) for one in (sent.ephemeris(5, START), EPHEMERIS))
    assert np.linalg.norm(told.position_m - true.position_m, axis=1).max() < 60.0
    assert np.abs(told.clock_s - true.clock_s).max() * 3e8 < 5.0  # half a step of af0 is 2.2 m


def test_the_fitted_elements_are_better_than_those_of_the_ephemeris() -> None:
    found = ReducedCed.from_ephemeris(EPHEMERIS, START)
    assert found is not None
    at_start = referred_to(EPHEMERIS, reference_time(START))
    plain = replace(found, ex=0.0, ey=0.0, omega0_rad=at_start.omega0_rad, lambda0_rad=at_start.m0_rad)  # e = ω = 0
    true = satellite_state(EPHEMERIS, reference_time(START), MINUTES_S).position_m
    errors = [
        np.linalg.norm(satellite_state(one.ephemeris(5, START), reference_time(START), MINUTES_S).position_m - true)
        for one in (found, plain)
    ]
    assert errors[0] < 0.2 * errors[1]


def test_recorded_satellites_have_one_unless_their_orbit_is_eccentric(osnma_data) -> None:
    for svid, ephemeris in recorded_ephemerides(osnma_data).items():
        found = ReducedCed.from_ephemeris(ephemeris, ephemeris.toe + 600.0)
        assert (found is None) == (svid == ECCENTRIC)


def test_what_does_not_fit_has_none() -> None:
    assert ReducedCed.from_ephemeris(replace(EPHEMERIS, eccentricity=2e-3), START) is None
    assert ReducedCed.from_ephemeris(replace(EPHEMERIS, sqrt_a=5000.0), START) is None
    assert ReducedCed.from_ephemeris(replace(EPHEMERIS, af0_s=0.04), START) is None
    found = ReducedCed.from_ephemeris(EPHEMERIS, START)
    assert found is not None
    with pytest.raises(VestigeError, match=r"I/NAV word 16: ex is 0\.5"):
        _ = replace(found, ex=0.5).word
