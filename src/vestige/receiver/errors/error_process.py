"""Define the protocols of the receiver's error models, and the streams of random numbers that the models use.

A model is an immutable record of parameters. `model.process(streams)` starts a realisation of the model.
`advance(times_s)` continues that realisation to later times, with one value per epoch. The values of every model are
the same to the last bit, however the epochs are divided among calls. So a model asks for one stream per variable and
draws the same number of values for every epoch.

The streams of the clock, of the hardware delay and of the common part of the ionosphere belong to the receiver. All
other streams belong to a satellite, `named_streams(seed, svid)`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from vestige.streams import stream

if TYPE_CHECKING:
    from vestige.receiver.errors.multipath import RayBlock

Streams = Callable[[str], np.random.Generator]


@runtime_checkable
class ErrorProcess(Protocol):
    """One realisation of a model of a single error in m."""

    def advance(self, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the error in m at later times."""
        ...


@runtime_checkable
class SeveralProcess(Protocol):
    """One realisation of a model of several errors."""

    def advance(self, times_s: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], ...]:
        """Return the errors at later times."""
        ...


@runtime_checkable
class RayProcess(Protocol):
    """One realisation of a multipath model."""

    def advance(self, times_s: Float[np.ndarray, " n"]) -> RayBlock:
        """Return the reflections at later times."""
        ...


@runtime_checkable
class ClockModel(Protocol):
    """Model of a receiver clock."""

    def process(self, streams: Streams) -> SeveralProcess:
        """Return a realisation from the receiver's streams.

        `advance` of the realisation returns the clock's bias times c in m, and the rate of this bias in m/s.
        """
        ...


@runtime_checkable
class IonosphereModel(Protocol):
    """Model of the differential ionospheric delay E6 − E1 of a satellite.

    In a scenario with a constellation, vestige multiplies the residual by the ratio of the obliquity to the obliquity
    at 17.5°. A process may have a method `shared(receiver, share)`, as `IonosphereProcess` has. `share` is the share of
    the variance that all satellites have in common.
    """

    def process(self, streams: Streams) -> Any:
        """Return a realisation for one satellite from its streams; the realisation satisfies `ErrorProcess`."""
        ...


@runtime_checkable
class MultipathModel(Protocol):
    """Model of the reflections of a satellite on E6 and E1."""

    @property
    def n_rays(self) -> int:
        """The largest number of reflections in addition to the line of sight; at least 1."""
        ...

    def process(self, streams: Streams) -> RayProcess:
        """Return a realisation for one satellite from its streams."""
        ...


@runtime_checkable
class TrackingModel(Protocol):
    """Model of the noise of E1 observations, with the standard deviations that a receiver knows from its loops."""

    def __hash__(self) -> int:
        """Return a number that is the same for equal models."""
        ...

    @property
    def loop_bandwidth_hz(self) -> float:
        """One-sided noise bandwidth of the code loop in Hz."""
        ...

    def code_sigma_m(self, cn0_dbhz: float) -> float:
        """Return the standard deviation of the pseudorange in m at the C/N0 `cn0_dbhz`."""
        ...

    def doppler_sigma_hz(self, cn0_dbhz: float) -> float:
        """Return the standard deviation of the Doppler in Hz at the C/N0 `cn0_dbhz`."""
        ...

    def phase_variance_rad2(self, cn0_hz: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the variance of the carrier phase in rad² at the C/N0 `cn0_hz`."""
        ...

    def process(self, streams: Streams, *, cn0_dbhz: float) -> SeveralProcess:
        """Return a realisation for one satellite: errors of pseudorange in m, carrier phase in m and Doppler in Hz."""
        ...


@runtime_checkable
class BiasModel(Protocol):
    """Model of the delays between E1 and E6 that remain after calibration."""

    def process(self, streams: Streams, *, receiver: Streams) -> ErrorProcess:
        """Return a realisation for one satellite, from the streams of the satellite and of the receiver."""
        ...


def named_streams(seed: int, *labels: str | int) -> Streams:
    """Return a function that gives the random generator for the name of a variable.

    The generators belong to a satellite if `labels` contain an SVID, and to the receiver if there are no labels.
    """
    return lambda name: stream(seed, name, *labels)


def steps_s(last_s: float | None, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the time in s since the previous epoch, for each epoch; 0 for the first epoch if `last_s` is None.

    The function raises `ValueError` if a time is earlier than the previous time, or than `last_s`.
    """
    steps = np.diff(times_s, prepend=times_s[0] if last_s is None else last_s)
    if not np.all(steps >= 0):
        raise ValueError("the times of a process must go forward")
    return steps
