"""Read the properties of a check that a user wrote, and test the results of the check.

A user's check satisfies the protocol `Check`. Class attributes of the check give the properties that `levels.py` gives
for vestige's own checks:

* `level` is the lowest level with the check (default 1);
* `failure` is the status after a failure (default SUSPECT);
* `of_receiver` says whether the check concerns the whole receiver and not each satellite (default False);
* `confirm` is the number of tests in a row that must fail (default 1);
* `cadence` says when a test is made, for the number of tests in a day (default: every observation).

A user's check has its own `p_fa`, and no share of the level's budget of false alarms.

The result of an epoch may depend on the evidence of this epoch, and on the memory of the check from earlier epochs. A
check with memory has a method `remember`, see `CheckWithMemory`. Stored results contain all of the evidence except the
samples. A check must give the same result for a recording, a simulation and stored results. A user's check may
therefore neither correlate E6 samples nor use the searches. A correlation or a search in a user's check raises
`OwnPartError`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from operator import index
from types import MappingProxyType
from typing import Any, NoReturn, Protocol, runtime_checkable

import numpy as np

from vestige.acas_processor.checks.check import check_budget
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.levels import LEVELS, CheckSpec, DetectionAssumptions, Scope, TestCadence
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.own_parts import OwnPartError, blamed_on_own_parts, kind_of, made, part, require_members
from vestige.records import Status
from vestige.records.checks import CheckName, CheckSeries

_MOST_CONFIRM = 1000
_OWN_STEP = 8  # number after the last step of [WFO, Sec. IV]


@runtime_checkable
class OwnCheckProtocol(Protocol):
    """Protocol of a user's own check: the attributes and the method that the check must have; see `Check`."""

    name: str
    unit: str
    p_fa: float

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return statistic and threshold of the check for every epoch of a block."""


@dataclass(frozen=True, slots=True)
class OwnProbability:
    """Fixed false-alarm probability of a user's check, independent of the assumptions for other checks."""

    p_fa: float

    def __call__(self, assumed: DetectionAssumptions) -> float:  # noqa: ARG002
        """Return the false-alarm probability of one test."""
        return self.p_fa


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnCheck:
    """Check that a user wrote, with the row of this check in the table of levels."""

    kind: str  # name of the check in a scenario, `module:Name`
    check: Any
    level: int  # lowest mitigation level with the check
    spec: CheckSpec  # row of the check in the table of levels

    @classmethod
    def named(cls, kind: str) -> OwnCheck:
        """Return the check that `module:Name` names.

        `OwnPartError` is raised if the class cannot be imported or made, or if an attribute of the check is missing or
        wrong.
        """
        return cls.of(made(kind, part(kind, object)))

    @classmethod
    def of(cls, check: Any) -> OwnCheck:
        """Make an own check from a user's object, whose attributes give the properties of the check.

        `OwnPartError` is raised if an attribute is missing or wrong.
        """
        kind = kind_of(type(check))
        require_members(kind, check, OwnCheckProtocol)

        def attribute(name: str, default: Any, good: Any, expected: str) -> Any:
            with blamed_on_own_parts():
                value = getattr(check, name, default)
            if not good(value):
                raise OwnPartError(kind, f"{name} = {value!r}", expected)
            return value

        names = {one.value for one in CheckName}
        spec = CheckSpec(
            step=_OWN_STEP,
            name=attribute(
                "name", None, lambda one: type(one) is str and one.isprintable() and one and one not in names,
                "a text that is not the name of one of vestige's checks",
            ),
            failure=attribute(
                "failure", Status.SUSPECT, lambda one: one in (Status.SUSPECT, Status.SPOOFED, Status.NOT_DETECTED),
                "Status.SUSPECT, Status.SPOOFED or Status.NOT_DETECTED",
            ),
            scope=Scope.RECEIVER
            if attribute("of_receiver", False, lambda one: isinstance(one, bool), "True or False")
            else Scope.SATELLITE,
            cadence=attribute(
                "cadence", TestCadence.OBSERVATION, lambda one: isinstance(one, TestCadence), "a TestCadence"
            ),
            confirm=attribute(
                "confirm", 1, lambda one: type(one) is int and 1 <= one <= _MOST_CONFIRM, f"1 to {_MOST_CONFIRM}"
            ),
        )  # fmt: skip
        attribute("unit", None, lambda one: isinstance(one, str), "a text")
        attribute("remember", None, lambda one: one is None or callable(one), "a method")
        p_fa = attribute("p_fa", None, lambda one: isinstance(one, float), "a number between 0 and 1")
        try:
            check_budget(p_fa)
        except ValueError as error:
            raise OwnPartError(kind, f"p_fa = {p_fa}", "a number between 0 and 1") from error
        spec = replace(spec, own_p_fa=OwnProbability(p_fa), needs_references=True)
        level = attribute("level", min(LEVELS), lambda one: type(one) is int and one in LEVELS, "1, 2 or 3")
        return cls(kind=kind, check=check, level=level, spec=spec)

    @property
    def name(self) -> str:
        """Name of the check."""
        return self.spec.name

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return str(self.check.unit)

    @property
    def p_fa(self) -> float:
        """False-alarm probability of one test."""
        return float(self.check.p_fa)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return statistic and threshold of the check for every epoch of a block.

        `OwnPartError` is raised if the check raises an exception that is no `VestigeError`, or returns anything other
        than a `CheckSeries` with the name of the check. The error is also raised if statistic or threshold is not a
        float64 array of the right shape. The shape is [n] for a check of the receiver, and [n, m] otherwise, for n
        epochs and m satellites.
        """
        with blamed_on_own_parts():
            found = self.check.series(_offered(evidence, self.kind))
        if not isinstance(found, CheckSeries):
            raise OwnPartError(self.kind, f"a {type(found).__name__} from series", "a CheckSeries")
        if found.name != self.spec.name:
            raise OwnPartError(self.kind, f"a series with the name {found.name!r}", repr(self.spec.name))
        shape = evidence.shape[:1] if self.spec.scope is Scope.RECEIVER else evidence.shape
        for name in ("statistic", "threshold"):
            values = getattr(found, name)
            if not isinstance(values, np.ndarray) or values.shape != shape or values.dtype != np.float64:
                what = f"{values.dtype} of shape {values.shape}" if isinstance(values, np.ndarray) else repr(values)
                raise OwnPartError(self.kind, f"{name} of {what} from series", f"float64 of shape {shape}")
        return found

    def remember(self, evidence: Evidence) -> CheckMemory:
        """Return the memory of the check after a block; empty for a check without the method `remember`.

        `OwnPartError` is raised if the check raises an exception that is no `VestigeError`, or returns anything other
        than numbers by SVID.
        """
        with blamed_on_own_parts():
            remember = getattr(self.check, "remember", None)
            found = {} if remember is None else remember(_offered(evidence, self.kind))
        expected = "numbers by satellite: a mapping from SVIDs, 0 for the receiver, to sequences of numbers"
        if not isinstance(found, Mapping):
            raise OwnPartError(self.kind, f"a {type(found).__name__} from remember", expected)
        try:
            return {index(svid): tuple(float(value) for value in values) for svid, values in found.items()}
        except (TypeError, ValueError) as error:
            raise OwnPartError(self.kind, f"{error} in the result of remember", expected) from error


def _offered(evidence: Evidence, kind: str) -> Evidence:
    """Return the evidence for a user's check, without fields that need samples or a simulation."""
    snapshots = evidence.measured.snapshots
    offered = replace(
        snapshots,
        front_end=MappingProxyType(snapshots.front_end),
        e6=_NotOffered(kind, "e6"),
        searches=_NotOffered(kind, "searches"),
    )
    measured = replace(evidence.measured, snapshots=offered)
    return replace(evidence, measured=measured, memory=MappingProxyType(evidence.memory))


class _NotOffered:
    """Placeholder for E6 or the searches in the evidence of a user's check; every use raises an error."""

    __slots__ = ("_kind", "_what")

    def __init__(self, kind: str, what: str) -> None:
        self._kind, self._what = kind, what

    def __getattr__(self, name: str) -> Any:
        self._refuse(name)

    def correlate(self, *_: Any) -> NoReturn:
        """Raise `OwnPartError`, because a user's check may not correlate E6 samples."""
        self._refuse("correlate")

    def e1(self, *_: Any) -> NoReturn:
        """Raise `OwnPartError`, because a user's check may not use the E1 vestigial search."""
        self._refuse("e1")

    def exhaustive(self, *_: Any) -> NoReturn:
        """Raise `OwnPartError`, because a user's check may not use the E6 exhaustive search."""
        self._refuse("exhaustive")

    def _refuse(self, name: str) -> NoReturn:
        raise OwnPartError(
            self._kind,
            f"evidence.measured.snapshots.{self._what}.{name}",
            "the other fields of the evidence: stored results have no samples, so no check may use them",
        )
