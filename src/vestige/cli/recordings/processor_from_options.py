"""Make the processor that the options of `vestige process` and `vestige live` describe."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import cipher_mode, group_delay_convention
from vestige.cli.usual_levels import expected_e6_over_e1_db, fix_settings, reference_levels

if TYPE_CHECKING:
    from vestige.acas_processor.detectors import Detector
    from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
    from vestige.acas_processor.processor import AcasProcessor
    from vestige.crypto.osnma.osnma_report import AuthenticatedData
    from vestige.recording.tracked.track_recording import TrackedRecording


def processor_from_options(
    options: dict[str, Any], tracked: TrackedRecording | None = None, proven: tuple[AuthenticatedData, ...] = ()
) -> AcasProcessor:
    """Return the processor that the options describe.

    Parameters
    ----------
    options
        Values of the options of the command line, by the names of their parameters (`process_options`).
    tracked
        Result of tracking E1, whose orbits and correlators are used; None if E1 was not tracked.
    proven
        Navigation data in the tracked message that OSNMA tags verified.

    Raises
    ------
    click.UsageError
        If two checks have the same name, the bank of correlators is too short or too long, or the options of
        `usual_levels` contradict each other or have invalid values.
    VestigeError
        If the navigation file, or a detector or check of the user, cannot be used.
    """
    from vestige.acas_processor.own_check import OwnCheck
    from vestige.acas_processor.position.error_budget import ErrorBudget
    from vestige.acas_processor.processor import AcasProcessor

    budget = {"uncorrected": ErrorBudget.uncorrected, "corrected": ErrorBudget.corrected}[options["budget"]]
    checks = tuple(OwnCheck.named(kind) for kind in options["checks"])
    if len({one.name for one in checks}) < len(checks):
        raise click.UsageError("--check: two checks have the same name, expected a different name for each check")
    monitoring = _monitoring(options, tracked, proven)
    try:
        processor = AcasProcessor(
            level=int(options["level"]),
            detector=_detector(options["detector"], options["spacing"]),
            p_fa=options["p_fa"],
            n_taps=options["taps"],
            tap_spacing_m=options["tap_spacing_m"],
            early_reach_m=options["early_reach_m"],
            budget=budget(),
            kappa=options["kappa"],
            min_pd=options["min_pd"],
            e6_over_e1_db=expected_e6_over_e1_db(options),
            monitoring=monitoring,
            cipher_mode=cipher_mode(options),
            group_delay_convention=group_delay_convention(options),
            own_checks=checks,
        )
    except ValueError as error:
        raise click.UsageError(f"--taps, --tap-spacing-m, --early-reach-m, --spacing: {error}") from error
    return processor


def _detector(name: str, spacing: int) -> Detector:
    from vestige.acas_processor.detectors import DETECTORS, OwnDetector
    from vestige.own_parts import is_own, part

    return (
        OwnDetector.of(name, part(name, object), spacing=spacing) if is_own(name) else DETECTORS[name](spacing=spacing)
    )


def _monitoring(
    options: dict[str, Any], tracked: TrackedRecording | None, proven: tuple[AuthenticatedData, ...]
) -> MonitoringSettings:
    """Return the settings of levels 2 and 3, with orbits from a navigation file or from the message."""
    from dataclasses import replace

    from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
    from vestige.acas_processor.searches.sampled_searches import E6ExhaustiveSearch
    from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
    from vestige.recording.tracked.message_navigation import authenticated_orbits, ephemerides_in
    from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
    from vestige.signals.pulse import BOC11

    navigation, settings = options["navigation"], MonitoringSettings()
    authenticated: frozenset[int] | None
    if navigation is not None:  # the user vouches for this file
        orbits, authenticated = read_rinex_navigation(navigation), None
    else:
        orbits, authenticated = authenticated_orbits(() if tracked is None else ephemerides_in(tracked.pages), proven)
    half = settings.power_distortion.hypotheses.half_spacing_chips
    if tracked is not None and tracked.tap_chips:  # take the correlators of the loop with the spacing nearest to `half`
        half = min((chips for chips in tracked.tap_chips if chips > 0), key=lambda chips: abs(chips - half))
    hypotheses = replace(settings.power_distortion.hypotheses, half_spacing_chips=half, pulse=BOC11)
    how = ExhaustiveSearch(integration_s=int(options["search_ms"]) / 1e3)
    return replace(
        settings,
        alarms_per_day=options["alarms_per_day"],
        levels=reference_levels(options),
        fix=fix_settings(options, orbits, authenticated),
        exhaustive_search=E6ExhaustiveSearch(how=how, around_s=options["search_window"]),
        exhaustive_period_s=options["search_every"],
        power_distortion=replace(settings.power_distortion, hypotheses=hypotheses),
        inertial=replace(settings.inertial, sigma_bias_mps2=options["acceleration_bias_mps2"]),
    )
