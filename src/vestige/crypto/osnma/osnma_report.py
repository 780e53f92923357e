"""Define the report on a series of OSNMA pages: verified items, unverified items, and reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.osnma.messages.subframe import Content, PageStatus
from vestige.errors import AuthenticationError
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey


class ProblemKind(Enum):
    """Kind of a problem, which says what part of OSNMA the problem concerns."""

    ROOT_KEY = "root key"  # a DSM-KROOT that does not verify
    KEY = "key"  # a key that does not lead to a verified root key
    MACSEQ = "MACSEQ"
    TAG = "tag"
    STATUS = "status"  # a signed status or an unsigned header says that OSNMA must not be used
    DISAGREEMENT = "disagreement"  # satellites send different keys for one subframe
    PAGE = "page"
    TIME = "time"  # the time in a navigation word differs from the time of the recording
    IGNORED = "ignored"  # content that is not used, such as a message that vestige does not support or cannot verify


FAILING = (ProblemKind.ROOT_KEY, ProblemKind.KEY)  # the root key or the chain does not verify


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A problem with received OSNMA."""

    kind: ProblemKind
    time: GalileoTime
    text: str

    def __str__(self) -> str:
        return f"{self.time.week}:{self.time.second} {self.kind.value}: {self.text}"


class ProblemLog:
    """Log of problems in the order of their detection."""

    def __init__(self) -> None:
        self._problems: list[Problem] = []
        self._once: set[tuple[ProblemKind, str]] = set()

    def report(self, kind: ProblemKind, time: GalileoTime, text: str) -> None:
        """Add a problem to the log."""
        self._problems.append(Problem(kind=kind, time=time, text=text))

    def report_once(self, kind: ProblemKind, time: GalileoTime, text: str, details: str = "") -> None:
        """Add a problem, unless `report_once` was called before with the same kind and text."""
        if (kind, text) not in self._once:
            self._once.add((kind, text))
            self.report(kind, time, text + details)

    def problems(self) -> tuple[Problem, ...]:
        """Return all problems of the log in the order of their detection."""
        return tuple(self._problems)

    def forget(self, before: GalileoTime) -> None:
        """Drop the problems from before a time; `report_once` does not report a dropped problem again."""
        self._problems = [one for one in self._problems if one.time >= before]


@dataclass(frozen=True, slots=True, kw_only=True)
class RootCheck:
    """A DSM-KROOT and the result of its verification."""

    dsm_id: int
    header: NmaHeader
    kroot: DsmKroot | None  # fields of the DSM-KROOT; None if a field is invalid or not supported
    received_at: GalileoTime  # subframe that completed the DSM-KROOT
    root: RootKey | None  # root key if it verifies and its public key is not revoked, otherwise None
    on_known_chain: bool = False  # whether the root key belongs to the chain of an earlier root key
    reason: str = ""  # reason why the verification failed; "" after a success


@dataclass(frozen=True, slots=True, kw_only=True)
class WithheldKey:
    """A key that leads to a verified root key but must not be used, with the reason."""

    time: GalileoTime
    chain_id: int
    data: bytes
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyGap:
    """A gap of `n_missing` subframes between the keys of `after` and `before`."""

    after: GalileoTime
    before: GalileoTime
    n_missing: int


@dataclass(frozen=True, slots=True)
class Count:
    """Numbers of items that verify and of items that do not verify."""

    ok: int = 0
    failed: int = 0

    @property
    def checked(self) -> int:
        """Number of checked items."""
        return self.ok + self.failed

    def __str__(self) -> str:
        return f"{self.ok} of {self.checked}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TagCounts:
    """Counts of the MACSEQ fields and the tags."""

    macseq: Count = field(default_factory=Count)
    # numbers of checked tags by kind of data; a dummy tag counts only if the MAC look-up table does not allow the tag
    by_adkd: Mapping[int, Count] = field(default_factory=dict)
    dummy: int = 0  # number of dummy tags (cut-off point 0) whose navigation data was received
    # number of unchecked tags whose navigation data was not received, or may have changed during a gap
    no_data: int = 0
    no_key: int = 0  # number of unchecked tags whose key was not received
    unsupported: int = 0  # number of unchecked tags with an unknown kind of data
    # number of tags in `by_adkd` that verify only with the old data after a change without a new IODnav
    data_before: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class AuthenticatedData:
    """Navigation data of one satellite, verified by tags."""

    svid: int
    adkd: int  # kind of data: 0 for ephemeris, clock and status; 4 for timing parameters
    iod_nav: int | None  # issue of data; None for timing parameters
    first: GalileoTime  # first subframe with a verified tag for the data
    last: GalileoTime  # last subframe with a verified tag for the data
    n_tags: int  # number of tags that verified the data
    tag_bits: int  # total length of the tags that verified the data, in bits
    authenticated: bool  # whether `tag_bits` is at least `MIN_TAG_BITS`


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaReport:
    """Result of the verification of OSNMA in a series of pages."""

    first: GalileoTime | None  # start of the first used page; None without pages
    last: GalileoTime | None  # start of the last used page
    n_pages: int  # number of given pages
    n_crc_failures: int  # number of pages with a wrong checksum
    n_alert_pages: int  # number of alert pages, which have no navigation word and no OSNMA
    pages: Mapping[PageStatus, int]  # number of pages with a correct checksum by status, without alert pages
    n_missing_pages: int  # number of lost pages in subframes with at least one received page
    subframes: Mapping[Content, int]  # number of subframes of satellites by content
    satellites: tuple[int, ...]  # satellites with at least one page
    osnma_satellites: tuple[int, ...]  # satellites that send OSNMA
    time_stamps: Count  # numbers of navigation words with a time; a word verifies if the recording has the same time
    roots: tuple[RootCheck, ...]
    keys: tuple[ValidatedKey, ...]  # validated keys in time order
    withheld: tuple[WithheldKey, ...]  # valid keys that must not be used because of a signed or unsigned status
    alerts: tuple[GalileoTime, ...]  # first subframe in which an alert message was verified; empty without an alert
    chain_steps: Count  # numbers of keys after the first key; a key verifies if it leads to a validated key
    tags: TagCounts
    navigation: tuple[AuthenticatedData, ...]  # navigation data that tags verified
    gaps: tuple[KeyGap, ...]
    problems: tuple[Problem, ...]  # all problems in the order of their detection
    n_without_root: int  # number of subframes of single satellites whose chain has no verified root key
    dsm_progress: str  # text with the number of received blocks of each DSM-KROOT

    @property
    def broadcast_keys(self) -> tuple[PublicKey, ...]:
        """Public keys from DSM-PKRs that lead to the root of the Merkle tree and that verified root keys."""
        return tuple(dict.fromkeys(root.public_key for root in self.verified_roots if root.public_key.message))

    @property
    def verified_roots(self) -> tuple[RootKey, ...]:
        """The root keys that verify and whose public key was not revoked at the verification."""
        return tuple(check.root for check in self.roots if check.root is not None)

    @property
    def failures(self) -> tuple[str, ...]:
        """Reasons why a root key or a key does not verify, or why none is verified; empty without such a reason."""
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
        """Check that `failures` is empty.

        The function raises `AuthenticationError` with the first reason of `failures`, and with the number of other
        reasons.
        """
        failures = self.failures
        if failures:
            more = f" (and {len(failures) - 1} more)" if len(failures) > 1 else ""
            raise AuthenticationError(failures[0] + more)
