"""Write Galileo E1 observations as a RINEX observation file, version 3.05 [RINEX].

RINEX keeps epochs to 0.1 µs, ranges to a millimetre, phases to a thousandth of a cycle and Doppler to a millihertz.
RINEX has no field for a Doppler rate. An epoch between two steps of 0.1 µs is refused, because the pseudorange belongs
to the exact reading of the receiver's clock. An error of half a step would be an error of 15 m in range. CSV files of
observations keep all digits, and have a column for the Doppler rate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path

from vestige.recording.observations.rinex_observations import FIELDS
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

_SIGNAL = "1C"  # RINEX code of E1-C
TICKS_PER_S = 10_000_000  # number of epoch ticks in a second
TICK_TOLERANCE = 1e-3  # tolerance as a share of a tick: 0.1 ns, the rounding of float64 seconds over a week


def write_rinex_observations(
    path: Path,
    epochs: Iterable[ObservationEpoch],
    *,
    approximate_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """Write epochs, which must be in time order, as a RINEX file with times in Galileo System Time.

    The function raises `ValueError` if there is no epoch, an epoch is not a multiple of 0.1 µs, or a value does not fit
    its field.

    Parameters
    ----------
    approximate_position_m
        Earth-centred, earth-fixed position of the antenna in m; zeros if the position is not known.
    """
    remaining = iter(epochs)
    first = next(remaining, None)
    if first is None:
        raise ValueError("a RINEX file needs the time of its first observation")
    with path.open("w", encoding="ascii", newline="\n") as stream:
        for content, label in _header(approximate_position_m, first.time):
            stream.write(f"{content:60.60}{label:20}".rstrip() + "\n")
        stream.write(_epoch(first))
        for epoch in remaining:
            stream.write(_epoch(epoch))


def _header(position: tuple[float, float, float], first: GalileoTime) -> list[tuple[str, str]]:
    types = "".join(f" {kind}{_SIGNAL}" for kind in FIELDS)
    date, second = _calendar(first)
    return [
        (f"{'3.05':>9}{'':11}{'OBSERVATION DATA':20}{'E: Galileo':20}", "RINEX VERSION / TYPE"),
        ("vestige", "PGM / RUN BY / DATE"),  # no date, so that equal observations make equal files
        ("vestige", "MARKER NAME"),
        ("", "OBSERVER / AGENCY"),
        (f"{'':20}{'vestige':20}", "REC # / TYPE / VERS"),
        ("", "ANT # / TYPE"),
        ("".join(f"{coordinate:14.4f}" for coordinate in position), "APPROX POSITION XYZ"),
        (f"{0:14.4f}" * 3, "ANTENNA: DELTA H/E/N"),
        (f"E  {len(FIELDS):3d}{types}", "SYS / # / OBS TYPES"),
        (
            f"{date.year:6d}{date.month:6d}{date.day:6d}{date.hour:6d}{date.minute:6d}{second:>13}     GAL",
            "TIME OF FIRST OBS",
        ),
        ("E", "SYS / PHASE SHIFT"),  # version 3 requires this line; blank means unknown
        ("", "END OF HEADER"),
    ]


def _calendar(time: GalileoTime) -> tuple[datetime, str]:
    """Return the calendar time in whole seconds, and the second of the minute as text with seven decimals."""
    ticks = round(time.fraction * TICKS_PER_S)
    if abs(time.fraction * TICKS_PER_S - ticks) > TICK_TOLERANCE:
        raise ValueError(f"epoch {time} + {time.fraction} s is not a multiple of 0.1 µs, the step of RINEX")
    carry, ticks = divmod(ticks, TICKS_PER_S)
    whole = GalileoTime.normalized(time.week, time.second + carry).calendar
    return whole, f"{whole.second:d}.{ticks:07d}"


def _epoch(epoch: ObservationEpoch) -> str:
    date, second = _calendar(epoch.time)
    lines = [f"> {date:%Y %m %d %H %M}{second:>11}  0{len(epoch.observations):3d}"]
    for svid in sorted(epoch.observations):
        observation = epoch.observations[svid]
        line = f"E{svid:02d}"
        for kind, name in FIELDS.items():
            slip = "1" if kind == "L" and svid in epoch.slipped else " "
            line += _field(getattr(observation, name), f"{name} of E{svid:02d}") + slip + " "
        lines.append(line.rstrip())
    return "\n".join(lines) + "\n"


def _field(value: float, name: str) -> str:
    if math.isnan(value):
        return " " * 14
    text = f"{value:14.3f}"
    if len(text) != 14:
        raise ValueError(f"{name}, {value}, does not fit a RINEX field")
    return text
