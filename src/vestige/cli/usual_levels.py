"""Define options for reference values (power, C/N0, E1 range errors), position and accepted false alarms.

If a power or a C/N0 is not stated, the receiver learns the value from RECS without an alarm.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import number_option, options_together
from vestige.constants import NOMINAL_E6_OVER_E1_DB

if TYPE_CHECKING:
    from vestige.acas_processor.monitoring.baseline import ReferenceLevels
    from vestige.acas_processor.position.fix_measurement import FixSettings
    from vestige.acas_processor.position.possible_range import ApproximatePosition
    from vestige.acas_processor.position.pseudorange_errors import PseudorangeErrors
    from vestige.navigation.ephemeris import Ephemeris


# options for the reference values of the checks, and for the accepted number of false alarms a day
usual_level_options = options_together(
    *(
        number_option(
            f"--usual-{band.lower()}-power-db",
            (-200, 200),
            help=f"Power of the {band} samples in dB without interference. [default: learned]",
        )
        for band in ("E1", "E6")
    ),
    *(
        number_option(
            f"--usual-{band}-cn0-dbhz",
            (0, 80),
            help=f"Usual C/N0 of {band.upper()}-C in dBHz; needs --usual-{other}-cn0-dbhz. [default: learned]",
        )
        for band, other in (("e1", "e6"), ("e6", "e1"))
    ),
    number_option(
        "--e6-over-e1-db",
        (-40, 40),
        help="Expected C/N0 of E6-C minus C/N0 of E1-C in dB. This value decides whether E6 should have been detected. "
        f"[default: difference of the two options above, or {NOMINAL_E6_OVER_E1_DB:g}]",
    ),
    number_option(
        "--cn0-fall-db",
        (0, 40),
        default=0.0,
        help="Usual C/N0 at the zenith minus usual C/N0 at the horizon, in dB.",
    ),
    number_option(
        "--floor-sigma-m",
        (0, 1000),
        default=5.0,
        help="Standard deviation of each E1 range in m, for RAIM and clock checks.",
    ),
    number_option(
        "--ionosphere-sigma-m",
        (0, 1000),
        default=0.0,
        help="Standard deviation of the ionospheric error of E1 ranges at 17.5° elevation, in m.",
    ),
    number_option(
        "--multipath-sigma-m",
        (0, 1000),
        default=0.0,
        help="Standard deviation of the multipath error of E1 ranges at 16° elevation, in m.",
    ),
    click.option(
        "--near",
        metavar="LAT,LON,KM",
        help="Approximate position: the receiver is at most KM km from this latitude and longitude in degrees. Signals "
        "that a search finds are not used if their range contradicts this position. Needs orbits (--navigation, "
        "--track).",
    ),
    number_option(
        "--alarms-per-day",
        (1e-6, 1000),
        help="Accepted number of false alarms a day with ten satellites and a RECS each 30 s. The number sets --kappa "
        "and the thresholds of the other checks.",
    ),
)


def reference_levels(options: dict[str, Any]) -> ReferenceLevels:
    """Return the reference levels that the options state; the receiver learns levels that are not stated.

    The function raises `click.UsageError` if the C/N0 of only one band is given, or if `--cn0-fall-db` is given without
    the C/N0 of E1 and E6.
    """
    from vestige.acas_processor.monitoring.baseline import Antenna, ReferenceLevels

    e1_dbhz, e6_dbhz, fall_db = (options[name] for name in ("usual_e1_cn0_dbhz", "usual_e6_cn0_dbhz", "cn0_fall_db"))
    if (e1_dbhz is None) != (e6_dbhz is None):
        raise click.UsageError("--usual-e1-cn0-dbhz and --usual-e6-cn0-dbhz belong together: give both, or none")
    if fall_db and e1_dbhz is None:
        raise click.UsageError("--cn0-fall-db lowers a usual C/N0: add --usual-e1-cn0-dbhz and --usual-e6-cn0-dbhz")
    return ReferenceLevels(
        e1_power_db=options["usual_e1_power_db"],
        e6_power_db=options["usual_e6_power_db"],
        antenna=None if e1_dbhz is None else Antenna(e1_dbhz=e1_dbhz, e6_dbhz=e6_dbhz, fall_db=fall_db),
    )


def expected_e6_over_e1_db(options: dict[str, Any]) -> float:
    """Return the expected C/N0 of E6-C minus the C/N0 of E1-C, in dB.

    The options state this difference, or the usual C/N0 of E1 and E6. The default is the difference at minimum received
    power.
    """
    if options["e6_over_e1_db"] is not None:
        return float(options["e6_over_e1_db"])
    e1_dbhz, e6_dbhz = (options[f"usual_{band}_cn0_dbhz"] for band in ("e1", "e6"))
    return NOMINAL_E6_OVER_E1_DB if e1_dbhz is None or e6_dbhz is None else float(e6_dbhz - e1_dbhz)


def fix_settings(
    options: dict[str, Any], ephemerides: tuple[Ephemeris, ...], authenticated: frozenset[int] | None
) -> FixSettings:
    """Return the settings of a position fix: orbits, and E1 range errors and approximate position from the options."""
    from vestige.acas_processor.position.fix_measurement import FixSettings

    return FixSettings(
        ephemerides=ephemerides,
        authenticated=authenticated,
        errors=pseudorange_errors(options),
        near=approximate_position(options),
    )


def approximate_position(options: dict[str, Any]) -> ApproximatePosition | None:
    """Return the approximate position of the receiver that the options state; None without `--near`.

    The function raises `click.UsageError` if `--near` is not a valid position, or if `--no-track` is given without
    `--navigation`, so that there are no orbits.
    """
    import numpy as np

    from vestige.acas_processor.position.possible_range import ApproximatePosition
    from vestige.navigation.earth import ecef_from_geodetic

    text = options["near"]
    if text is None:
        return None
    if options["navigation"] is None and options["track"] is False:
        raise click.UsageError("--near needs orbits: add --navigation, or --track for the orbits of the message")
    try:
        latitude_deg, longitude_deg, reach_km = (float(one) for one in text.split(","))
        if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 360):
            raise ValueError
        place = np.radians([latitude_deg]), np.radians([longitude_deg]), np.zeros(1)
        x, y, z = ecef_from_geodetic(*place)[0].tolist()
        return ApproximatePosition(position_m=(x, y, z), reach_m=1000 * reach_km)
    except ValueError:
        expected = "expected latitude and longitude in degrees and a distance in km, as --near 48.1,11.6,50"
        raise click.UsageError(f"--near {text}: {expected}") from None


def pseudorange_errors(options: dict[str, Any]) -> PseudorangeErrors:
    """Return the standard deviations of the errors of E1 ranges that the options state.

    The function raises `click.UsageError` if `--floor-sigma-m` is 0.
    """
    from vestige.acas_processor.position.pseudorange_errors import PseudorangeErrors

    floor_m, ionosphere_m, multipath_m = (options[f"{name}_sigma_m"] for name in ("floor", "ionosphere", "multipath"))
    if not floor_m:
        raise click.UsageError("--floor-sigma-m 0: every range has some error, expected more than 0")
    return PseudorangeErrors(floor_m=floor_m, ionosphere_m=ionosphere_m, multipath_m=multipath_m)
