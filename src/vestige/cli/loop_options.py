"""Define the options of the tracking loops, which `vestige track`, `vestige process` and `vestige live` share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from vestige.cli.options import choice_option, number_option, options_together

if TYPE_CHECKING:
    from vestige.sample_processor.tracking.settings import TrackingSettings

LOOP_NAMES = (
    "pll_bandwidth_hz",
    "pll_order",
    "fll_bandwidth_hz",
    "dll_bandwidth_hz",
    "pll_discriminator",
    "dll_discriminator",
    "integration_ms",
    "early_late_chips",
    "correlators",
    "replica",
)

loop_options = options_together(
    number_option("--pll-bandwidth-hz", (0.1, 100), default=15.0, help="One-sided noise bandwidth of the PLL in Hz."),
    choice_option("--pll-order", ["2", "3"], default="3", help="Order of the PLL."),
    number_option("--fll-bandwidth-hz", (0.1, 60), default=10.0, help="One-sided noise bandwidth of the FLL in Hz."),
    number_option("--dll-bandwidth-hz", (0.01, 20), default=1.0, help="One-sided noise bandwidth of the DLL in Hz."),
    choice_option(
        "--pll-discriminator", ["normalized quadrature", "arctan2", "arctan"], help="Discriminator of the PLL."
    ),
    choice_option("--dll-discriminator", ["early-minus-late power", "dot product"], help="Discriminator of the DLL."),
    choice_option("--integration-ms", ["4", "20"], help="Coherent integration time in ms."),
    number_option("--early-late-chips", (0.01, 0.66), default=0.16, help="Early-to-late spacing of the DLL in chips."),
    choice_option("--correlators", ["5", "7", "9", "11"], help="Number of correlators of each satellite."),
    choice_option("--replica", ["BOC(1,1)", "CBOC"], help="Subcarrier of the replica."),
)


def loop_settings(options: dict[str, Any]) -> TrackingSettings:
    """Return the tracking settings that the loop options state."""
    from vestige.constants import E1_CODE_PERIOD_S
    from vestige.sample_processor.tracking.settings import TrackingSettings

    return TrackingSettings(
        pll_bandwidth_hz=options["pll_bandwidth_hz"],
        pll_order=int(options["pll_order"]),
        fll_bandwidth_hz=options["fll_bandwidth_hz"],
        dll_bandwidth_hz=options["dll_bandwidth_hz"],
        pll_discriminator=options["pll_discriminator"],
        dll_discriminator=options["dll_discriminator"],
        integration_periods=round(int(options["integration_ms"]) / (1e3 * E1_CODE_PERIOD_S)),
        early_late_chips=options["early_late_chips"],
        n_correlators=int(options["correlators"]),
        replica=options["replica"],
    )


def check_no_loop_options() -> None:
    """Raise a usage error if the command line has a loop option, although E1 is not tracked."""
    context = click.get_current_context()
    for name in LOOP_NAMES:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = f"--{name.replace('_', '-')}"
            raise click.UsageError(
                f"{option}: only where E1 is tracked; here observations are given, or E1 is measured around each RECS"
            )
