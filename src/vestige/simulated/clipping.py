"""Measure the share of stored numbers that clip, and advise the user how to avoid clipping.

Jamming can exceed the range of a number format: without a gain control, int8 samples clip if I or Q is more than 19 dB
above the σ of its noise. A gain control keeps most samples in range, because the gain decreases when the power rises.
The gain follows the power over 10 ms, so pulses of less than 10 ms can clip.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Num

from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.front_end.quantiser import QUANTISERS
from vestige.recording.samples.sample_format import SampleType
from vestige.records import Band

_CLIPPED_SHARE = 1e-3  # share of clipped numbers above which there is a warning
_FEW_BITS = 3  # largest number of bits for which the outermost levels of a quantiser are always in use


def largest_level(component: SampleType, front_end: FrontEnd) -> int | None:
    """Return the largest positive number that can be stored, to which stronger samples are clipped.

    The result is None for number formats that do not clip. The result is also None for quantisers with so few bits that
    the outermost levels are always in use.

    Examples
    --------
    >>> from vestige.receiver.front_end.front_end import FrontEnd
    >>> from vestige.simulated.clipping import largest_level
    >>> largest_level("int16", FrontEnd(sample_rate_hz=12.5e6))
    32767
    >>> largest_level("int16", FrontEnd(sample_rate_hz=12.5e6, bits=8))
    127
    """
    if front_end.bits is not None:
        return QUANTISERS[front_end.bits].outermost if front_end.bits > _FEW_BITS else None
    return None if component == "float32" else int(np.iinfo(component).max)


def n_clipped(components: Num[np.ndarray, "*shape"], largest: int | None) -> int:
    """Return the number of stored values at or beyond `largest` or its negative.

    Examples
    --------
    >>> import numpy as np
    >>> from vestige.simulated.clipping import n_clipped
    >>> n_clipped(np.array([127, -128, 3, -127], np.int8), 127)
    3
    """
    if largest is None:
        return 0
    return int(np.count_nonzero(components >= largest) + np.count_nonzero(components <= -largest))


def clipping_warning(shares: Mapping[Band, float], front_end: FrontEnd) -> str:
    """Return a line with advice and each band's clipped share above 0.1 %; return "" if no share is above 0.1 %.

    Parameters
    ----------
    shares
        Clipped share of the stored numbers of each band, 0 to 1.
    front_end
        Front end that the samples have passed.

    Examples
    --------
    >>> from vestige.receiver.front_end.front_end import FrontEnd
    >>> from vestige.records import Band
    >>> from vestige.simulated.clipping import clipping_warning
    >>> line = clipping_warning({Band.E1: 0.9, Band.E6: 0.0}, FrontEnd(sample_rate_hz=12.5e6, bits=8, agc=False))
    >>> line.split(", ")[0]
    '90 % of the numbers of E1 clip'
    """
    found = [
        f"{100 * share:.2g} % of the numbers of {band.value}"
        for band, share in shares.items()
        if share > _CLIPPED_SHARE
    ]
    if not found:
        return ""
    if front_end.bits is None:
        advice = (
            "--set receiver.front_end.bits=8 --set 'fidelity=\"samples\"' turns on a gain control, which follows the "
            "power; --format float32 stores samples without clipping"
        )
    elif not front_end.agc:
        advice = "set receiver.front_end.agc = true"
    else:
        advice = "the gain follows the power over 10 ms, so shorter pulses clip, as in a receiver"
    return f"{' and '.join(found)} clip, because the samples are stronger than the number format holds; {advice}"
