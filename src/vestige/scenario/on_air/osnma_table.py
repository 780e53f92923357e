"""Define the table `[osnma]` of a scenario: events and keys of the OSNMA operator."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, PrivateAttr, computed_field

from vestige.constants import MAX_SVID, SUBFRAME_S
from vestige.crypto.keys.public_key_file import read_merkle_tree
from vestige.crypto.osnma.operator.events import OsnmaEvent, OsnmaEventKind, overlap
from vestige.crypto.osnma.operator.key_tree import read_private_key
from vestige.crypto.osnma.operator.osnma_service import OperatorKey, OsnmaService
from vestige.errors import AuthenticationError, InputFileError
from vestige.scenario.toml.toml_file import InconsistentSettingsError, Section
from vestige.time import GalileoTime

_STEPS = ("start_s", "in_force_s", "stop_s")
# events that need a key or an alert message that the user's Merkle tree does not contain
_NEW_LEAVES = (OsnmaEventKind.KEY_RENEWAL, OsnmaEventKind.KEY_REVOCATION, OsnmaEventKind.ALERT)

Seconds = Annotated[float, Field(ge=0, le=1e9)]


class OsnmaEventTable(Section):
    """Event of the OSNMA operator; the times of the event are starts of subframes in s after the scenario's start.

    Attributes
    ----------
    kind
        Kind of the event.
    start_s
        Time from which the satellites announce the event.
    in_force_s
        Time from which the new chain or key is in force; None if no new chain or key comes into force.
    stop_s
        Time at which the event ends; None if the event does not end. When an alert ends, OSNMA is silent. When a
        silence ends, the satellites send OSNMA again. When any other event ends, the status is nominal.
    svids
        SVIDs of the satellites without OSNMA, only for the kind `silence`; an empty list means all satellites.
    """

    kind: OsnmaEventKind
    start_s: Seconds
    in_force_s: Seconds | None = None
    stop_s: Seconds | None = None
    svids: tuple[Annotated[int, Field(ge=1, le=MAX_SVID)], ...] = ()

    def event(self, place: str, start: GalileoTime, duration_s: float) -> OsnmaEvent:
        """Return the OSNMA event with its times in GST, for a scenario that starts at `start`.

        The function raises `InconsistentSettingsError` if a TOML key does not fit the kind of event, `in_force_s` is
        missing although `stop_s` needs this time, or the times are not in order. `InconsistentSettingsError` is also
        raised if a time is not the start of a subframe within `duration_s`. The error names the TOML key in the table
        `place`.
        """
        kind = self.kind
        for key, allowed in (("in_force_s", kind.has_step_2), ("stop_s", kind.has_end)):
            if getattr(self, key) is not None and not allowed:
                raise InconsistentSettingsError(
                    f"{place}.{key}", f"a time, with {kind.value}", "none: it has no such step"
                )
        if self.svids and kind is not OsnmaEventKind.SILENCE:
            raise InconsistentSettingsError(
                f"{place}.svids", f"{list(self.svids)} with {kind.value}", "none: only silence has satellites"
            )
        times_s = [(key, getattr(self, key)) for key in _STEPS if getattr(self, key) is not None]
        before, before_s = "", -1.0
        for key, time_s in times_s:
            self._check_time(f"{place}.{key}", time_s, start, duration_s)
            if time_s <= before_s:
                raise InconsistentSettingsError(
                    f"{place}.{key}", f"{time_s:g} s", f"more than {before}, {before_s:g} s"
                )
            before, before_s = key, time_s
        if self.stop_s is not None and self.in_force_s is None and kind.has_step_2:
            raise InconsistentSettingsError(
                f"{place}.in_force_s", "nothing", f"a time before stop_s, {self.stop_s:g} s"
            )
        announced, in_force, ended = (
            None if time_s is None else start + time_s for time_s in (self.start_s, self.in_force_s, self.stop_s)
        )
        assert announced is not None  # noqa: S101  (the key is needed)
        svids = frozenset(self.svids) or None
        return OsnmaEvent(kind=kind, announced=announced, in_force=in_force, ended=ended, svids=svids)

    @staticmethod
    def _check_time(place: str, time_s: float, start: GalileoTime, duration_s: float) -> None:
        if time_s >= duration_s:
            raise InconsistentSettingsError(
                place, f"{time_s:g} s", f"a time before the end of the run, {duration_s:g} s"
            )
        past_s = (start.second + time_s) % SUBFRAME_S
        if past_s:
            near = [f"{one:g}" for one in (time_s - past_s, time_s - past_s + SUBFRAME_S) if 0 <= one < duration_s]
            raise InconsistentSettingsError(
                place,
                f"{time_s:g} s",
                f"the start of a subframe of {SUBFRAME_S} s: {' or '.join(near) or 'a longer run'}",
            )


class OsnmaTable(Section):
    """OSNMA operator of a scenario; by default the keys follow from the seed, and there are no events.

    Attributes
    ----------
    event
        Events of the broadcast, each in a table `[[osnma.event]]`.
    private_key
        PEM file of the signing key, for the curve P-256 and without a password. A relative path starts at the folder of
        the scenario file.
    merkle_tree
        XML file of a Merkle tree that contains the public key of `private_key`. By default the operator makes a tree
        with this public key.
    """

    event: tuple[OsnmaEventTable, ...] = ()
    private_key: Annotated[str, Field(min_length=1)] | None = None
    merkle_tree: Annotated[str, Field(min_length=1)] | None = None

    _key: OperatorKey | None = PrivateAttr(None)

    def model_post_init(self, context: Any) -> None:
        """Read the files of the private key and the Merkle tree; `context` gives the folder of the scenario file."""
        folder = context["folder"] if context else Path()
        if self.private_key is None:
            if self.merkle_tree is not None:
                raise InconsistentSettingsError("private_key", "nothing", "a key of the tree, beside merkle_tree")
            return
        key_path = folder / self.private_key
        private_key = read_private_key(key_path)
        if self.merkle_tree is None:
            self._key = OperatorKey.of(private_key)
            return
        tree_path = folder / self.merkle_tree
        try:
            self._key = OperatorKey.of(private_key, read_merkle_tree(tree_path))
        except AuthenticationError:
            raise InputFileError(
                tree_path, "leaves", f"none of the key {key_path.name}", "the tree of that key, or no merkle_tree"
            ) from None

    @computed_field  # type: ignore[prop-decorator]
    @cached_property
    def key_sha256(self) -> str | None:
        """SHA-256 digest of private key and Merkle tree, for the scenario's identity; None without a private key."""
        return None if self._key is None else hashlib.sha256(repr(self._key).encode()).hexdigest()

    def service(self, start: GalileoTime, duration_s: float) -> OsnmaService:
        """Return events and key of the operator in a scenario that starts at `start` and lasts for `duration_s`.

        The function raises `InconsistentSettingsError` if an event does not fit into the run, or needs a key or an
        alert message that the user's Merkle tree does not contain. The function also raises `InconsistentSettingsError`
        if an event begins before another event ends; events of the kind `silence` may overlap.
        """
        events = tuple(
            table.event(f"osnma.event.{number}", start, duration_s) for number, table in enumerate(self.event)
        )
        self._check_order(events, start)
        for number, event in enumerate(events):
            if event.kind in _NEW_LEAVES and self.merkle_tree is not None:
                raise InconsistentSettingsError(
                    f"osnma.event.{number}.kind",
                    f"{event.kind.value} with your own merkle_tree",
                    "no merkle_tree: with your tree the operator has only one key, and no signed notice of an alert",
                )
        return OsnmaService(events=events, key=self._key)

    @staticmethod
    def _check_order(events: Sequence[OsnmaEvent], start: GalileoTime) -> None:
        pair = overlap(events)
        if pair is None:
            return
        before, after = pair
        number = max(k for k, event in enumerate(events) if event is after)
        over = (
            f"{before.times[-1] - start:g} s or later" if before.complete else "no event after an event without an end"
        )
        raise InconsistentSettingsError(
            f"osnma.event.{number}.start_s",
            f"{after.announced - start:g} s, within the {before.kind.value} of {before.announced - start:g} s",
            over,
        )
