"""Get validated TESLA keys and verified tags from I/NAV pages, as an OSNMA receiver does.

Pages are collected into subframes (`page_intake`), and subframes into DSM-KROOTs. A public key verifies the signature
of a DSM-KROOT (`dsm_verifier`). A verified DSM-KROOT gives a chain (`tesla`), along which the keys are validated. Keys
verify the tags and MACSEQ fields that were sent before them (`tag_verifier`). Only the DSM-KROOT gives the layout of
the MACK message, so subframes wait until a root key of their chain is verified.

The receiver takes pages as they come, and returns keys as soon as they are valid. Several satellites send the same key
at the same time. A satellite with a different key is reported. The different key is accepted only if it belongs to the
chain. At most one key of a subframe can belong to the chain.

Only verified root keys and alert messages decide which chain may be used (`chain_register`). The NMA header of a
subframe is not authenticated, so it can only add restrictions. If a satellite's header says "don't use", the key of the
subframe is withheld. If the tags prove that the header is forged, the key is used (`status_claim`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

from vestige.constants import SUBFRAME_S
from vestige.crypto.keys.merkle_tree import MerkleTree
from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.osnma.chain_register import ChainRegister, RevokedKeyError
from vestige.crypto.osnma.dsm_verifier import DsmVerifier
from vestige.crypto.osnma.messages.dsm import DONT_USE, NmaHeader
from vestige.crypto.osnma.messages.navigation_data import NavigationWords
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.osnma.messages.subframe import Content, Epoch, SatelliteSubframe
from vestige.crypto.osnma.messages.tags import parse_mack
from vestige.crypto.osnma.messages.tesla import Chain, Key, fill_gaps, validate
from vestige.crypto.osnma.osnma_report import (
    AuthenticatedData,
    Count,
    KeyGap,
    OsnmaReport,
    ProblemKind,
    ProblemLog,
    WithheldKey,
)
from vestige.crypto.osnma.page_intake import PageIntake
from vestige.crypto.osnma.status_claim import proven_status
from vestige.crypto.osnma.tag_verifier import TagVerifier
from vestige.errors import AuthenticationError, satellite_names
from vestige.navigation.inav.page import InavPage
from vestige.records import ReceivedOsnma
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey


@dataclass(frozen=True, slots=True)
class _Message:
    """OSNMA of all satellites in one subframe, and the navigation words that were received before the subframe.

    Subframes with lost pages are included, because their key may be complete. `refusing` contains the subframes with
    the header "don't use".
    """

    time: GalileoTime
    chain_id: int  # chain that most headers name
    refusing: tuple[SatelliteSubframe, ...]
    satellites: tuple[SatelliteSubframe, ...]
    navigation: Mapping[int, NavigationWords]


@dataclass(frozen=True, slots=True)
class _Claim:
    """A key that is withheld because of unsigned headers."""

    message: _Message
    subframes: Sequence[SatelliteSubframe]
    chain: Chain
    key: ValidatedKey


class OsnmaReceiver:
    """Receiver that verifies OSNMA page by page.

    A broadcast public key is used if it leads to the root of `tree` and is newer than the known public keys. Without
    `tree`, broadcast public keys are only reported.

    Attributes
    ----------
    n_subframes
        Number of subframes processed so far. Pages give new results only when this number grows.
    """

    def __init__(self, public_keys: Sequence[PublicKey], tree: MerkleTree | None = None) -> None:
        self._problems = ProblemLog()
        self._intake = PageIntake(self._problems)
        self._tags = TagVerifier(self._problems)
        self._register = ChainRegister()
        self._dsms = DsmVerifier(public_keys, tree, self._register, self._problems)
        self._keys: dict[int, ValidatedKey] = {}
        self._withheld: dict[int, WithheldKey] = {}
        self._received: dict[tuple[int, int], ReceivedOsnma] = {}
        self._steps = [0, 0]
        self.n_subframes = 0
        self._waiting: list[_Message] = []
        self._claims: list[_Claim] = []
        self._navigation: dict[int, NavigationWords] = {}

    @property
    def chains(self) -> tuple[Chain, ...]:
        """The chains with a verified root key."""
        return tuple(self._register.chains)

    def process(self, page: InavPage) -> tuple[ValidatedKey, ...]:
        """Process a page, and return the keys that become valid because the page closes earlier subframes.

        Pages may come in any order of satellites, and some seconds late.
        """
        return self._take(self._intake.add(page))

    def learn(self, roots: Iterable[RootKey]) -> tuple[ValidatedKey, ...]:
        """Add root keys from another source, and return the keys that become valid.

        With these root keys, keys are valid before the DSM-KROOT of their chain is received. Only a DSM-KROOT or an
        alert message that is received later can show whether the chain was withdrawn after the reception of these root
        keys.
        """
        n_chains, n_changes = len(self._register.chains), self._register.n_changes
        for root in sorted(roots, key=lambda root: root.received_at):
            with suppress(RevokedKeyError):
                self._register.add(root)
        return tuple(self._follow_up([], n_chains, n_changes))

    def finish(self) -> tuple[ValidatedKey, ...]:
        """Close the subframes that are still open after the last page, and return the keys that become valid."""
        return self._take(self._intake.flush())

    def process_all(self, pages: Iterable[InavPage]) -> OsnmaReport:
        """Process a finite series of pages, and return the report."""
        for page in pages:
            self.process(page)
        self.finish()
        return self.report()

    def filled_keys(self) -> tuple[ValidatedKey, ...]:
        """Return the validated keys, and the keys of lost subframes between them, which follow from later keys.

        Withheld keys and keys of times without a usable chain are not returned, although they follow from later keys,
        too.
        """
        filled = dict(self._keys)
        for chain in self._register.chains:
            for key in fill_gaps(tuple(self._keys.values()), chain):
                time = key.time.gst_seconds
                if time not in self._withheld and not self._register.refusal(chain, key.time):
                    filled.setdefault(time, key)
        return tuple(filled[time] for time in sorted(filled))

    def navigation(self) -> tuple[AuthenticatedData, ...]:
        """Return the navigation data that tags verified, by satellite and time."""
        return self._tags.navigation()

    def forget(self, before: GalileoTime) -> None:
        """Drop data that was received before a time, so that the memory use of a long run is limited.

        Root keys, public keys and alert messages are kept. `filled_keys` and `report` no longer return keys of
        subframes earlier than `before`. Subframes earlier than `before` that still wait for a root key are dropped.
        """
        limit = before.gst_seconds
        self._keys = {time: key for time, key in self._keys.items() if time >= limit}
        self._withheld = {time: key for time, key in self._withheld.items() if time >= limit}
        self._received = {place: one for place, one in self._received.items() if place[0] >= limit}
        self._waiting = [one for one in self._waiting if one.time >= before]
        self._claims = [one for one in self._claims if one.message.time >= before]
        self._tags.forget(before)
        self._problems.forget(before)

    def received(self) -> tuple[ReceivedOsnma, ...]:
        """Return the demodulated OSNMA in the order of time, including invalid keys."""
        return tuple(self._received[place] for place in sorted(self._received))

    def report(self) -> OsnmaReport:
        """Return the report on all pages so far; after the last page, call `finish` before `report`."""
        keys = tuple(self._keys[time] for time in sorted(self._keys))
        intake = self._intake
        return OsnmaReport(
            first=intake.first,
            last=intake.last,
            n_pages=intake.counts["pages"],
            n_crc_failures=intake.counts["crc"],
            n_alert_pages=intake.counts["alert"],
            pages=dict(intake.statuses),
            n_missing_pages=intake.counts["missing"],
            subframes=dict(intake.contents),
            satellites=tuple(sorted(intake.satellites)),
            osnma_satellites=tuple(sorted(intake.osnma_satellites)),
            time_stamps=Count(*intake.stamps),
            roots=tuple(self._dsms.roots),
            keys=keys,
            withheld=tuple(self._withheld[time] for time in sorted(self._withheld)),
            alerts=tuple(self._dsms.alerts),
            chain_steps=Count(*self._steps),
            tags=self._tags.counts(),
            navigation=self._tags.navigation(),
            gaps=_gaps(keys),
            problems=self._problems.problems(),
            n_without_root=sum(len(message.satellites) for message in self._waiting),
            dsm_progress=self._dsms.progress(),
        )

    def _take(self, epochs: Iterable[Epoch]) -> tuple[ValidatedKey, ...]:
        keys: list[ValidatedKey] = []
        for epoch in epochs:
            self.n_subframes += 1
            message = self._read(epoch)
            messages = [message] if message is not None else []
            n_chains, n_changes = len(self._register.chains), self._register.n_changes
            self._dsms.take(epoch)
            keys += self._follow_up(messages, n_chains, n_changes)
        return tuple(keys)

    def _follow_up(self, messages: list[_Message], n_chains: int, n_changes: int) -> list[ValidatedKey]:
        """Process messages after root keys may have added chains or withdrawals, and return the keys that are valid."""
        keys: list[ValidatedKey] = []
        if self._register.n_changes > n_changes:
            self._withdraw()
        if len(self._register.chains) > n_chains:
            messages, self._waiting = self._waiting + messages, []
        for waiting in messages:
            keys += self._use(waiting)
            keys += self._release()
        return keys

    def _read(self, epoch: Epoch) -> _Message | None:
        """Store the navigation words of a subframe, and return its OSNMA; None if no satellite has an NMA header."""
        before = dict(self._navigation)
        usable = []
        refusing = []
        chain_ids: Counter[int] = Counter()
        for svid, subframe in epoch.satellites.items():
            self._navigation[svid] = self._navigation.get(svid, NavigationWords()).updated(subframe)
            if subframe.sends_osnma:
                usable.append(subframe)
                place = epoch.time.gst_seconds, svid
                self._received[place] = ReceivedOsnma(svid=svid, time=epoch.time, fields=subframe.sent)
            if subframe.nma_header is not None:
                header = NmaHeader(subframe.nma_header)
                chain_ids[header.chain_id] += 1
                # A single satellite with "don't use" is enough, because a forger with a compromised chain would not
                # send "don't use".
                if header.status == DONT_USE:
                    refusing.append(subframe)
        if not chain_ids:  # no header was received, so it is unknown whether the key may be used
            return None
        return _Message(epoch.time, chain_ids.most_common(1)[0][0], tuple(refusing), tuple(usable), before)

    def _use(self, message: _Message) -> list[ValidatedKey]:
        """Return the usable keys of a subframe, and process the tags; keep subframes of unknown chains for later."""
        by_chain: dict[int, list[SatelliteSubframe]] = {}
        for subframe in message.satellites:
            by_chain.setdefault(self._chain_id(subframe, message.chain_id), []).append(subframe)
        keys = []
        waiting: list[SatelliteSubframe] = []
        for chain_id, subframes in by_chain.items():
            chains = [chain for chain in reversed(self._register.chains) if chain.chain_id == chain_id]
            if not chains:
                waiting += subframes
                continue
            chain, valid = self._validate(message, subframes, chains)
            refusal = self._register.refusal(chain, message.time)
            if not refusal and not message.refusing:
                keys += self._accept(message, subframes, chain, valid)
            elif valid is not None:
                if not refusal and message.time.gst_seconds not in self._withheld:
                    self._claims.append(_Claim(message, subframes, chain, valid))
                self._withhold(valid, refusal or _claim_text(message.refusing))
        if waiting:
            self._waiting.append(replace(message, satellites=tuple(waiting)))
        return keys

    def _chain_id(self, subframe: SatelliteSubframe, named: int) -> int:
        """Return the number of the chain of a subframe's key.

        The header may be forged, so the chain in the header is only the first candidate.
        """
        if subframe.nma_header is not None:
            named = NmaHeader(subframe.nma_header).chain_id
        for chain in sorted(self._register.chains, key=lambda chain: chain.chain_id != named):
            key = _key_in(subframe, chain)
            if key is not None and chain.accepts(key):
                return chain.chain_id
        return named

    def _accept(
        self,
        message: _Message,
        subframes: Sequence[SatelliteSubframe],
        chain: Chain,
        valid: ValidatedKey | None,
        proven: Mapping[int, int | None] | None = None,
    ) -> list[ValidatedKey]:
        """Process the tags and the key of a subframe; `proven` has the status that tags prove for forged headers."""
        for subframe in subframes:
            mack = parse_mack(subframe, chain.parameters)
            if mack is not None and subframe.content is Content.OSNMA:
                status = (proven or {}).get(subframe.svid) or mack.nma_status
                self._tags.add(replace(mack, nma_status=status), chain, message.navigation)
        time = message.time.gst_seconds
        if valid is None or time in self._keys or time in self._withheld:
            return []
        self._keys[time] = valid
        self._tags.key_arrived(chain, valid.time)
        return [valid]

    def _withhold(self, key: ValidatedKey, reason: str) -> None:
        time = key.time.gst_seconds
        self._withheld.setdefault(time, WithheldKey(time=key.time, chain_id=key.chain_id, data=key.data, reason=reason))
        self._keys.pop(time, None)  # stored key, if the withdrawal came later or a recording is read twice
        self._problems.report_once(ProblemKind.STATUS, key.time, f"{reason}: keys are withheld")

    def _withdraw(self) -> None:
        """Withhold the keys that a new withdrawal refuses, and stop waiting for proofs of forged headers."""
        self._claims.clear()
        for key in tuple(self._keys.values()):
            refusal = self._register.refusal_of(key)
            if refusal:
                self._withhold(key, refusal)

    def _release(self) -> list[ValidatedKey]:
        """Return the withheld keys for which tags have now proven that the headers are forged."""
        keys = []
        for claim in tuple(self._claims):
            message = claim.message
            proven = {one.svid: proven_status(one, message.navigation, claim.chain) for one in message.refusing}
            if None in proven.values():
                continue
            self._claims.remove(claim)
            if all(proven.values()) and not self._register.refusal(claim.chain, message.time):
                del self._withheld[message.time.gst_seconds]
                forged = "the tags prove that this header is forged, so the key is used, 30 s late"
                text = f"{_claim_text(message.refusing)}; {forged}"
                self._problems.report(ProblemKind.STATUS, message.time, text)
                keys += self._accept(message, claim.subframes, claim.chain, claim.key, proven)
        return keys

    def _validate(
        self, message: _Message, subframes: Sequence[SatelliteSubframe], chains: Sequence[Chain]
    ) -> tuple[Chain, ValidatedKey | None]:
        """Return the chain of a subframe's key, and the key; the key is None if no received key is valid."""
        candidates: dict[Key, list[int]] = {}
        for subframe in subframes:
            key = _key_in(subframe, chains[0])
            if key is not None:
                candidates.setdefault(key, []).append(subframe.svid)
                place = message.time.gst_seconds, subframe.svid
                self._received[place] = replace(self._received[place], key=key.data)
        if not candidates:
            return chains[0], None
        accepted: tuple[Chain, ValidatedKey | None] = chains[0], None
        for key, svids in candidates.items():
            chain, valid = self._first_valid(key, svids, chains, message.time)
            if valid is not None:
                accepted = chain, valid
        if len(candidates) > 1:
            said = "; ".join(f"{key.data.hex()} from {satellite_names(svids)}" for key, svids in candidates.items())
            self._problems.report(ProblemKind.DISAGREEMENT, message.time, f"different keys: {said}")
        time = message.time.gst_seconds
        if (self._keys or self._withheld) and time not in self._keys and time not in self._withheld:
            self._steps[accepted[1] is None] += 1
        return accepted

    def _first_valid(
        self, key: Key, svids: Sequence[int], chains: Sequence[Chain], time: GalileoTime
    ) -> tuple[Chain, ValidatedKey | None]:
        reason = ""
        for chain in chains:
            try:
                return chain, validate(key, chain)
            except AuthenticationError as error:
                reason = reason or str(error)
        self._problems.report(ProblemKind.KEY, time, f"{satellite_names(svids)}: {reason}")
        return chains[0], None


def _gaps(keys: Sequence[ValidatedKey]) -> tuple[KeyGap, ...]:
    pairs = pairwise(keys)
    steps = ((after.time, before.time, round(before.time - after.time) // SUBFRAME_S) for after, before in pairs)
    return tuple(KeyGap(after=after, before=before, n_missing=n - 1) for after, before, n in steps if n > 1)


def _key_in(subframe: SatelliteSubframe, chain: Chain) -> Key | None:
    """Return the key of a subframe at the position that the chain gives; None if a page of the key is missing."""
    parameters = chain.parameters
    bits = subframe.mack_bits(parameters.key_start_bit, parameters.key_bits)
    return None if bits is None else Key(time=subframe.time, data=bits.to_bytes(parameters.key_bytes, "big"))


def _claim_text(refusing: Sequence[SatelliteSubframe]) -> str:
    headers = {str(NmaHeader(subframe.nma_header)) for subframe in refusing if subframe.nma_header is not None}
    return f"{satellite_names([subframe.svid for subframe in refusing])}: unsigned header {', '.join(sorted(headers))}"
