from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.errors import InputFileError
from vestige.navigation.earth import ecef_from_geodetic
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

ROOT = Path(__file__).resolve().parents[3]
NIGHT = ROOT / "scenarios" / "night.toml"
ANTENNA = (48.11, 11.62, 520.0)
CIRCLE = (
    'trajectory={kind="circle", latitude_deg=48.1, longitude_deg=11.6, height_m=500.0, radius_m=400.0, speed_mps=20.0}'
)


def scenario(*settings: str) -> CampaignScenario:
    text = " ".join((ROOT / "docs" / "attacks.md").read_text(encoding="utf-8").split())
    (example,) = re.findall(r"`(antenna = \{.*?\})`", text)
    attack = f'attack=[{{kind="meaconing", start_s=0, power_db=6, delay_s=1e-6, {example}}}]'
    found = load_scenario(NIGHT, (attack, *settings))
    assert isinstance(found, CampaignScenario)
    return found


@pytest.mark.parametrize("settings", [(), (CIRCLE,)], ids=["standing", "moving"])
def test_a_satellite_is_late_by_the_way_over_the_antenna(settings: tuple[str, ...]) -> None:
    """What is left when the way to the victim and the repeater's delay are taken off is the range of the antenna."""
    t_s = np.linspace(0.0, 179.0, 97)
    fixed = StaticTrajectory(latitude_deg=ANTENNA[0], longitude_deg=ANTENNA[1], height_m=ANTENNA[2])
    for one in scenario(*settings).simulations:
        path = one.elevation.path
        late_m = one.spoofer.effects(Band.E1, one.svid, t_s).delay_m[:, 0]
        onward_m = np.linalg.norm(fixed.motion(t_s).position_m - path.trajectory.motion(t_s).position_m, axis=1)
        received_m = path.range_m(t_s) + late_m - onward_m - 1e-6 * SPEED_OF_LIGHT_MPS
        sent_m = ecef_from_geodetic(*np.radians([[ANTENNA[0]], [ANTENNA[1]]]), np.array([ANTENNA[2]]))
        assert np.linalg.norm(fixed.motion(t_s).position_m - sent_m, axis=1).max() < 1e-6
        expected_m = type(path)(ephemeris=path.ephemeris, start=path.start, trajectory=fixed).range_m(t_s)
        assert received_m == pytest.approx(expected_m, abs=2e-3)  # 0.8 mm are the motion in the repeater's delay


@pytest.mark.parametrize("settings", [(), (CIRCLE.replace("400.0", "40.0"),)], ids=["standing", "moving"])
def test_the_delay_and_its_rate_have_no_step(settings: tuple[str, ...]) -> None:
    """The rate is the derivative at any time, and changes by 0.1 m/s at most in 10 ms: 10 m/s² on the circle."""
    t_s, step_s = np.arange(20.0, 40.0, 0.01) + 1e-3, 1e-4
    for one in scenario(*settings).simulations:
        before, now, after = (one.spoofer.effects(Band.E1, one.svid, t_s + at_s) for at_s in (-step_s, 0.0, step_s))
        rate_mps = (after.delay_m - before.delay_m) / (2 * step_s)
        assert now.delay_rate_mps == pytest.approx(rate_mps, abs=1e-4)
        assert np.max(np.abs(np.diff(now.delay_rate_mps, axis=0))) < 0.2


def test_the_ways_of_the_satellites_differ() -> None:
    late_m = [float(one.spoofer.attacks[0].delay_m.values[0]) for one in scenario().simulations]
    assert np.ptp(late_m) > 1000.0


def test_a_single_line_of_sight_has_no_antenna() -> None:
    attack = 'attack=[{kind="meaconing", power_db=6, delay_s=1e-6, antenna={latitude_deg=48.0, longitude_deg=11.0}}]'
    with pytest.raises(InputFileError, match="constellation"):
        load_scenario(ROOT / "scenarios" / "quick.toml", (attack,))
