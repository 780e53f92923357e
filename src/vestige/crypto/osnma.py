"""The OSNMA receiver: I/NAV pages in, validated TESLA keys and verified tags out.

Pages are collected into subframes (`subframe`), subframes into DSM-KROOTs (`dsm_collector`). The signature of a
DSM-KROOT is verified with a public key (`root_key`), which gives a chain (`tesla`); the key of every subframe is
validated along it; keys verify the tags and MACSEQ fields that were sent before them (`tag_verifier`). As the layout of
the MACK message is known only from the DSM-KROOT, subframes wait until there is one.

It is a fold: give it pages as they come, keys come back as soon as they are valid. Several satellites send the same key
at the same time; a satellite with another one is reported, and its key is accepted only if it chains, which no two do.
With the status "don't use" keys are withheld.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from vestige.constants import SUBFRAME_S
from vestige.crypto.dsm import DONT_USE, NmaHeader, parse_kroot
from vestige.crypto.dsm_collector import DsmCollector, DsmMessage
from vestige.crypto.inav import InavPage, time_in_word
from vestige.crypto.merkle_tree import MerkleTree, verify_broadcast_key
from vestige.crypto.navigation_data import NavigationWords
from vestige.crypto.osnma_report import Count, KeyGap, OsnmaReport, Problem, ProblemKind, RootCheck, WithheldKey
from vestige.crypto.public_key import PublicKey
from vestige.crypto.root_key import verify_root_key
from vestige.crypto.subframe import Content, Epoch, PageStatus, SatelliteSubframe, SubframeAssembler
from vestige.crypto.tag_verifier import TagVerifier
from vestige.crypto.tags import parse_mack
from vestige.crypto.tesla import Chain, Key, fill_gaps, validate
from vestige.errors import AuthenticationError, UnsupportedError, VestigeError
from vestige.records import ReceivedOsnma
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey


@dataclass(frozen=True, slots=True)
class _Message:
    """What the satellites sent in one subframe, and the navigation words that had been received before it.

    Subframes with lost pages are among them: their key may be there. The status is that of the same subframe, so a
    subframe of which nobody's first page was received is not used.
    """

    time: GalileoTime
    status: NmaHeader
    satellites: tuple[SatelliteSubframe, ...]
    navigation: Mapping[int, NavigationWords]


class OsnmaReceiver:
    """Verifies OSNMA, page by page.

    Parameters
    ----------
    public_keys
        Keys that DSM-KROOTs may be signed with.
    tree
        Merkle tree to verify broadcast public keys against; without one they are only reported.
    """

    def __init__(self, public_keys: Sequence[PublicKey], tree: MerkleTree | None = None) -> None:
        self._public_keys = tuple(public_keys)
        self._tree = tree
        self._assembler = SubframeAssembler()
        self._dsms = DsmCollector()
        self._tags = TagVerifier(self._report)
        self._chains: list[Chain] = []
        self._roots: list[RootCheck] = []
        self._keys: dict[int, ValidatedKey] = {}
        self._withheld: dict[int, WithheldKey] = {}
        self._received: dict[tuple[int, int], ReceivedOsnma] = {}
        self._steps = [0, 0]
        self._waiting: list[_Message] = []
        self._navigation: dict[int, NavigationWords] = {}
        self._problems: list[Problem] = []
        self._pages: Counter[PageStatus] = Counter()
        self._counts: Counter[str] = Counter()
        self._contents: Counter[Content] = Counter()
        self._stamps = [0, 0]
        self._satellites: set[int] = set()
        self._osnma_satellites: set[int] = set()
        self._reported_once: set[tuple[ProblemKind, str]] = set()
        self._first: GalileoTime | None = None
        self._last: GalileoTime | None = None

    @property
    def chains(self) -> tuple[Chain, ...]:
        """The chains that hang on a verified root key."""
        return tuple(self._chains)

    def process(self, page: InavPage) -> tuple[ValidatedKey, ...]:
        """Return the keys that this page makes valid: it closes the subframes before it.

        Parameters
        ----------
        page
            The next page. Satellites may come in any order, and pages some seconds late.
        """
        self._counts["pages"] += 1
        if not page.crc_ok:
            self._counts["crc"] += 1
            return ()
        if page.is_alert:
            self._counts["alert"] += 1
            return ()
        status, epochs = self._assembler.add(page)
        self._pages[status] += 1
        if status is PageStatus.CONTRADICTION:
            self._report(Problem(
                kind=ProblemKind.PAGE, time=page.time,
                text=f"E{page.svid:02d}: two different pages of one time; the first one is used"))  # fmt: skip
        elif status is PageStatus.TAKEN:
            self._first = page.time if self._first is None else min(self._first, page.time)
            self._last = page.time if self._last is None else max(self._last, page.time)
            self._check_time(page)
        return self._take(epochs)

    def finish(self) -> tuple[ValidatedKey, ...]:
        """Return the keys of the subframes that are still open: no more pages come."""
        return self._take(self._assembler.flush())

    def filled_keys(self) -> tuple[ValidatedKey, ...]:
        """Return the validated keys with those of lost subframes between them, which follow from later ones.

        A key that was withheld stays away, although it follows too.
        """
        keys = tuple(self._keys.values())
        for chain in self._chains:
            keys = fill_gaps(keys, chain)
        filled = {key.time.gst_seconds: key for key in keys if key.time.gst_seconds not in self._withheld}
        return tuple(filled[time] for time in sorted(filled))

    def received(self) -> tuple[ReceivedOsnma, ...]:
        """Return what was demodulated, in the order of time: keys that do not validate are in it, too."""
        return tuple(self._received[place] for place in sorted(self._received))

    def report(self) -> OsnmaReport:
        """Return all that is known so far; call `finish` before if no more pages come."""
        keys = tuple(self._keys[time] for time in sorted(self._keys))
        return OsnmaReport(
            first=self._first,
            last=self._last,
            n_pages=self._counts["pages"],
            n_crc_failures=self._counts["crc"],
            n_alert_pages=self._counts["alert"],
            pages=dict(self._pages),
            n_missing_pages=self._counts["missing"],
            subframes=dict(self._contents),
            satellites=tuple(sorted(self._satellites)),
            osnma_satellites=tuple(sorted(self._osnma_satellites)),
            time_stamps=Count(*self._stamps),
            roots=tuple(self._roots),
            keys=keys,
            withheld=tuple(self._withheld[time] for time in sorted(self._withheld)),
            chain_steps=Count(*self._steps),
            tags=self._tags.counts(),
            navigation=self._tags.navigation(),
            gaps=_gaps(keys),
            problems=tuple(self._problems),
            n_without_root=sum(len(message.satellites) for message in self._waiting),
            dsm_progress=self._dsms.progress(),
        )

    def _take(self, epochs: Iterable[Epoch]) -> tuple[ValidatedKey, ...]:
        keys: list[ValidatedKey] = []
        for epoch in epochs:
            message = self._read(epoch)
            messages = [message] if message is not None else []
            if self._take_dsms(epoch):
                messages, self._waiting = self._waiting + messages, []
            for waiting in messages:
                keys += self._use(waiting)
        return tuple(keys)

    def _read(self, epoch: Epoch) -> _Message | None:
        """Count what an epoch holds, and return its OSNMA; remember its navigation words for the next one."""
        before = dict(self._navigation)
        usable = []
        headers = []
        for svid, subframe in epoch.satellites.items():
            content = subframe.content
            self._contents[content] += 1
            self._counts["missing"] += subframe.n_missing
            self._satellites.add(svid)
            self._navigation[svid] = self._navigation.get(svid, NavigationWords()).updated(subframe)
            if subframe.sends_osnma:
                self._osnma_satellites.add(svid)
                usable.append(subframe)
                place = epoch.time.gst_seconds, svid
                self._received[place] = ReceivedOsnma(svid=svid, time=epoch.time, fields=subframe.osnma)
            if subframe.nma_header is not None:
                headers.append(NmaHeader(subframe.nma_header))
        # One satellite that says "don't use" is enough: a forger with a compromised chain would not say it.
        refusing = [header for header in headers if header.status == DONT_USE]
        if not headers:
            return None
        status = refusing[0] if refusing else Counter(headers).most_common(1)[0][0]
        return _Message(epoch.time, status, tuple(usable), before)

    def _take_dsms(self, epoch: Epoch) -> bool:
        """Take the DSM blocks of an epoch; return whether a new chain can be used."""
        n_chains = len(self._chains)
        for subframe in epoch.satellites.values():
            if subframe.content is not Content.OSNMA:
                continue
            try:
                for message in self._dsms.add(subframe):
                    self._take_dsm(message, epoch.time)
            except UnsupportedError as error:
                self._report_once(ProblemKind.IGNORED, epoch.time, str(error))
        return len(self._chains) > n_chains

    def _take_dsm(self, message: DsmMessage, time: GalileoTime) -> None:
        if message.is_root_key:
            self._take_root(message, time)
        elif self._tree is None:
            self._report_once(
                ProblemKind.IGNORED, time, f"DSM {message.dsm_id}: a public key; no Merkle tree to verify it"
            )
        else:
            try:
                key = verify_broadcast_key(message.data, self._tree)
            except VestigeError as error:
                self._report_once(ProblemKind.IGNORED, time, f"DSM {message.dsm_id}: {error}")
            else:
                self._report_once(ProblemKind.IGNORED, time, f"DSM {message.dsm_id}: new {key}, not used")

    def _take_root(self, message: DsmMessage, time: GalileoTime) -> None:
        kroot, root, reason, kind = None, None, "", ProblemKind.ROOT_KEY
        try:
            kroot = parse_kroot(message.data)
            root = verify_root_key(kroot, message.header, self._public_keys, near=time)
        except AuthenticationError as error:
            reason = str(error)
        except VestigeError as error:
            reason, kind = str(error), ProblemKind.IGNORED
        on_known_chain = root is not None and any(chain.holds(root) for chain in self._chains)
        if root is None:
            self._report(Problem(kind=kind, time=time, text=f"DSM {message.dsm_id}: {reason}"))
        elif not on_known_chain:
            self._chains.append(Chain(root))
        self._roots.append(
            RootCheck(
                dsm_id=message.dsm_id,
                header=message.header,
                kroot=kroot,
                received_at=time,
                root=root,
                on_known_chain=on_known_chain,
                reason=reason,
            )
        )

    def _use(self, message: _Message) -> list[ValidatedKey]:
        """Validate the key of a subframe and take its tags; what has no chain yet has to wait."""
        by_chain: dict[int, list[SatelliteSubframe]] = {}
        for subframe in message.satellites:
            header = subframe.nma_header
            chain_id = message.status.chain_id if header is None else NmaHeader(header).chain_id
            by_chain.setdefault(chain_id, []).append(subframe)
        keys = []
        waiting: list[SatelliteSubframe] = []
        for chain_id, subframes in by_chain.items():
            chains = [chain for chain in reversed(self._chains) if chain.chain_id == chain_id]
            if not chains:
                waiting += subframes
                continue
            chain, key = self._validate(message, subframes, chains)
            if message.status.status != DONT_USE:
                for subframe in subframes:
                    mack = parse_mack(subframe, chain.parameters)
                    if mack is not None and subframe.content is Content.OSNMA:
                        self._tags.add(mack, chain, message.navigation)
                if key is not None:
                    self._tags.key_arrived(chain, key.time)
                    keys.append(key)
        if waiting:
            self._waiting.append(_Message(message.time, message.status, tuple(waiting), message.navigation))
        return keys

    def _validate(
        self, message: _Message, subframes: Sequence[SatelliteSubframe], chains: Sequence[Chain]
    ) -> tuple[Chain, ValidatedKey | None]:
        """Return the chain of a subframe's key and the key, or no key if none chains or it may not be used."""
        candidates: dict[Key, list[int]] = {}
        for subframe in subframes:
            parameters = chains[0].parameters
            bits = subframe.mack_bits(parameters.key_start_bit, parameters.key_bits)
            if bits is not None:
                key = Key(time=message.time, data=bits.to_bytes(parameters.key_bytes, "big"))
                candidates.setdefault(key, []).append(subframe.svid)
                place = message.time.gst_seconds, subframe.svid
                self._received[place] = replace(self._received[place], key=key.data)
        if not candidates:
            return chains[0], None
        accepted = None
        for key, svids in candidates.items():
            chain, valid = self._first_valid(key, svids, chains, message.time)
            if valid is not None:
                accepted = chain, valid
        if len(candidates) > 1:
            said = "; ".join(f"{key.data.hex()} from {_names(svids)}" for key, svids in candidates.items())
            self._report(Problem(kind=ProblemKind.DISAGREEMENT, time=message.time, text=f"different keys: {said}"))
        time = message.time.gst_seconds
        known = time in self._keys or time in self._withheld
        if (self._keys or self._withheld) and not known:
            self._steps[accepted is None] += 1
        if accepted is None:
            return chains[0], None
        chain, valid = accepted
        if message.status.status == DONT_USE:
            reason = f"NMA status {message.status}"
            self._withheld[time] = WithheldKey(
                time=valid.time, chain_id=valid.chain_id, data=valid.data, reason=reason)  # fmt: skip
            self._keys.pop(time, None)  # of the same subframe, when a recording is read twice
            self._report_once(ProblemKind.STATUS, message.time, f"{reason}: keys are withheld")
        if known or time in self._withheld:
            return chain, None
        self._keys[time] = valid
        return chain, valid

    def _first_valid(
        self, key: Key, svids: Sequence[int], chains: Sequence[Chain], time: GalileoTime
    ) -> tuple[Chain, ValidatedKey | None]:
        reason = ""
        for chain in chains:
            try:
                return chain, validate(key, chain)
            except AuthenticationError as error:
                reason = reason or str(error)
        self._report(Problem(kind=ProblemKind.KEY, time=time, text=f"{_names(svids)}: {reason}"))
        return chains[0], None

    def _check_time(self, page: InavPage) -> None:
        stamp = time_in_word(page.word)
        if stamp is None:
            return
        week, second = stamp
        same = second == page.time.second and week in (None, page.time.week % 4096)
        self._stamps[not same] += 1
        if not same:
            found = f"{'' if week is None else f'week {week} '}second {second}"
            self._report_once(
                ProblemKind.TIME,
                page.time,
                f"E{page.svid:02d} tells a time that is not the recording's",
                f" (first: {found})",
            )

    def _report(self, problem: Problem) -> None:
        self._problems.append(problem)

    def _report_once(self, kind: ProblemKind, time: GalileoTime, text: str, details: str = "") -> None:
        if (kind, text) not in self._reported_once:
            self._reported_once.add((kind, text))
            self._report(Problem(kind=kind, time=time, text=text + details))


def verify(pages: Iterable[InavPage], public_keys: Sequence[PublicKey], tree: MerkleTree | None = None) -> OsnmaReport:
    """Return what OSNMA proves of a finite stretch of pages; see `OsnmaReceiver` for the parameters."""
    receiver = OsnmaReceiver(public_keys, tree)
    for page in pages:
        receiver.process(page)
    receiver.finish()
    return receiver.report()


def _gaps(keys: Sequence[ValidatedKey]) -> tuple[KeyGap, ...]:
    pairs = pairwise(keys)
    steps = ((after.time, before.time, round(before.time - after.time) // SUBFRAME_S) for after, before in pairs)
    return tuple(KeyGap(after=after, before=before, n_missing=n - 1) for after, before, n in steps if n > 1)


def _names(svids: Sequence[int]) -> str:
    return ", ".join(f"E{svid:02d}" for svid in svids)
