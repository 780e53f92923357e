"""`cssrlib` decodes our words 1 to 5 and gets the ephemeris back to the last bit.

It reads pages as a receiver gives them, 240 bits with the word in both halves, so page layout and fields are judged.
Its decoder ignores words 0, 6 to 10 and 16 to 20; `test_sky_gnss_sdr` and `test_sky_gnss_sdr_words` judge these.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cssrlib_judge import SAME, broadcast_words, decoded_ephemerides
from real_ephemerides import recorded_ephemerides
from vestige.broadcast.inav_transmission import InavTransmission
from vestige.broadcast.satellite_words import EphemerisIssue, SatelliteWords, SystemData
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.ephemeris_words import as_broadcast
from vestige.navigation.inav.timing_words import UtcModel
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

START = GalileoTime(1372, 481_200)
# It takes 3.1415926535898 for π, 2e-15 less. The last bit of the longest field, 32 bits, is 2e-10 of its range.
CLOSE = 1e-14


def extreme() -> Ephemeris:
    """An ephemeris with every term at work, signs of both kinds."""
    return replace(
        walker_ephemerides(START + -1200.0)[10],
        iod_nav=1013,
        eccentricity=4e-4,
        omega_rad=-3.1,
        i_dot_radps=-3e-10,
        cuc_rad=-6e-6,
        cus_rad=7e-6,
        crc_m=-180.0,
        crs_m=170.0,
        cic_rad=-5e-8,
        cis_rad=6e-8,
        af0_s=-7e-4,
        af1=-9e-12,
        af2_per_s=-1.7e-17,
        bgd_e1_e5a_s=-2e-9,
        bgd_e1_e5b_s=3e-9,
        e1b_health=1,
        e1b_data_valid=False,
    )


def judged(ephemeris: Ephemeris) -> Ephemeris:
    """Return what cssrlib decodes of the ephemeris; out of a subframe."""
    issue = EphemerisIssue(start=START, ephemeris=ephemeris)
    words = SatelliteWords([issue], SystemData(utc=UtcModel.at(START)))
    (*_, (_, found)) = decoded_ephemerides(InavTransmission(words=words).pages(START + 1.0, 15))
    return found


def compare(ephemeris: Ephemeris) -> None:
    found = judged(ephemeris)
    assert broadcast_words(found) == broadcast_words(ephemeris)
    for ours in (*SAME.values(), "sqrt_a"):
        assert getattr(found, ours) == pytest.approx(getattr(ephemeris, ours), rel=CLOSE, abs=0), ours
    assert (found.toe, found.toc) == (ephemeris.toe, ephemeris.toc)


@pytest.mark.judged(
    by="cssrlib",
    what="I/NAV words 1 to 5 that vestige encodes",
    figure="ephemerides come back to the last bit, within 1e-14",
)
def test_recorded_ephemerides_come_back(osnma_data: Path) -> None:
    ephemerides = recorded_ephemerides(osnma_data)
    assert len(ephemerides) > 8
    for ephemeris in ephemerides.values():
        compare(ephemeris)


def test_an_ephemeris_with_every_term_comes_back() -> None:
    compare(as_broadcast(extreme()))


def test_the_nominal_constellation_comes_back() -> None:
    for ephemeris in walker_ephemerides(START + -1200.0):
        compare(as_broadcast(ephemeris))
