"""Compute the columns of the results that are stored for a user's checks.

With these columns, results contain all evidence for a user's check. Results contain all of these columns only if the
scenario has user's checks. The checks of vestige at levels 2 and 3 also need two of the columns, `e1_doppler_hz` and
`e6_power_db`. The columns are stored without rounding, so a campaign and `vestige.simulate` give a user's check the
same evidence.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vestige.acas_processor.measurement import MeasurementBlock
from vestige.campaign.plan import column_table
from vestige.errors import VestigeError
from vestige.records import Band
from vestige.time import GalileoTime

_EPOCH, _SATELLITE = ("epoch",), ("epoch", "satellite")

OWN_CHECK_COLUMNS = column_table(
    ("e1_carrier_phase_cycles", _SATELLITE, "float64", "1", "carrier phase on E1 in cycles"),
    ("e1_doppler_hz", _SATELLITE, "float64", "Hz", "Doppler on E1, positive when the satellite approaches"),
    ("e1_doppler_rate_hz_per_s", _SATELLITE, "float64", "Hz s-1", "rate of the Doppler on E1"),
    (
        "e6_expected_s",
        _SATELLITE,
        "float64",
        "s",
        "time from the epoch to the RECS arrival that E1 predicts; NaN if not correlated",
    ),
    ("e6_expected_doppler_hz", _SATELLITE, "float64", "Hz", "Doppler on E6 that E1 predicts; NaN if not correlated"),
    (
        "e6_received_at_s",
        _SATELLITE,
        "float64",
        "s",
        "time after the start of the scenario at which the last E6 sample was received",
    ),
    ("e6_power_db", _EPOCH, "float32", "dB", "power of the E6 band over the power without attack; NaN without RECS"),
)


def own_check_columns(start: GalileoTime, measured: MeasurementBlock) -> dict[str, np.ndarray]:
    """Return the values of `OWN_CHECK_COLUMNS`; `start` is the start time of the scenario."""
    snapshots = measured.snapshots
    return {
        "e1_carrier_phase_cycles": snapshots.e1.carrier_phase_cycles,
        "e1_doppler_hz": snapshots.e1.doppler_hz,
        "e1_doppler_rate_hz_per_s": snapshots.e1.doppler_rate_hz_per_s,
        "e6_expected_s": measured.expected_s,
        "e6_expected_doppler_hz": measured.doppler_e6_hz,
        "e6_received_at_s": snapshots.received_at.since(start),
        "e6_power_db": snapshots.front_end[Band.E6].total_power_db,
    }


def require_own_check_columns(columns: Mapping[str, np.ndarray]) -> None:
    """Raise `VestigeError` if the results of a scenario with user's checks lack a column of `OWN_CHECK_COLUMNS`."""
    missing = [name for name in OWN_CHECK_COLUMNS if name not in columns]
    if missing:
        raise VestigeError(
            f"results of a campaign: found no {', '.join(missing)}, expected them because the scenario has your own "
            "checks; run the campaign again with this version"
        )
