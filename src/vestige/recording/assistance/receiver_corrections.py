"""Read and write the user's corrections for front-end delay and ionosphere, two files in the assistance folder.

`receiver.toml` contains the calibrated delay of the E6 front end minus the delay of the E1 front end, in m or in s::

    hardware_bias_e1_e6_m = -20.6         # or hardware_bias_e1_e6_s = -6.87e-8; E6 minus E1

`ionosphere.csv` contains the predicted slant ionospheric delay on E1 in m, for example from NeQuick-G or a map::

    svid,slant_delay_e1_m
    11,3.2
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.file_toml import read_toml_file
from vestige.errors import InputFileError
from vestige.output import replacement
from vestige.recording.observations.observation_epoch import NUMBER, checked_svid
from vestige.recording.text_lines import numbered_lines

RECEIVER_NAME, IONOSPHERE_NAME = "receiver.toml", "ionosphere.csv"
CORRECTIONS_HEADER = "svid,slant_delay_e1_m"
# largest accepted bias in s, because a larger value is probably in a wrong unit; the largest published bias is 5.4 µs
MAX_BIAS_S = 1e-3
MAX_DELAY_M = 1000.0  # upper limit of the ionospheric delay on E1

_UNIT_S = {"hardware_bias_e1_e6_s": 1.0, "hardware_bias_e1_e6_m": 1 / SPEED_OF_LIGHT_MPS}


def read_hardware_bias(path: Path) -> float:
    """Return the hardware bias in `receiver.toml`: delay of the E6 front end minus delay of the E1 front end, in s.

    The function raises `InputFileError` if the file is not TOML, does not have exactly one key, or this key is not one
    of the two keys with a number of at most ± 1 ms.
    """
    table = read_toml_file(path, at_most=1 << 20)
    if len(table) != 1 or not table.keys() <= _UNIT_S.keys():
        raise InputFileError(path, "keys", ", ".join(table) or "none", f"one of {' and '.join(_UNIT_S)}")
    ((key, value),) = table.items()
    number = value * _UNIT_S[key] if type(value) in (int, float) and abs(value) < 1e9 else None  # a boolean is rejected
    if number is None or not abs(number) <= MAX_BIAS_S:
        raise InputFileError(path, key, value, f"a number, at most ± {MAX_BIAS_S / _UNIT_S[key]:g}")
    return number


def read_ionosphere(path: Path) -> Mapping[int, float]:
    """Return the predicted slant ionospheric delays on E1 in `ionosphere.csv`, in m by SVID.

    The function raises `InputFileError` if the header is not `svid,slant_delay_e1_m`, a satellite is named twice, or a
    line is not an SVID and a delay of 0 to 1000 m.
    """
    delays: dict[int, float] = {}
    lines = numbered_lines(path)
    _, header = next(lines, (1, ""))
    if header.strip() != CORRECTIONS_HEADER:
        raise InputFileError(path, "line 1", header, CORRECTIONS_HEADER)
    for number, line in lines:
        if not line.strip():
            continue
        values = [value.strip() for value in line.split(",")]
        if len(values) != 2:
            raise InputFileError(path, f"line {number}", f"{len(values)} values", "2 values")
        svid = checked_svid(path, number, values[0])
        if svid in delays:
            raise InputFileError(path, f"line {number}: svid", svid, "each satellite once")
        if not NUMBER.fullmatch(values[1]) or not 0 <= float(values[1]) <= MAX_DELAY_M:
            raise InputFileError(
                path, f"line {number}: slant_delay_e1_m", values[1], f"a number from 0 to {MAX_DELAY_M:g}"
            )
        delays[svid] = float(values[1])
    return delays


def write_hardware_bias(folder: Path, bias_s: float) -> Path:
    """Write the hardware bias (E6 front end minus E1 front end) in s to `receiver.toml`, and return its path."""
    path = folder / RECEIVER_NAME
    with replacement(path) as part:
        part.write_text(f"hardware_bias_e1_e6_s = {float(bias_s)!r}\n", encoding="ascii", newline="\n")
    return path


def write_ionosphere(folder: Path, delays_m: Mapping[int, float]) -> Path:
    """Write `ionosphere.csv` with predicted slant delays on E1 in m by SVID, and return its path."""
    path = folder / IONOSPHERE_NAME
    rows = [f"{svid},{float(delays_m[svid])!r}" for svid in sorted(delays_m)]
    path.write_text("\n".join([CORRECTIONS_HEADER, *rows]) + "\n", encoding="ascii", newline="\n")
    return path
