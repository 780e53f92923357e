"""A short night of two satellites with open codes, and how the tests of `process` and `search` call a verb on it."""

from __future__ import annotations

from click.testing import CliRunner, Result

TWO_SATELLITES = """
kind = "recording"
seed = 5
start = "2026-11-21T12:00:16 GST"
duration_s = 0.125
[receiver]
sample_rate_hz = 6.2e6
hardware_bias_e1_e6_m = -18.0
[[satellite]]
svid = 3
range_m = 23_482_000.0
range_rate_mps = -120.0
cn0_e1_dbhz = 45.0
cn0_e6_dbhz = 47.0
[[satellite]]
svid = 8
range_m = 25_105_000.0
range_rate_mps = 310.5
cn0_e1_dbhz = 43.0
cn0_e6_dbhz = 45.0
"""


def invoke(command: object, *arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments], standalone_mode=False)  # type: ignore[arg-type]


def done(command: object, *arguments: object) -> Result:
    """Return what a verb printed; raise what it raised."""
    result = invoke(command, *arguments)
    if result.exception is not None:
        raise result.exception
    return result
