"""Find settings of a scenario that are allowed but probably unintended, and describe each setting in a line of text."""

from __future__ import annotations

from vestige.errors import satellite_names
from vestige.navigation.ephemeris import FIT_INTERVAL_S
from vestige.receiver.front_end.front_end_correlation import range_offset_scale
from vestige.receiver.samples.staircase import commensurate_tread_m
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.recording import RecordingScenario
from vestige.scenario.tables.sky import RinexConstellation
from vestige.signals.definitions import E6C
from vestige.spoofer.scer import Scer
from vestige.spoofer.spoofer import Spoofer

_FAITHFUL = 0.1  # smallest relative change of range offsets that gives a warning


def scenario_warnings(scenario: CampaignScenario | RecordingScenario) -> tuple[str, ...]:
    """Return a line of text for each setting of a scenario that is probably unintended; the result is often empty."""
    if isinstance(scenario, RecordingScenario):
        return _staircase(scenario.receiver.sample_rate_hz)
    attacks = (*Spoofer(attacks=scenario.attack).warnings(), *_aimed_at_nobody(scenario))
    stairs = _staircase(scenario.receiver.sample_rate_hz) if scenario.fidelity == "samples" else ()
    return (
        *left_out(scenario),
        *attacks,
        *_estimated_symbols(scenario),
        *_never(scenario),
        *_old_orbits(scenario),
        *stairs,
        *_round_peak(scenario),
    )


def left_out(scenario: CampaignScenario) -> tuple[str, ...]:
    """Return a warning if satellites of `constellation.svids` are left out, because they are never above the mask."""
    if scenario.constellation is None:
        return ()
    sky = {simulation.svid for simulation in scenario.simulations}
    absent = sorted(set(scenario.constellation.svids) - sky)
    if not absent:
        return ()
    return (
        f"constellation.svids: {satellite_names(absent)} left out, because never above mask_deg = "
        f"{scenario.constellation.mask_deg:g} in this run; the scenario has {satellite_names(sorted(sky))}",
    )


def _estimated_symbols(scenario: CampaignScenario) -> tuple[str, ...]:
    return tuple(
        f'attack.{number}.symbols: "{attack.symbols}" changes nothing in a campaign, which does not simulate E1-B; '
        "recordings (vestige simulate) have it"
        for number, attack in enumerate(scenario.attack)
        if isinstance(attack, Scer) and attack.symbols != "known"
    )


def _never(scenario: CampaignScenario) -> tuple[str, ...]:
    end_s = scenario.epochs * scenario.interval_s
    return tuple(
        f"attack.{number}.start_s: {attack.start_s:g} s is not before the end of the scenario, {end_s:g} s"
        for number, attack in enumerate(scenario.attack)
        if attack.start_s >= end_s
    )


def _old_orbits(scenario: CampaignScenario) -> tuple[str, ...]:
    """Return a warning if broadcast orbits are used beyond their fit interval; Walker orbits are always valid."""
    if not isinstance(scenario.constellation, RinexConstellation):
        return ()
    end = scenario.start_time + scenario.epochs * scenario.interval_s
    toes = [one.elevation.path.ephemeris.toe for one in scenario.simulations if one.elevation is not None]
    age_s = end - min(toes)
    if age_s <= FIT_INTERVAL_S:
        return ()
    return (
        f"constellation.path: the run ends {age_s / 3600:.1f} h after the toe of {min(toes)}, beyond the "
        f"{FIT_INTERVAL_S / 3600:g} h for which ephemerides are made; each satellite keeps its ephemeris, as true "
        "orbit and in the receiver",
    )


def _aimed_at_nobody(scenario: CampaignScenario) -> tuple[str, ...]:
    aims = {number: attack for number, attack in enumerate(scenario.attack) if attack.svids}
    if not aims:
        return ()
    sky = {simulation.svid for simulation in scenario.simulations}
    absent = {number: sorted(set(attack.svids) - sky) for number, attack in aims.items()}
    return tuple(
        f"attack.{number}.svids: {satellite_names(svids)} not in the scenario, which has {satellite_names(sorted(sky))}"
        for number, svids in absent.items()
        if svids
    )


def _staircase(rate_hz: float) -> tuple[str, ...]:
    stairs = commensurate_tread_m(rate_hz, E6C.chip_rate_hz)
    if stairs is None:
        return ()
    return (
        f"receiver.sample_rate_hz: {rate_hz / 1e6:g} MHz is commensurate with the chip rate of E6, so the "
        f"correlation has steps of {stairs.tread_m:.1f} m; {stairs.good_rate_hz / 1e6:g} MHz is a good rate",
    )


def _round_peak(scenario: CampaignScenario) -> tuple[str, ...]:
    front_end = scenario.receiver.front_end.front_end(scenario.receiver.sample_rate_hz)
    if front_end.bandwidth_hz is None:
        return ()
    spacing_m = scenario.processor.spacing * scenario.processor.tap_spacing_m
    scale = range_offset_scale(front_end, spacing_m)
    if abs(scale - 1) < _FAITHFUL:
        return ()
    return (
        f"receiver.front_end.bandwidth_hz: {front_end.bandwidth_hz / 1e6:g} MHz make the peak round; three correlators "
        f"{spacing_m:g} m apart, fitted with a triangle, then give {scale:.2f} times the range offset",
    )
