"""Spoofing signals in a recording have no step between two stretches: delay, phase and amplitude."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.attacked_sky import ReceivedSpoofingSignal
from vestige.receiver.samples.recorder import ReceivedSatellite, stretch_samples
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signals.definitions import CARRIER_HZ
from vestige.simulated.exported_case import AcasTestCase

NIGHT = Path(__file__).resolve().parents[3] / "scenarios" / "night.toml"
RATE_HZ = 6.2e6
STRETCH_S = stretch_samples(RATE_HZ) / RATE_HZ
FROM_S, TO_S = 2.0, 7.0  # the receiver sees signals sent between 1.9 and 6.9 s after the start
RAMP = '{kind="ramp", first=0, last=300, start_s=2.5, stop_s=4}'
CIRCLE = (
    'trajectory={kind="circle", latitude_deg=48.1, longitude_deg=11.6, height_m=500.0, radius_m=40, speed_mps=20.0}'
)
ANTENNA = "antenna={latitude_deg=48.11, longitude_deg=11.61, height_m=520.0}"
SCENES = {
    "coherent": (f'kind="lift-off", power_db=3, delay_m={RAMP}',),
    "locked": (f'kind="lift-off", power_db=3, delay_m={RAMP}, phase={{kind="locked", phase_rad=1.0}}',),
    "slipping": (f'kind="lift-off", power_db=3, delay_m={RAMP}, phase={{kind="slipping", slip_hz=210}}',),
    "fast": (
        'kind="lift-off", power_db=3, phase={kind="locked"}, '
        'delay_m={kind="trapezoid", base=0, top=9e3, start_s=2.5, stop_s=6, rise_s=1, fall_s=1}',
    ),
    "power": (
        'kind="lift-off", delay_m={kind="ramp", first=0, last=300, start_s=2.5, stop_s=6, smooth=true}, '
        'power_db={kind="ramp", first=-20, last=6, start_s=2.5, stop_s=3.5}',
    ),
    "scer": (f'kind="scer", power_db=3, delay_m={RAMP}',),
    "between RECS": ('kind="between-recs", top_m=100, power_db=3, period_s=5, first_recs_s=2',),
    "meaconer of a moving victim": (f'kind="meaconing", power_db=6, delay_s=1e-6, {ANTENNA}', CIRCLE),
    "meaconer, 2 s": ('kind="meaconing", power_db=6, delay_s=2', CIRCLE),
}


def spoofing_signals(attack: str, *settings: str) -> list[tuple[Band, ReceivedSatellite]]:
    sky = (f"receiver.sample_rate_hz={RATE_HZ}", "constellation.svids=[7, 8]", f"attack=[{{{attack}}}]")
    scenario = load_scenario(NIGHT, (*sky, *settings))
    assert isinstance(scenario, CampaignScenario)
    case = AcasTestCase(scenario=scenario, first=0, end=8)
    return [
        (band, one) for band in Band for one in case.sky(band) if isinstance(one.pseudorange, ReceivedSpoofingSignal)
    ]


def steps(band: Band, signal: ReceivedSatellite) -> tuple[float, float, float]:
    """Return the largest steps between stretches that carry the signal: code in m, carrier in cycles, power in dB."""
    t_s = (np.arange(int(FROM_S / STRETCH_S), int(TO_S / STRETCH_S)) + 0.5) * STRETCH_S
    path, to_cycles = signal.pseudorange, CARRIER_HZ[band] / SPEED_OF_LIGHT_MPS
    rate_mps, range_m, bend_mps2 = path.rate_mps(t_s), path.range_m(t_s), path.acceleration_mps2(t_s)
    held = [signal.propagation(float(one)) for one in t_s]
    at = {name: np.array([getattr(one, name) for one in held]) for name in (
        "amplitude", "growth_per_s", "doppler_hz", "doppler_rate_hz_per_s", "delay_m", "delay_rate_mps")}  # fmt: skip

    def edge(x_s: float) -> tuple[Float[np.ndarray, " n"], ...]:
        moved_m = range_m + rate_mps * x_s + bend_mps2 * x_s**2 / 2
        turned = at["doppler_hz"] * x_s + at["doppler_rate_hz_per_s"] * x_s**2 / 2
        cycles = np.angle(at["amplitude"]) / (2 * np.pi) - to_cycles * moved_m + turned
        strength = np.abs(at["amplitude"]) * (1 + at["growth_per_s"] * x_s)
        return moved_m + at["delay_m"] + at["delay_rate_mps"] * x_s, cycles, strength

    (code_m, cycles, strength), (next_m, next_cycles, next_strength) = edge(STRETCH_S / 2), edge(-STRETCH_S / 2)
    on = (strength[:-1] > 0) & (next_strength[1:] > 0)
    assert np.count_nonzero(on) > 100
    turn = next_cycles[1:] - cycles[:-1]
    return (
        float(np.max(np.abs(next_m[1:] - code_m[:-1])[on])),
        float(np.max(np.abs(turn - np.round(turn))[on])),
        float(np.max(np.abs(20 * np.log10(next_strength[1:][on] / strength[:-1][on])))),
    )


@pytest.mark.parametrize("name", SCENES)
def test_nothing_steps_between_stretches(name: str) -> None:
    """Corners of profiles are within stretches; without the mean rates code and phase step there by up to 0.9 m."""
    found = [(one.svid, band, *steps(band, one)) for band, one in spoofing_signals(*SCENES[name])]
    print(name, found)
    assert found
    for svid, band, code_m, cycles, power_db in found:
        assert code_m < 1e-3, (svid, band)
        assert cycles < 0.005, (svid, band)
        assert power_db < 1e-3, (svid, band)
