"""Name the likely causes and the options to try if no satellite of a recording was authenticated."""

from __future__ import annotations

_INSPECT = "`vestige inspect RECORDING` tries other values"

NOT_ON_E6 = (
    "no satellite was found on E6, likely causes:",
    "  - E6 is later than the correlators reach: add --calibrate --taps 63",
    "  - E6 is described wrongly (spectral_inversion, sample_rate_hz, format, center_frequency_hz, file): " + _INSPECT,
    "  - the RECS files belong to another service, or are encrypted under another key than the key that they name: get "
    "the RECS and key files again",
    "  - the RECS are encrypted in another AES mode: --cipher-mode ctr",
    "  - E6-C is not encrypted (`inspect` says so), or is jammed, or an attack replaced E6",
)
NOT_ON_E1 = (
    "no satellite of the RECS is seen on E1, likely causes:",
    "  - E1 is described wrongly (sample_rate_hz, format, layout, center_frequency_hz): " + _INSPECT,
    "  - the files of the two bands are swapped: `inspect` says so",
    "  - the start of the recording is wrong, so these satellites were not in view: give --start",
    "  - the antenna or the gain of E1 was wrong: `inspect` then finds no satellite",
)
WEAK_ON_E1 = (
    "no satellite of the RECS is strong enough on E1 for a verdict, likely causes:",
    "  - sample_rate_hz is wrong by some ppm: after tens of ms the code no longer fits; state the rate that the "
    "recorder really had",
    "  - samples were lost, the antenna was obstructed, or E1 is jammed: `vestige inspect RECORDING` says which",
)


def in_one_line(advice: tuple[str, ...]) -> str:
    """Return advice of several lines as one line.

    Examples
    --------
    >>> in_one_line(("no satellite, likely causes:", "  - no antenna", "  - jamming"))
    'no satellite, likely causes: no antenna; or jamming'
    """
    head, *causes = advice
    return " ".join([head, "; or ".join(cause.removeprefix("  - ") for cause in causes)]).strip()
