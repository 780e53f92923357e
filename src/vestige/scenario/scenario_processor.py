"""Make the processor of a campaign from the data that a real receiver would know, without the simulation's truth.

The receiver knows its front ends, its antenna (C/N0 as a function of the elevation), and the power of its bands without
interference. The receiver also knows the data sheets of its oscillator and its accelerometers. Other known data are the
broadcast orbits, the receiver's own tracking loops, and the standard deviations of pseudoranges in `[position]`.
`[processor]` states the expected C/N0, the expected C/N0 difference between E6 and E1, and the expected number of
satellites. If the number of satellites is not stated, the receiver counts the satellites above the mask at the first
epoch. For this count the receiver has an almanac and a rough position at the start. The count uses no later epoch, so
the results of an epoch do not depend on the length of the run.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vestige.acas_processor.checks.clock import ClockDriftMonitor
from vestige.acas_processor.checks.e6_phase import E6PhaseMonitor
from vestige.acas_processor.checks.inertial import InertialMonitor
from vestige.acas_processor.checks.power.decision_map import Hypotheses, PowerDistortionMonitor
from vestige.acas_processor.checks.power.e6_fading import E6FadingMonitor
from vestige.acas_processor.checks.power.received_power import ReceivedPowerMonitor
from vestige.acas_processor.checks.second_signal import SecondSignalMonitor
from vestige.acas_processor.monitoring.alarm_budget import Cadence
from vestige.acas_processor.monitoring.baseline import Antenna, ReferenceLevels
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.acas_processor.position.pseudorange_errors import PseudorangeErrors
from vestige.acas_processor.processor import AcasProcessor
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.receiver.correlators.e1_taps import INTEGRATION_S, POWER_AVERAGING_S, POWER_BANDWIDTH_HZ, TAP_CHIPS
from vestige.receiver.errors.clock import TwoStateClock
from vestige.recording.navigation.rinex_navigation import parse_rinex_navigation, rinex_navigation_text
from vestige.records import Band
from vestige.signals.definitions import E1C
from vestige.signals.pulse import BOC11

if TYPE_CHECKING:
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.stored import StoredScenario

# standard deviation in dB of the power in the decision map, small because the simulated front end does not drift
_POWER_SIGMA_DB = 0.1


class Overhead(NamedTuple):
    """Number of satellites that the receiver expects in view, and their mean C/N0 on E1."""

    satellites: int
    cn0_e1_dbhz: float


def processor_of(scenario: CampaignScenario) -> AcasProcessor:
    """Return the processor of a campaign's receiver.

    The processor knows the receiver's antenna, front ends and oscillator, and the broadcast orbits. The processor does
    not know the simulated errors and attacks.

    Parameters
    ----------
    scenario
        Campaign, for example from `load_scenario`.

    Returns
    -------
    AcasProcessor
        Processor with the level, the detector and the checks of the table `[processor]`.

    Examples
    --------
    >>> import vestige as vs
    >>> scenario = vs.load_scenario("scenarios/quick.toml", ["processor.level=2"])
    >>> vs.processor_of(scenario).level
    2
    """
    return receiver_processor(scenario, overhead_of(scenario), navigation_text(scenario))


def navigation_text(scenario: CampaignScenario) -> str | None:
    """Return the broadcast orbits of a constellation as the text of a RINEX file; None for a single line of sight."""
    if scenario.constellation is None:
        return None
    paths = [one.elevation.path for one in scenario.simulations if one.elevation is not None]
    return rinex_navigation_text(path.ephemeris for path in paths)


def receiver_processor(
    scenario: CampaignScenario | StoredScenario, overhead: Overhead, navigation: str | None
) -> AcasProcessor:
    """Return the processor of a scenario's receiver.

    `overhead` gives the number and the mean C/N0 of the satellites in view. `navigation` is the text of a RINEX file
    with the orbits, or None.
    """
    receiver, table = scenario.receiver, scenario.processor
    front_end = receiver.front_end.front_end(receiver.sample_rate_hz)
    antenna = _antenna(scenario)
    oscillator = TwoStateClock(h0_s=table.oscillator.h0_s, h_minus_2_hz=table.oscillator.h_minus_2_hz)
    monitoring = MonitoringSettings(
        cadence=Cadence(
            satellites=overhead.satellites,
            observation_s=scenario.interval_s,
            recs_s=scenario.interval_s * scenario.recs.every,
            search_s=table.search_s,
        ),
        alarms_per_day=table.alarms_per_day,
        levels=ReferenceLevels(e1_power_db=0.0, e6_power_db=0.0, antenna=antenna),
        fix=_fix(scenario, navigation),
        e1_power=ReceivedPowerMonitor(band=Band.E1, bandwidth_hz=POWER_BANDWIDTH_HZ, averaging_s=POWER_AVERAGING_S),
        e6_power=ReceivedPowerMonitor(
            band=Band.E6, bandwidth_hz=front_end.power_bandwidth_hz, averaging_s=scenario.recs.integration_s
        ),
        second_signal=SecondSignalMonitor(ray_power_db=table.ray_power_db),
        second_signal_filtered=front_end.bandwidth_hz is not None,
        clock=ClockDriftMonitor(white_s=oscillator.white_s, walk_hz=oscillator.walk_hz),
        power_distortion=PowerDistortionMonitor(
            hypotheses=Hypotheses(
                pulse=BOC11,
                chip_rate_hz=E1C.chip_rate_hz,
                half_spacing_chips=max(TAP_CHIPS),
                sky_cn0_dbhz=overhead.cn0_e1_dbhz,
                integration_s=INTEGRATION_S,
                bandwidth_hz=POWER_BANDWIDTH_HZ,
                n_satellites=overhead.satellites,
                sigma_power_db=_POWER_SIGMA_DB,
            )
        ),
        inertial=InertialMonitor(
            sigma_bias_mps2=table.inertial.sigma_bias_mps2,
            walk_mps_per_sqrt_s=table.inertial.walk_mps_per_sqrt_s,
            clock_walk_hz=oscillator.walk_hz,
        ),
        exhaustive_period_s=table.search_s,
        **_e6_carrier(scenario),
    )
    stated_db = table.e6_over_e1_db
    return replace(
        table.processor(monitoring),
        e6_over_e1_db=antenna.e6_dbhz - antenna.e1_dbhz if stated_db is None else stated_db,
        cipher_mode=CipherMode(scenario.recs.cipher_mode),
    )


def _e6_carrier(scenario: CampaignScenario | StoredScenario) -> dict[str, Any]:
    """Return phase monitor and fading monitor of E6 by name; an empty result means that the two monitors are off."""
    table = scenario.processor.e6_carrier
    if table is None:
        return {}
    shared: dict[str, Any] = {"window": table.window, "ray_power_db": scenario.processor.ray_power_db}
    if table.ray_life_s is not None:
        shared["ray_life_s"] = table.ray_life_s
    loops = scenario.receiver.e1_tracking
    of_loops = {
        "pll_bandwidth_hz": "pll_bandwidth_hz",
        "fll_bandwidth_hz": "fll_bandwidth_hz",
        "loop_integration_s": "integration_s",
    }
    known = {ours: getattr(loops, theirs) for ours, theirs in of_loops.items() if hasattr(loops, theirs)}
    return {
        "e6_phase": E6PhaseMonitor(change_mps=table.change_mps, **shared, **known),
        "e6_fading": E6FadingMonitor(**shared),
    }


def _antenna(scenario: CampaignScenario | StoredScenario) -> Antenna:
    receiver, table = scenario.receiver, scenario.processor
    return Antenna(
        e1_dbhz=receiver.cn0_e1_dbhz if table.expected_cn0_e1_dbhz is None else table.expected_cn0_e1_dbhz,
        e6_dbhz=receiver.cn0_dbhz if table.expected_cn0_e6_dbhz is None else table.expected_cn0_e6_dbhz,
        fall_db=0.0 if scenario.constellation is None else scenario.constellation.cn0_fall_db,
    )


def _fix(scenario: CampaignScenario | StoredScenario, navigation: str | None) -> FixSettings:
    """Return the settings of the position fix: orbits that are valid in the whole run, and errors of pseudoranges."""
    table = scenario.position
    lines = enumerate(() if navigation is None else navigation.splitlines(), 1)
    return FixSettings(
        ephemerides=() if navigation is None else tuple(parse_rinex_navigation(Path("navigation"), lines)),
        errors=PseudorangeErrors(
            floor_m=table.floor_sigma_m,
            ionosphere_m=table.ionosphere_sigma_m,
            ionosphere_common=table.ionosphere_common,
            multipath_m=table.multipath_sigma_m,
            loops=scenario.receiver.e1_tracking,
        ),
        fit_interval_s=math.inf,
    )


def overhead_of(scenario: CampaignScenario) -> Overhead:
    """Return the number of satellites in view that a receiver expects, with the mean C/N0 of these satellites."""
    antenna, effects = _antenna(scenario), [one.elevation for one in scenario.simulations if one.elevation is not None]
    stated = scenario.processor.expected_satellites
    if not effects:
        return Overhead(1 if stated is None else stated, antenna.e1_dbhz)
    elevation_rad = np.array([one.first_rad for one in effects])
    mask_rad = np.radians([one.mask_deg for one in effects])
    in_view = elevation_rad >= mask_rad
    # if no satellite is in view at the first epoch, the receiver expects one satellite at the elevation mask
    seen_rad = elevation_rad[in_view] if in_view.any() else mask_rad[:1]
    satellites = seen_rad.size if stated is None else stated
    return Overhead(satellites, float(np.mean(antenna.expected_dbhz(antenna.e1_dbhz, seen_rad))))
