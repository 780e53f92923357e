"""Verify tags and MACSEQ fields when their keys arrive, and record the navigation data that the tags prove."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.messages.mac_lookup import Slot, slots
from vestige.crypto.osnma.messages.navigation_data import ADKD_EPHEMERIS, ADKD_SLOW, NavigationData, NavigationWords
from vestige.crypto.osnma.messages.tags import KEY_DELAY_S, MIN_TAG_BITS, Mack, Tag, macseq_ok, make_tag
from vestige.crypto.osnma.messages.tesla import Chain
from vestige.crypto.osnma.osnma_report import AuthenticatedData, Count, ProblemKind, ProblemLog, TagCounts
from vestige.errors import UnsupportedError
from vestige.time import GalileoTime

MAX_RECOVERY_S = 86_400  # our limit for the age of a lost key that is computed from a later key to verify old tags


@dataclass(slots=True)
class _Message:
    """A MACK message with checks that wait for one or more keys."""

    mack: Mack
    slots: tuple[Slot, ...]
    macseq: bool = False


@dataclass(frozen=True, slots=True)
class _Check:
    """A check that waits for a key, either of a tag with its data, or of the MACSEQ field (`tag` is None)."""

    message: _Message
    tag: Tag | None = None
    data: tuple[NavigationData, ...] = ()


class TagVerifier:
    """Verifier that stores tags until their keys arrive, and then checks the tags."""

    def __init__(self, problems: ProblemLog) -> None:
        self._problems = problems
        self._pending: dict[Chain, dict[int, list[_Check]]] = {}
        self._macseq = [0, 0]
        self._tags: dict[int, list[int]] = {}
        self._not_counted: Counter[str] = Counter()
        self._n_data_before = 0
        self._proven: dict[tuple[int, int, int], AuthenticatedData] = {}
        self._unsupported: set[str] = set()

    def add(self, mack: Mack, chain: Chain, navigation: Mapping[int, NavigationWords]) -> None:
        """Add tags and MACSEQ of a satellite and subframe; `navigation` has the words received before the subframe."""
        try:
            row = slots(chain.parameters, mack.time)
        except UnsupportedError as error:
            if str(error) not in self._unsupported:
                self._unsupported.add(str(error))
                self._problem(ProblemKind.IGNORED, mack, str(error))
            return
        message = _Message(mack, row)
        self._wait(chain, mack.time.gst_seconds + KEY_DELAY_S, _Check(message))
        for tag, slot in zip(mack.tags, row, strict=True):
            if not tag.supported:
                self._not_counted["unsupported"] += 1
            elif not slot.allows(adkd=tag.adkd, own=tag.svid == mack.svid):
                self._count(tag, ok=False)
                self._problem(ProblemKind.TAG, mack, f"tag {tag.counter} says ADKD {tag.adkd} of E{tag.svid:02d}; "
                              "the MAC look-up table allows no such tag in this slot")  # fmt: skip
            else:
                data = navigation.get(tag.svid, NavigationWords()).candidates(tag.svid, tag.adkd, mack.time)
                self._wait(chain, mack.time.gst_seconds + tag.key_delay_s, _Check(message, tag, data))

    def key_arrived(self, chain: Chain, time: GalileoTime) -> None:
        """Do the checks with the key of `time`, and with keys up to `MAX_RECOVERY_S` older, derived from later keys."""
        pending = self._pending.get(chain, {})
        now = time.gst_seconds
        for due in sorted(key_time for key_time in pending if now - MAX_RECOVERY_S <= key_time <= now):
            key = chain.derive(GalileoTime.from_gst_seconds(due)).data
            for check in pending.pop(due):
                self._do(check, key, chain)

    def counts(self) -> TagCounts:
        """Return the counts of tags and MACSEQ fields; tags that still wait for a key count as `no_key`."""
        waiting = [check for times in self._pending.values() for checks in times.values() for check in checks]
        return TagCounts(
            macseq=Count(*self._macseq),
            by_adkd={adkd: Count(*counts) for adkd, counts in sorted(self._tags.items())},
            dummy=self._not_counted["dummy"],
            no_data=self._not_counted["no data"],
            no_key=sum(check.tag is not None for check in waiting),
            unsupported=self._not_counted["unsupported"],
            data_before=self._n_data_before,
        )

    def navigation(self) -> tuple[AuthenticatedData, ...]:
        """Return the navigation data that tags verified, sorted by satellite, ADKD and time of the first tag."""
        return tuple(sorted(self._proven.values(), key=lambda data: (data.svid, data.adkd, data.first)))

    def forget(self, before: GalileoTime) -> None:
        """Drop navigation data that was last verified before a time, and checks whose key was due before this time."""
        limit = before.gst_seconds
        self._proven = {place: data for place, data in self._proven.items() if data.last >= before}
        for pending in self._pending.values():
            for due in [due for due in pending if due < limit]:
                del pending[due]

    def _wait(self, chain: Chain, key_time: int, check: _Check) -> None:
        self._pending.setdefault(chain, {}).setdefault(key_time, []).append(check)

    def _do(self, check: _Check, key: bytes, chain: Chain) -> None:
        message, tag, data = check.message, check.tag, check.data
        if tag is None:
            message.macseq = macseq_ok(message.mack, message.slots, key, chain.parameters)
            self._macseq[not message.macseq] += 1
            if not message.macseq:
                self._problem(ProblemKind.MACSEQ, message.mack, "MACSEQ does not verify")
        elif not data:
            self._not_counted["no data"] += 1
        elif tag.cut_off == 0:
            self._not_counted["dummy"] += 1
        else:
            self._check_tag(message, tag, data, key, chain)

    def _check_tag(
        self, message: _Message, tag: Tag, candidates: Sequence[NavigationData], key: bytes, chain: Chain
    ) -> None:
        latest = candidates[0]
        proven = next(
            (data for data in candidates if make_tag(message.mack, tag, data, key, chain.parameters) == tag.value), None
        )
        flexible = message.slots[tag.counter - 1].flexible
        if flexible and not message.macseq:
            self._count(tag, ok=False)
            self._problem(
                ProblemKind.TAG, message.mack, f"tag {tag.counter} is in a flexible slot without a good MACSEQ"
            )
        elif proven is not None:
            self._count(tag, ok=True)
            self._n_data_before += proven is not latest
            self._prove(message.mack, tag, proven, chain.parameters.tag_bits)
        elif latest.oldest_s < message.mack.time.gst_seconds - SUBFRAME_S * tag.cut_off:
            # The data may have changed since its last reception, so the tag may cover missed data.
            self._not_counted["no data"] += 1
        else:
            self._count(tag, ok=False)
            issue = "" if latest.iod_nav is None else f", IODnav {latest.iod_nav}"
            self._problem(ProblemKind.TAG, message.mack,
                          f"tag {tag.counter} (ADKD {tag.adkd} of E{tag.svid:02d}{issue}) does not verify")  # fmt: skip

    def _count(self, tag: Tag, *, ok: bool) -> None:
        self._tags.setdefault(tag.adkd, [0, 0])[not ok] += 1

    def _prove(self, mack: Mack, tag: Tag, data: NavigationData, tag_bits: int) -> None:
        adkd = ADKD_EPHEMERIS if tag.adkd == ADKD_SLOW else tag.adkd
        key = (data.svid, adkd, data.bits)
        before = self._proven.get(key)
        if before is None:
            before = AuthenticatedData(
                svid=data.svid, adkd=adkd, iod_nav=data.iod_nav, first=mack.time, last=mack.time, n_tags=0, tag_bits=0,
                authenticated=False,
            )  # fmt: skip
        self._proven[key] = replace(
            before,
            first=min(before.first, mack.time),
            last=max(before.last, mack.time),
            n_tags=before.n_tags + 1,
            tag_bits=before.tag_bits + tag_bits,
            authenticated=before.tag_bits + tag_bits >= MIN_TAG_BITS,
        )

    def _problem(self, kind: ProblemKind, mack: Mack, text: str) -> None:
        self._problems.report(kind, mack.time, f"E{mack.svid:02d}: {text}")
