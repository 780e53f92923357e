"""Validate the numbers in a record; an invalid number raises an error with a message of one line."""

from __future__ import annotations

import math

from vestige.errors import VestigeError


def require_finite(owner: str, **values: float) -> None:
    """Check that all values are finite; each keyword is the name of a field for the message.

    Raises
    ------
    VestigeError
        If any value is NaN or infinite.
    """
    for name, value in values.items():
        if not math.isfinite(value):
            raise _not_finite(owner, name, value)


def require_finite_if_known(owner: str, **values: float) -> None:
    """Check that no value is infinite; NaN means "not measured". Raises `VestigeError` if a value is infinite."""
    for name, value in values.items():
        if math.isinf(value):
            raise _not_finite(owner, name, value)


def _not_finite(owner: str, name: str, value: float) -> VestigeError:
    return VestigeError(f"{owner}: {name}: found {value}, expected a finite number")


def require_time_uncertainty(seconds: float) -> None:
    """Check that an upper limit of a clock error in s is 0 or more; an unknown limit is infinite.

    Raises
    ------
    VestigeError
        If the limit is negative or NaN.
    """
    if not seconds >= 0:
        raise VestigeError(
            f"time uncertainty: found {seconds} s, expected 0 s or more, or infinity if the limit is not known"
        )
