"""What all error models of the receiver share: named streams of random numbers, and times that only go forward.

A model is a frozen record of parameters. `model.process(streams)` starts one realisation of it, and `advance(times_s)`
continues that realisation to later times, one value an epoch. One law holds for all of them: the values do not depend
on how the epochs are cut into calls, to the last bit. So a model asks for one stream per variable and draws the same
number of values for every epoch.

Streams belong to what they describe: those of the clock and of the front ends to the receiver, all others to one
satellite, `named_streams(seed, svid)`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from vestige.streams import stream

Streams = Callable[[str], np.random.Generator]


def named_streams(seed: int, *labels: str | int) -> Streams:
    """Return the streams of one owner: a function from the name of a variable to its generator.

    Parameters
    ----------
    seed
        Seed of the scenario.
    labels
        Whose streams they are, an SVID for instance; nothing for the receiver's own.
    """
    return lambda name: stream(seed, name, *labels)


def steps_s(last_s: float, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the time since the epoch before, for each epoch in s.

    Parameters
    ----------
    last_s
        Time of the epoch before the first one.
    times_s
        Times of the epochs in s after the scenario's start.

    Raises
    ------
    ValueError
        If time runs backwards.
    """
    steps = np.diff(times_s, prepend=last_s)
    if not np.all(steps >= 0):
        raise ValueError("a process only goes forward in time")
    return steps
