"""What was verified in a stretch of OSNMA, what was not, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.osnma.messages.subframe import Content, PageStatus
from vestige.errors import AuthenticationError
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey


class ProblemKind(Enum):
    """What a problem is about."""

    ROOT_KEY = "root key"  # a DSM-KROOT that does not verify
    KEY = "key"  # a key that does not chain to a verified root key
    MACSEQ = "MACSEQ"
    TAG = "tag"
    STATUS = "status"  # the system, or a header that nobody signed, says: don't use
    DISAGREEMENT = "disagreement"  # satellites send different keys for one subframe
    PAGE = "page"
    TIME = "time"  # the time in a navigation word is not that of the recording
    IGNORED = "ignored"  # valid, but not used, or not supported


FAILING = (ProblemKind.ROOT_KEY, ProblemKind.KEY)  # the root key or the chain does not verify


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One thing that is not as it should be."""

    kind: ProblemKind
    time: GalileoTime
    text: str

    def __str__(self) -> str:
        return f"{self.time.week}:{self.time.second} {self.kind.value}: {self.text}"


class ProblemLog:
    """Collects problems in the order in which they are found."""

    def __init__(self) -> None:
        self._problems: list[Problem] = []
        self._once: set[tuple[ProblemKind, str]] = set()

    def report(self, problem: Problem) -> None:
        """Take a problem."""
        self._problems.append(problem)

    def report_once(self, kind: ProblemKind, time: GalileoTime, text: str, details: str = "") -> None:
        """Take a problem, unless one with this kind and text (details apart) is there."""
        if (kind, text) not in self._once:
            self._once.add((kind, text))
            self.report(Problem(kind=kind, time=time, text=text + details))

    def problems(self) -> tuple[Problem, ...]:
        """Return all problems."""
        return tuple(self._problems)


@dataclass(frozen=True, slots=True, kw_only=True)
class RootCheck:
    """A DSM-KROOT and what became of it.

    Attributes
    ----------
    dsm_id, header, kroot
        The message; no `kroot` if its fields make no sense or are not supported.
    received_at
        Subframe that completed it.
    root
        The root key if signature and padding verify, else None.
    on_known_chain
        Whether it lies on the chain of an earlier root key.
    reason
        Why it was not verified ("" if it was).
    """

    dsm_id: int
    header: NmaHeader
    kroot: DsmKroot | None
    received_at: GalileoTime
    root: RootKey | None
    on_known_chain: bool = False
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class WithheldKey:
    """A key that chains to the root, but must not be used; `reason` says why."""

    time: GalileoTime
    chain_id: int
    data: bytes
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyGap:
    """A stretch without keys: `n_missing` subframes between the keys of `after` and `before`."""

    after: GalileoTime
    before: GalileoTime
    n_missing: int


@dataclass(frozen=True, slots=True)
class Count:
    """How many of something verify, and how many do not."""

    ok: int = 0
    failed: int = 0

    @property
    def checked(self) -> int:
        """All that were checked."""
        return self.ok + self.failed

    def __str__(self) -> str:
        return f"{self.ok} of {self.checked}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TagCounts:
    """Figures of the MACSEQ fields and the tags.

    Attributes
    ----------
    macseq
        MACSEQ fields.
    by_adkd
        Tags with a cut-off point other than 0, by kind of data.
    dummy
        Tags with cut-off point 0.
    no_data
        Not counted: the navigation data was not received, or may have changed while it was not.
    no_key
        Not counted: the key that comes later was not received.
    unsupported
        Not counted: unknown kind of data.
    data_before
        How many of `by_adkd` verify with the word before one that changed without a new IODnav.
    """

    macseq: Count = field(default_factory=Count)
    by_adkd: Mapping[int, Count] = field(default_factory=dict)
    dummy: int = 0
    no_data: int = 0
    no_key: int = 0
    unsupported: int = 0
    data_before: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class AuthenticatedData:
    """Navigation data of one satellite that tags verified.

    Attributes
    ----------
    adkd
        0 ephemeris, clock and status; 4 timing parameters.
    iod_nav
        Issue of data; None for timing parameters.
    first, last
        First and last subframe with a tag on it.
    n_tags, tag_bits
        Tags that verified, and their bits together.
    authenticated
        Whether these are enough bits.
    """

    svid: int
    adkd: int
    iod_nav: int | None
    first: GalileoTime
    last: GalileoTime
    n_tags: int
    tag_bits: int
    authenticated: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaReport:
    """The result of a stretch of OSNMA.

    Attributes
    ----------
    first, last
        Start of the first and the last page that was used; None without pages.
    n_pages, n_crc_failures, n_alert_pages
        Pages given; those with a wrong checksum; those without word and OSNMA.
    pages
        What became of the others.
    n_missing_pages
        Pages lost out of subframes of which others were received.
    subframes
        Subframes of satellites by what they hold.
    satellites, osnma_satellites
        SVIDs of all satellites, and of those that send OSNMA.
    time_stamps
        Navigation words that tell the time, by whether they agree with the recording.
    roots
        The DSM-KROOTs.
    keys
        Validated keys in time order.
    withheld
        Keys that chain, but come with the status "don't use", signed or not.
    alerts
        Subframes in which an alert message was verified.
    chain_steps
        Keys after the first, by whether they chain to what was validated before.
    tags
        Figures of MACSEQ and tags.
    navigation
        Navigation data that tags verified.
    gaps
        Stretches without keys.
    problems
        Everything that is not as it should be, in the order it was found.
    n_without_root
        Subframes of satellites with OSNMA for whose chain there is no verified root key.
    dsm_progress
        How much of the DSM-KROOTs was received.
    """

    first: GalileoTime | None
    last: GalileoTime | None
    n_pages: int
    n_crc_failures: int
    n_alert_pages: int
    pages: Mapping[PageStatus, int]
    n_missing_pages: int
    subframes: Mapping[Content, int]
    satellites: tuple[int, ...]
    osnma_satellites: tuple[int, ...]
    time_stamps: Count
    roots: tuple[RootCheck, ...]
    keys: tuple[ValidatedKey, ...]
    withheld: tuple[WithheldKey, ...]
    alerts: tuple[GalileoTime, ...]
    chain_steps: Count
    tags: TagCounts
    navigation: tuple[AuthenticatedData, ...]
    gaps: tuple[KeyGap, ...]
    problems: tuple[Problem, ...]
    n_without_root: int
    dsm_progress: str

    @property
    def verified_roots(self) -> tuple[RootKey, ...]:
        """The root keys whose signature verifies."""
        return tuple(check.root for check in self.roots if check.root is not None)

    @property
    def failures(self) -> tuple[str, ...]:
        """Why the root key or the chain does not verify; empty if all is well."""
        failures = [str(problem) for problem in self.problems if problem.kind in FAILING]
        if not self.verified_roots:
            ignored = (problem.text for problem in self.problems if problem.kind is ProblemKind.IGNORED)
            reasons = (*(check.reason for check in self.roots), *ignored)
            why = reasons[0] if reasons else f"no complete DSM-KROOT was received ({self.dsm_progress})"
            failures.append(f"no root key is verified: {why}")
        elif not self.keys:
            failures.append("no key is validated" + ("; all are withheld" if self.withheld else ": none was received"))
        return tuple(failures)

    def raise_if_failed(self) -> None:
        """Check that the root key and the chain verify.

        Raises
        ------
        AuthenticationError
            With the first reason, if they do not.
        """
        failures = self.failures
        if failures:
            more = f" (and {len(failures) - 1} more)" if len(failures) > 1 else ""
            raise AuthenticationError(failures[0] + more)
