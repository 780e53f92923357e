from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from real_ephemerides import recorded_ephemerides
from vestige.navigation.orbit import satellite_state
from vestige.navigation.reissue import issues, reissued
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

FRIDAY = GalileoTime.parse("2025-12-12T15:00:00 GST")


@pytest.mark.parametrize("number", [-1, 2, 9, 60])  # 60: 5 days later, in the next week
def test_real_orbits_and_clocks_stay_what_they_are(osnma_data: Path, number: int) -> None:
    elapsed_s = np.linspace(-7200.0, 86_400.0, 60)
    ephemerides = recorded_ephemerides(osnma_data)
    assert ephemerides
    for ephemeris in ephemerides.values():
        later = reissued(ephemeris, number)
        assert later.toe - ephemeris.toe == number * 7200
        assert later.iod_nav != ephemeris.iod_nav
        one, other = (satellite_state(each, FRIDAY, elapsed_s) for each in (ephemeris, later))
        np.testing.assert_allclose(other.position_m, one.position_m, rtol=0, atol=1e-4)
        np.testing.assert_allclose(other.velocity_mps, one.velocity_mps, rtol=0, atol=1e-7)
        np.testing.assert_allclose(other.clock_s, one.clock_s, rtol=0, atol=1e-16)


def test_there_is_always_one_whose_toe_is_past() -> None:
    """By 2 h at most, also for what was sent just before the start; no toe serves nothing."""
    one, toe = walker_ephemerides(GalileoTime(1372, 604_200))[0], GalileoTime(1372, 604_200)
    for begin_s, length_s in ((0.0, 60.0), (-9000.0, 40_000.0), (9000.0, 600.0), (30.0, 86_400.0)):
        start = toe + begin_s
        found = list(issues(one, start, start + length_s))
        toes_s = np.array([each.toe - start for each in found])
        assert np.all(np.diff(toes_s) == 7200)
        assert len({each.iod_nav for each in found}) == len(found)
        for time_s in np.linspace(-1.0, length_s, 97):
            age_s = time_s - toes_s
            assert np.any((age_s > 0) & (age_s <= 7200))
        assert toes_s[-1] < length_s
