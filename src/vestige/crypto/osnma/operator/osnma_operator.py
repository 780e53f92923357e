"""Make the OSNMA bits of every satellite and subframe from navigation words, as the OSNMA operator does.

The operator signs root keys with a P-256 key that belongs to a leaf of its Merkle tree. The satellites broadcast the
root keys in blocks (`hkroot`). The operator makes tags for words that were sent up to the previous subframe
(`tag_plan`, `mack`), with keys that it discloses later. The operator also carries out a table of events (`timeline`). A
receiver with this Merkle tree and its public keys verifies the simulated OSNMA like real OSNMA.

The key of a tag is the key that is on air one or eleven subframes after the tag. Shortly before a change of chains,
this key may belong to the next chain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

from vestige.constants import PAGES_A_SUBFRAME, SUBFRAME_S
from vestige.crypto.keys.merkle_tree import MerkleTree
from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.keys.public_key_writer import write_merkle_tree, write_public_key_pem, write_public_key_xml
from vestige.crypto.osnma.messages.chain_parameters import ALPHA_BYTES
from vestige.crypto.osnma.messages.dsm import FIRST_PKR_ID, DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.root_key import RootKey, verify_root_key
from vestige.crypto.osnma.messages.tags import SLOW_KEY_DELAY_S
from vestige.crypto.osnma.messages.tesla import Chain, validate
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.events import silent_svids
from vestige.crypto.osnma.operator.hkroot import SignedMessage, block_index, hkroot_message, message_in_turn
from vestige.crypto.osnma.operator.key_tree import ALERT_LEAF_INDEX, KeyTree, draw_key_tree
from vestige.crypto.osnma.operator.mack import authenticate, encode_mack
from vestige.crypto.osnma.operator.operator_chain import OperatorChain, draw_chain, root_key_time
from vestige.crypto.osnma.operator.seeded_secrets import draw_bytes
from vestige.crypto.osnma.operator.signed_messages import alert_dsm, public_key_dsm
from vestige.crypto.osnma.operator.tag_plan import NavigationHistory, plan_tags
from vestige.crypto.osnma.operator.timeline import OperatorPhase, RootSource, phase_at, phases
from vestige.errors import VestigeError
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

_N_KROOT_IDS = FIRST_PKR_ID - 1  # DSM ids 1 to 11; id 0 is not used, because the DSM header of block 0 would be zero
_N_PKR_IDS = 16 - FIRST_PKR_ID
NO_OSNMA = (bytes(5),) * PAGES_A_SUBFRAME  # fields of a satellite without OSNMA [OSNMA-ICD, 2]


class OsnmaOperator:
    """Operator that makes the OSNMA fields of all simulated satellites.

    Parameters
    ----------
    configuration
        Settings of the operator: secrets, chain and events.

    Raises
    ------
    VestigeError
        If events overlap or need a key that does not exist, or if a needed `own_key` or `notice` is invalid.

    Examples
    --------
    >>> configuration = OperatorConfiguration(seed=b"sky", start=GalileoTime(1400, 3600), n_subframes=20)
    >>> operator = OsnmaOperator(configuration)
    >>> fields = operator.subframe(configuration.start, {7: {}, 11: {}})
    >>> len(fields[7]), fields[7][0].hex()[:2]
    (15, '92')
    """

    def __init__(self, configuration: OperatorConfiguration) -> None:
        self.configuration = configuration
        own = None if configuration.own_key is None else (configuration.pkid, configuration.own_key)
        self.keys: KeyTree = configuration.tree or draw_key_tree(configuration.seed, configuration.notice, own)
        self._phases = phases(configuration.start, configuration.nma_status, configuration.pkid, configuration.events)
        self.chains: tuple[OperatorChain, ...] = tuple(self._draw_chains())
        self._messages = self._sign_all()
        self._history = NavigationHistory()
        self._next = configuration.start

    @property
    def merkle_tree(self) -> MerkleTree:
        """The published Merkle tree, with the public keys of all private keys that sign during the broadcast."""
        return self.keys.published(sorted({root.pkid for phase in self._phases for root in phase.roots}))

    @property
    def public_keys(self) -> tuple[PublicKey, ...]:
        """The verified public keys of `merkle_tree`, beginning with the key in force at the start."""
        return tuple(self.keys.public_key(claim.pkid) for claim in self.merkle_tree.public_keys if claim.pkid)

    def header_at(self, time: GalileoTime) -> NmaHeader:
        """Return the NMA header of the subframe of `time`."""
        return self._header(phase_at(self._phases, time))

    def key_at(self, time: GalileoTime) -> bytes:
        """Return the TESLA key that is disclosed in the subframe that starts at `time`.

        The function raises `VestigeError` if the chain that is on air at this time has no key for the subframe.
        """
        return self.chains[phase_at(self._phases, time).chain].key_at(time).data

    @cached_property
    def _verified(self) -> dict[int, Chain]:
        """Each chain with its verified root key, by number of the chain."""
        return {
            number: Chain(
                verify_root_key(
                    self._root(root, phase, phase.since), self._header(phase), self.public_keys, near=phase.since
                )
            )
            for number, (phase, root) in self._first_use.items()
        }

    @property
    def roots(self) -> tuple[RootKey, ...]:
        """Verified first root key of each chain."""
        return tuple(chain.root for chain in self._verified.values())

    @cached_property
    def _validated(self) -> tuple[ValidatedKey, ...]:
        validated = []
        for number in range(self.configuration.n_subframes):
            time = self.configuration.start + SUBFRAME_S * number
            chain = phase_at(self._phases, time).chain
            validated.append(validate(self.chains[chain].key_at(time), self._verified[chain]))
        return tuple(validated)

    def validated_keys(self) -> tuple[ValidatedKey, ...]:
        """Return the keys of all broadcast subframes, each validated down to its signed root key.

        A receiver of the broadcast can use the returned keys to decrypt RECS, except keys that an event withholds
        (`events.key_withheld`).
        """
        return self._validated

    def subframe(self, time: GalileoTime, words: Mapping[int, Mapping[int, int]]) -> dict[int, tuple[bytes, ...]]:
        """Return the OSNMA fields of all satellites in one subframe.

        Calls must be in the order of time.

        Parameters
        ----------
        time
            Start of the subframe.
        words
            Navigation words of 128 bits that the satellites send in this subframe, by SVID and word type. Tags cover
            words 1 to 6 and 10 that were sent up to the end of the previous subframe. In the first subframe all tags
            are dummies. A word that is not sent in every subframe may be missing.

        Returns
        -------
        dict
            15 fields of 5 bytes by SVID, with a field for each page. The first byte of a field belongs to the HKROOT
            message.

        Raises
        ------
        VestigeError
            If the time is not the start of the next subframe, the broadcast is over, or a word does not have the type
            under which it is given.
        """
        self._check_next(time)
        for svid, sent in words.items():
            for kind, word in sent.items():
                if word >> 122 != kind:
                    raise VestigeError(
                        f"OSNMA operator: E{svid:02d}: found word type {word >> 122}, expected {kind} in 128 bits"
                    )
        silent = silent_svids(self.configuration.events, words, time)
        if phase_at(self._phases, time).silent:
            silent = frozenset(words)
        fields = {svid: NO_OSNMA if svid in silent else self._fields(svid, time) for svid in sorted(words)}
        self.pass_over(time, words)
        return fields

    @property
    def next_subframe(self) -> GalileoTime:
        """Start of the subframe whose fields are made next."""
        return self._next

    def pass_over(self, time: GalileoTime, words: Mapping[int, Mapping[int, int]]) -> None:
        """Take the words of the next subframe without making its fields.

        Parameters and errors are the same as in `subframe`, except that the type of a word is not checked.
        """
        self._check_next(time)
        self._next = time + SUBFRAME_S
        self._history.add(time, words)

    def resume_at(self, time: GalileoTime) -> None:
        """Forget all words, and continue with the subframe that starts at `time`.

        After `SUBFRAMES_REMEMBERED` subframes with complete words the fields equal the fields of an operator that made
        all subframes.

        Parameters
        ----------
        time
            Start of the next subframe.

        Raises
        ------
        VestigeError
            If the operator does not broadcast at this time.
        """
        if time < self.configuration.start:
            raise VestigeError(
                f"OSNMA operator: the broadcast begins at {self.configuration.start}; found a subframe of {time}"
            )
        self._history, self._next = NavigationHistory(), time
        self._check_next(time)

    def _check_next(self, time: GalileoTime) -> None:
        if time >= self._end:
            raise VestigeError(f"OSNMA operator: the broadcast ends at {self._end}; found a subframe of {time}")
        if time != self._next:
            raise VestigeError(f"OSNMA operator: the next subframe is {self._next}, found {time}")

    def write_files(self, folder: Path) -> None:
        """Write the files that receivers trust: `public_key.pem`, `public_key.xml` and `merkle_tree.xml`.

        The public key is the key in force at the start. The tree contains the keys of later events, too.

        Parameters
        ----------
        folder
            An existing folder.

        Raises
        ------
        OSError
            If a file cannot be written.
        """
        claim = self.keys.claim(self.configuration.pkid)
        write_public_key_pem(folder / "public_key.pem", claim)
        write_public_key_xml(folder / "public_key.xml", claim, self.configuration.start)
        write_merkle_tree(folder / "merkle_tree.xml", self.merkle_tree, self.configuration.start)

    @property
    def _end(self) -> GalileoTime:
        return self.configuration.start + SUBFRAME_S * self.configuration.n_subframes

    def _fields(self, svid: int, time: GalileoTime) -> tuple[bytes, ...]:
        phase = phase_at(self._phases, time)
        header = self._header(phase)
        number = round(time - phase.since) // SUBFRAME_S
        message = message_in_turn(self._messages[phase, root_key_time(time)], number)
        hkroot = hkroot_message(header, message, block_index(svid, time, message.n_blocks))
        parameters = self.chains[phase.chain].parameters
        contents = plan_tags(svid, time, self._history, parameters)
        mack = encode_mack(
            authenticate(svid, time, header.status, contents, self.key_at, parameters), self.key_at(time), parameters
        )
        return tuple(hkroot[k : k + 1] + mack[4 * k : 4 * k + 4] for k in range(PAGES_A_SUBFRAME))

    def _header(self, phase: OperatorPhase) -> NmaHeader:
        return NmaHeader(phase.nma_status << 6 | self._chain_id(phase.chain) << 4 | phase.key_status << 1)

    def _chain_id(self, chain: int) -> int:
        return (self.configuration.chain_id + chain) % 4

    @property
    def _first_use(self) -> dict[int, tuple[OperatorPhase, RootSource]]:
        """First phase in which the root key of a chain is on air, and the source of the root key, for each chain."""
        found: dict[int, tuple[OperatorPhase, RootSource]] = {}
        for phase in self._phases:
            for root in phase.roots:
                found.setdefault(root.chain, (phase, root))
        return found

    def _draw_chains(self) -> Iterator[OperatorChain]:
        configuration = self.configuration
        for number, (phase, root) in self._first_use.items():
            seed = configuration.seed if number == 0 else draw_bytes(configuration.seed, f"chain {number}", 32)
            given = configuration.alpha if number == 0 else None
            alpha = draw_bytes(seed, "alpha", ALPHA_BYTES) if given is None else given
            n_keys = round((self._end - phase.since + SLOW_KEY_DELAY_S) / SUBFRAME_S)
            yield draw_chain(
                seed, phase.since, max(n_keys, 1), self._chain_id(number), configuration.parameters(alpha),
                self._header(phase), root.pkid, self.keys.private_key(root.pkid), redraw=given is None,
            )  # fmt: skip

    def _root(self, root: RootSource, phase: OperatorPhase, time: GalileoTime) -> DsmKroot:
        private_key = self.keys.private_key(root.pkid)
        return self.chains[root.chain].signed_root(time, self._header(phase), root.pkid, private_key)

    def _sign_all(self) -> dict[tuple[OperatorPhase, GalileoTime], Sequence[SignedMessage]]:
        """Return the DSMs of each phase and hour, with a new DSM id for new content."""
        ids: dict[bytes, int] = {}
        signed: dict[tuple[OperatorPhase, GalileoTime], Sequence[SignedMessage]] = {}
        for number in range(self.configuration.n_subframes):
            time = self.configuration.start + SUBFRAME_S * number
            place = phase_at(self._phases, time), root_key_time(time)
            if place not in signed:
                signed[place] = tuple(
                    SignedMessage(dsm_id=ids.setdefault(data, _next_id(ids.values(), kroot)), data=data)
                    for data, kroot in self._contents(place[0], time)
                )
        return signed

    def _contents(self, phase: OperatorPhase, time: GalileoTime) -> Iterator[tuple[bytes, bool]]:
        """Yield each DSM of a phase at a time, together with whether the DSM is a DSM-KROOT."""
        root = self.keys.published(()).root
        if phase.alert:
            yield alert_dsm(self.configuration.notice, ALERT_LEAF_INDEX, self.keys.siblings(ALERT_LEAF_INDEX)), False
        for source in phase.roots:
            yield self._root(source, phase, time).serialise(), True
        if phase.new_pkid is not None:
            claim = self.keys.claim(phase.new_pkid)
            leaf = phase.new_pkid - 1
            yield public_key_dsm(claim.point, phase.new_pkid, leaf, self.keys.siblings(leaf), root), False


def _next_id(used: Iterable[int], kroot: bool) -> int:
    """Return the DSM id of a new DSM-KROOT or DSM-PKR; after the last id, the first id is used again."""
    n_used = sum((number < FIRST_PKR_ID) == kroot for number in used)
    return 1 + n_used % _N_KROOT_IDS if kroot else FIRST_PKR_ID + n_used % _N_PKR_IDS
