"""Real ephemerides, recorded on 2025-12-12: RTKLIB decodes the words, reads our file, and puts satellites elsewhere by
less than a centimetre. RTKLIB is another author's C code; nothing but the bits is shared.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from real_ephemerides import ECCENTRIC, recorded_ephemerides, recorded_words
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.orbit import satellite_state
from vestige.receiver.sky.constellation import INCLINATION_DEG, walker_ephemerides
from vestige.recording.navigation.rinex_navigation import WEEK_OFFSET, read_rinex_navigation, write_rinex_navigation
from vestige.time import GalileoTime

pyrtklib = pytest.importorskip("pyrtklib", reason="needs pyrtklib, which has no wheel for every Python and system")

TOLERANCE_M = 0.01
HOURS = np.array([-3.0, -1.0, 0.0, 0.25, 2.0, 3.9]) * 3600


@pytest.fixture(scope="module")
def real(osnma_data: Path) -> dict[int, Ephemeris]:
    return recorded_ephemerides(osnma_data)


def _rtklib_time(time: GalileoTime) -> object:
    return pyrtklib.gpst2time(time.week + WEEK_OFFSET, time.second + time.fraction)


def _rtklib_state(eph: object, time: GalileoTime) -> tuple[np.ndarray, float]:
    position, clock, variance = (pyrtklib.Arr1Ddouble(n) for n in (6, 2, 1))
    pyrtklib.eph2pos(_rtklib_time(time), eph, position, clock, variance)
    return np.array([position[k] for k in range(3)]), clock[0]


def _assert_agree(ephemeris: Ephemeris, eph: object) -> None:
    ours = satellite_state(ephemeris, ephemeris.toe, HOURS)
    for k, hours in enumerate(HOURS):
        position, clock_s = _rtklib_state(eph, ephemeris.toe + float(hours))
        assert np.linalg.norm(position - ours.position_m[k]) < TOLERANCE_M
        # RTKLIB leaves the group delay to its caller
        assert abs(clock_s - ephemeris.bgd_e1_e5b_s - ours.clock_s[k]) * SPEED_OF_LIGHT_MPS < TOLERANCE_M


def test_the_recording_has_enough(real: dict[int, Ephemeris]) -> None:
    assert len(real) == 12
    assert real[ECCENTRIC].eccentricity > 0.15
    assert sum(ephemeris.healthy for ephemeris in real.values()) == 11


@pytest.mark.judged(
    by="RTKLIB",
    what="ephemeris fields of recorded I/NAV words",
    figure="relative difference at most 1e-14",
)
def test_words_are_decoded_alike(osnma_data: Path, real: dict[int, Ephemeris]) -> None:
    for svid, (words, time) in recorded_words(osnma_data).items():
        word_0 = 0b10 << 120 | time.week << 20 | time.second  # RTKLIB wants one that tells the time, and a word 6
        every = {0: word_0, **words, 6: 6 << 122}
        frame = b"".join(word.to_bytes(16, "big") for _, word in sorted(every.items()))
        bits = getattr(pyrtklib, "Arr1Dunsigned char")(len(frame))
        for k, byte in enumerate(frame):
            bits[k] = byte
        eph = pyrtklib.eph_t()
        ion, utc = pyrtklib.Arr1Ddouble(4), pyrtklib.Arr1Ddouble(8)
        assert pyrtklib.decode_gal_inav(bits, eph, ion, utc) == 1
        ours = real[svid]
        # as broadcast the numbers are the same, so nothing but the rounding of π may differ
        for name, value in {
            "e": ours.eccentricity, "M0": ours.m0_rad, "deln": ours.delta_n_radps, "OMG0": ours.omega0_rad,
            "OMGd": ours.omega_dot_radps, "i0": ours.i0_rad, "idot": ours.i_dot_radps, "omg": ours.omega_rad,
            "cuc": ours.cuc_rad, "cus": ours.cus_rad, "crc": ours.crc_m, "crs": ours.crs_m, "cic": ours.cic_rad,
            "cis": ours.cis_rad, "f0": ours.af0_s, "f1": ours.af1, "f2": ours.af2_per_s, "toes": ours.toe.second,
        }.items():  # fmt: skip
            assert getattr(eph, name) == pytest.approx(value, rel=1e-14, abs=0), name
        assert eph.tgd[0] == pytest.approx(ours.bgd_e1_e5a_s, rel=1e-14, abs=0)
        assert eph.tgd[1] == pytest.approx(ours.bgd_e1_e5b_s, rel=1e-14, abs=0)
        assert eph.iode == ours.iod_nav
        assert (eph.svh & 0b111) == (ours.e1b_health << 1 | (not ours.e1b_data_valid))


@pytest.mark.judged(
    by="RTKLIB",
    what="satellite orbits and clocks, through our RINEX navigation file",
    figure="positions within 0.01 m",
)
def test_orbits_and_clocks_agree_through_a_navigation_file(tmp_path: Path, real: dict[int, Ephemeris]) -> None:
    path = tmp_path / "real.rnx"
    write_rinex_navigation(path, real.values())
    nav = pyrtklib.nav_t()
    assert pyrtklib.readrnx(str(path), 1, "", pyrtklib.obs_t(), nav, pyrtklib.sta_t()) == 1
    assert nav.n == len(real)
    for k, (before, after) in enumerate(zip(real.values(), read_rinex_navigation(path), strict=True)):
        _assert_agree(before, nav.eph[k])
        _assert_agree(after, nav.eph[k])


def test_orbits_agree_through_the_end_of_a_week(tmp_path: Path) -> None:
    ephemerides = walker_ephemerides(GalileoTime(1373, 0))
    path = tmp_path / "week.rnx"
    write_rinex_navigation(path, ephemerides)
    nav = pyrtklib.nav_t()
    assert pyrtklib.readrnx(str(path), 1, "", pyrtklib.obs_t(), nav, pyrtklib.sta_t()) == 1
    for k, ephemeris in enumerate(ephemerides):
        _assert_agree(ephemeris, nav.eph[k])


@pytest.mark.judged(
    by="real ephemerides",
    what="reference constellation of simulated skies",
    figure="10 of the satellites within 4.0° of a slot",
)
def test_real_satellites_are_in_the_slots_of_the_reference_constellation(real: dict[int, Ephemeris]) -> None:
    """Nine years after the reference epoch ten of the eleven are within 4° of a slot; E06 is between two."""
    toe, time = next(iter(real.values())).toe, np.zeros(1)
    slots = [satellite_state(slot, toe, time).position_m for slot in walker_ephemerides(toe)]
    near = 0
    for svid, ephemeris in real.items():
        if svid == ECCENTRIC:
            continue
        assert np.degrees(ephemeris.i0_rad) == pytest.approx(INCLINATION_DEG, abs=2.0)
        position = satellite_state(ephemeris, toe, time).position_m
        apart_deg = np.degrees(min(np.linalg.norm(position - slot) for slot in slots) / np.linalg.norm(position))
        near += apart_deg < 4.0
    assert near == 10
