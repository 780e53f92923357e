"""`cssrlib` decodes our words 1 to 5 and gets the ephemeris back to the last bit.

It reads pages as a receiver gives them, 240 bits with the word in both halves, so page layout and fields are judged.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from real_ephemerides import recorded_ephemerides
from vestige.broadcast.inav_transmission import InavTransmission
from vestige.broadcast.satellite_words import EphemerisIssue, SatelliteWords, SystemData
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.ephemeris_words import as_broadcast
from vestige.navigation.inav.timing_words import UtcModel
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

rawnav = pytest.importorskip("cssrlib.rawnav", reason="cssrlib is not installed: make judges", exc_type=ImportError)
gnss = pytest.importorskip("cssrlib.gnss", reason="cssrlib is not installed: make judges", exc_type=ImportError)

START = GalileoTime(1372, 481_200)
# It takes 3.1415926535898 for π, 2e-15 less. The last bit of the longest field, 32 bits, is 2e-10 of its range.
CLOSE = 1e-14
RINEX_WEEK = 1024  # cssrlib counts weeks as GPS does
SAME = {  # its attribute -> ours
    "M0": "m0_rad",
    "deln": "delta_n_radps",
    "e": "eccentricity",
    "OMG0": "omega0_rad",
    "i0": "i0_rad",
    "omg": "omega_rad",
    "OMGd": "omega_dot_radps",
    "idot": "i_dot_radps",
    "cuc": "cuc_rad",
    "cus": "cus_rad",
    "crc": "crc_m",
    "crs": "crs_m",
    "cic": "cic_rad",
    "cis": "cis_rad",
    "af0": "af0_s",
    "af1": "af1",
    "af2": "af2_per_s",
    "tgd": "bgd_e1_e5a_s",
    "tgd_b": "bgd_e1_e5b_s",
    "iode": "iod_nav",
}


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
        af2_per_s=-1.7e-18,
        bgd_e1_e5a_s=-2e-9,
        bgd_e1_e5b_s=3e-9,
        e1b_health=1,
        e1b_data_valid=False,
    )


def judged(ephemeris: Ephemeris) -> object:
    issue = EphemerisIssue(start=START, ephemeris=ephemeris)
    words = SatelliteWords([issue], SystemData(utc=UtcModel.at(START)))
    decoder = rawnav.RawNav()
    satellite = gnss.prn2sat(gnss.uGNSS.GAL, ephemeris.svid)
    found = None
    for page in InavTransmission(words=words).pages(START + 1.0, 15):
        time = gnss.gpst2time(START.week + RINEX_WEEK, page.time.second)
        decoded = decoder.decode_gal_inav(START.week + RINEX_WEEK, time, satellite, 0, page.data)
        found = decoded or found
    assert found is not None
    return found


def compare(ephemeris: Ephemeris) -> None:
    found = judged(ephemeris)
    for theirs, ours in SAME.items():
        assert getattr(found, theirs) == pytest.approx(getattr(ephemeris, ours), rel=CLOSE, abs=0), theirs
    assert math.sqrt(found.A) == pytest.approx(ephemeris.sqrt_a, rel=CLOSE)
    assert found.toes == ephemeris.toe.second
    assert found.week == START.week + RINEX_WEEK
    assert gnss.time2gst(found.toc) == (ephemeris.toc.week, ephemeris.toc.second)
    assert gnss.time2gst(found.toe) == (ephemeris.toe.week, ephemeris.toe.second)
    assert found.svh >> 1 & 3 == ephemeris.e1b_health
    assert found.svh & 1 == (not ephemeris.e1b_data_valid)


@pytest.mark.judged(
    by="cssrlib",
    what="I/NAV words 1 to 5 that vestige encodes",
    figure="ephemerides come back within 1e-14",
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
