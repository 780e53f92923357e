"""What a scenario asks for that is allowed and probably not meant: one line each, for stderr."""

from __future__ import annotations

from vestige.receiver.staircase import commensurate_tread_m
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.recording import RecordingScenario
from vestige.signals.definitions import E6C
from vestige.spoofer.spoofer import Spoofer


def cautions(scenario: CampaignScenario | RecordingScenario) -> tuple[str, ...]:
    """Return what the author of a scenario should know before it runs; nothing for most."""
    attacks = Spoofer(attacks=scenario.attack).cautions() if isinstance(scenario, CampaignScenario) else ()
    if isinstance(scenario, CampaignScenario) and scenario.fidelity == "correlators":
        return attacks
    rate_hz = scenario.receiver.sample_rate_hz
    stairs = commensurate_tread_m(rate_hz, E6C.chip_rate_hz)
    if stairs is None:
        return attacks
    return (
        *attacks,
        f"receiver.sample_rate_hz: {rate_hz / 1e6:g} MHz is commensurate with the chip rate of E6, the correlation a "
        f"staircase with treads of {stairs.tread_m:.1f} m; {stairs.good_rate_hz / 1e6:g} MHz is a good rate",
    )
