"""Write E1 observations of a simulated receiver as RINEX files, which other receiver software can read.

The observation file has pseudorange, Doppler and C/N0 of E1-C at every epoch with a tracked satellite, on the
receiver's clock. The observations belong to the tracked signal. Under attack, the tracked signal may be a spoofing
signal. The observation file has no carrier phase, because results contain a carrier phase only if the scenario has
user's checks. The navigation file has the orbits and clocks of the run, with a new issue of the ephemerides every 2 h.

If the scenario has no table `[atmosphere]`, pseudoranges contain the residual of the ionosphere, but no troposphere.
The settings of `rnx2rtkp` [RTKLIB] therefore apply no corrections, and use RAIM with exclusion of one satellite. If the
scenario has the table `[atmosphere]`, the pseudoranges also contain the delays from this table, which the settings do
not correct.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray

from vestige.campaign.store.attributes import NAVIGATION_TEXT, attributes_of, scenario_of, values
from vestige.errors import VestigeError
from vestige.navigation.reissue import issues
from vestige.output import new_folder
from vestige.recording.navigation.rinex_navigation import parse_rinex_navigation, write_rinex_navigation
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

OBSERVATIONS, NAVIGATION, OPTIONS = "observations.rnx", "navigation.rnx", "rtklib.conf"
COMMAND = f"rnx2rtkp -k {OPTIONS} -o position.pos {OBSERVATIONS} {NAVIGATION}"

_RTKLIB = """\
pos1-posmode       =single
pos1-frequency     =l1
pos1-navsys        =8
pos1-elmask        =0
pos1-sateph        =brdc
pos1-ionoopt       =off
pos1-tropopt       =off
pos1-posopt5       =on
out-solformat      =xyz
out-timesys        =gpst
"""
_TENTHS = 10  # number of tenths in a second; epochs are at whole tenths of a second


@dataclass(frozen=True, slots=True, kw_only=True)
class RinexExport:
    """Summary of the RINEX files that were written."""

    files: tuple[Path, ...]  # observations, navigation data, settings of `rnx2rtkp`
    n_epochs: int  # number of epochs with at least one satellite
    svids: tuple[int, ...]  # satellites that were tracked at some epoch
    n_ephemerides: int  # number of records of the navigation file


def export_rinex(results: xarray.Dataset, folder: Path) -> RinexExport:
    """Write E1 observations and ephemerides of a sky as RINEX files into a new folder.

    The results must contain all epochs of a campaign. The folder must not exist.

    `VestigeError` is raised if the results do not belong to a sky, no satellite was tracked, or `folder` exists.
    """
    navigation = attributes_of(results).navigation
    if navigation is None:
        raise VestigeError("results: found a single line of sight, expected a sky, with [constellation]")
    scenario, start = scenario_of(results), scenario_of(results).start_time
    lines = enumerate(navigation.splitlines(), 1)
    end = start + scenario.epochs * scenario.interval_s
    given = parse_rinex_navigation(Path(NAVIGATION_TEXT), lines)
    ephemerides = [issue for one in given for issue in issues(one, start, end)]
    cn0_dbhz = values(results, "e1_cn0_dbhz", "epoch", "satellite")
    tracked = np.isfinite(values(results, "e1_pseudorange_m", "epoch", "satellite"))
    if not tracked.any():
        raise VestigeError("results: found no satellite that E1 tracked, expected at least one")
    svids = results["svid"].values
    with new_folder(folder) as place:
        write_rinex_observations(place / OBSERVATIONS, _epochs(results, start, tracked, cn0_dbhz))
        write_rinex_navigation(place / NAVIGATION, ephemerides)
        (place / OPTIONS).write_text(_RTKLIB, encoding="ascii", newline="\n")
    return RinexExport(
        files=tuple(folder / name for name in (OBSERVATIONS, NAVIGATION, OPTIONS)),
        n_epochs=int(np.count_nonzero(tracked.any(axis=1))),
        svids=tuple(svids[tracked.any(axis=0)].tolist()),
        n_ephemerides=len(ephemerides),
    )


def _epochs(
    results: xarray.Dataset, start: GalileoTime, tracked: np.ndarray, cn0_dbhz: np.ndarray
) -> Iterator[ObservationEpoch]:
    """Yield the observations of each epoch in which at least one satellite is tracked."""
    svids = results["svid"].values.tolist()
    range_m = values(results, "e1_pseudorange_m", "epoch", "satellite")
    doppler_hz = values(results, "e1_doppler_hz", "epoch", "satellite")
    tenths = np.rint(results["time_s"].values * _TENTHS).astype(np.int64)  # RINEX needs the exact epoch
    for row in np.flatnonzero(tracked.any(axis=1)):
        whole, rest = divmod(int(tenths[row]), _TENTHS)
        seen = {
            svids[column]: E1Observation(
                svid=svids[column],
                pseudorange_m=float(range_m[row, column]),
                carrier_phase_cycles=float("nan"),
                doppler_hz=float(doppler_hz[row, column]),
                doppler_rate_hz_per_s=float("nan"),
                cn0_dbhz=float(cn0_dbhz[row, column]),
            )
            for column in np.flatnonzero(tracked[row])
        }
        yield ObservationEpoch(time=start + whole + rest / _TENTHS, observations=seen)
