"""Validate TESLA keys along a chain in which each key is the hash of the next key.

Because of the hashes, an old key of a chain can validate a new key. The operator draws the last key of a chain, and
hashes the last key down to the first key. The first key is a root key, which is signed. The operator may also sign
later keys of the chain as root keys. The operator discloses the keys in the reverse order, one key every 30 s::

    K_m = first l_k bits of hash( K_(m+1) | GST_SF,m | alpha )                                 [OSNMA-ICD, 6.4]

The length of a key is l_k bits, and alpha is the random pattern of the chain. GST_SF,m is the start of the subframe in
which K_m is sent. GST_SF,m has 12 bits for the week modulo 4096, and 20 bits for the second of the week. A receiver
with a true key can check every later key by hashing the later key down, and can compute every earlier key. An
undisclosed key cannot be guessed.

The type of a key shows whether the key may be used. A `Key` is not validated. A `ValidatedKey` leads to a signed root
key, and only `validate` makes a `ValidatedKey`. A pickled `ValidatedKey` contains its chain's root key, and unpickling
validates the key again. A chain stores its validated keys, so the validation of N consecutive keys needs about N
hashes.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Callable
from dataclasses import dataclass

from vestige.constants import SECONDS_PER_WEEK, SUBFRAME_S
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.errors import AuthenticationError
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

MAX_STEPS = (
    8 * SECONDS_PER_WEEK // SUBFRAME_S
)  # our limit of the number of hashes for one key, which take less than 0.2 s; a root key is sent about every hour


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A TESLA key that is not validated, such as a received key."""

    time: GalileoTime  # start of the subframe in which the key was sent
    data: bytes


def gst_sf(gst_seconds: int) -> bytes:
    """Return the 32 bits of a subframe's start: week modulo 4096 in 12 bits, second of the week in 20 bits."""
    week, second = divmod(gst_seconds, SECONDS_PER_WEEK)
    return (week % 4096 << 20 | second).to_bytes(4, "big")


def one_way(key: bytes, time: GalileoTime, parameters: ChainParameters) -> bytes:
    """Return the key before `key` in the chain.

    `time` is the start of the subframe of the returned key, 30 s before the subframe of `key`.
    """
    return _hash_down(key, time.gst_seconds + SUBFRAME_S, time.gst_seconds, parameters)


def _hash_down(key: bytes, start: int, stop: int, parameters: ChainParameters) -> bytes:
    """Return the key of the subframe `stop` from the `key` of the subframe `start` (GST seconds, start >= stop)."""
    alpha, n_bytes, new_hash = parameters.alpha, parameters.key_bytes, parameters.new_hash
    for time in range(start - SUBFRAME_S, stop - 1, -SUBFRAME_S):
        key = new_hash(key + gst_sf(time) + alpha).digest()[:n_bytes]
    return key


class Chain:
    """A TESLA chain with a signed root key, and its keys that were validated so far.

    The constructor raises `TypeError` if `root` is not a `RootKey`, because only the construction of a `RootKey`
    verifies the signature.
    """

    __slots__ = ("_known", "_root", "_times")  # no other attribute can be set, so `check` cannot be replaced

    def __init__(self, root: RootKey) -> None:
        if type(root) is not RootKey:
            raise TypeError(f"a Chain needs a RootKey, not a {type(root).__name__}")
        self._root = root
        self._known = {root.time.gst_seconds: root.data}
        self._times = [root.time.gst_seconds]

    def __reduce__(self) -> tuple[type[Chain], tuple[RootKey]]:
        """Return the class and its arguments for pickle, without the validated keys."""
        return Chain, (self._root,)

    @property
    def root(self) -> RootKey:
        """Signed root key of the chain."""
        return self._root

    @property
    def chain_id(self) -> int:
        """CID, the number of the chain."""
        return self.root.chain_id

    @property
    def parameters(self) -> ChainParameters:
        """Parameters of the chain."""
        return self.root.parameters

    def check(self, key: Key) -> None:
        """Check that a key belongs to the chain at its time, and store the key.

        A key after all known keys is hashed down to the newest known key. An earlier key, even from before the root
        key, must equal the known key of its time or follow from the next later known key.

        The function raises `AuthenticationError` if the key does not belong to the chain, if its time or length is
        wrong, or if more than `MAX_STEPS` hashes are needed. The function raises `TypeError` if `key` is not a `Key`,
        its time is not a `GalileoTime` of whole numbers, or its data is not `bytes`. Objects of other types may change
        later.
        """
        _check_types(key)
        time = key.time.gst_seconds
        if key.time.fraction or (time - self._times[0]) % SUBFRAME_S:
            raise AuthenticationError(f"key of {key.time}: not the start of a subframe")
        if len(key.data) != self.parameters.key_bytes:
            raise AuthenticationError(
                f"key of {key.time}: {8 * len(key.data)} bits, the chain has {self.parameters.key_bits}"
            )
        at = bisect_right(self._times, time)
        if at and self._times[at - 1] == time:
            at -= 1
        if at < len(self._times):  # the key follows from a validated key of this time or later
            found, expected = key.data, self._derived(time, self._times[at])
            reason = f"the key of {GalileoTime.from_gst_seconds(self._times[at])}"
        else:
            anchor = self._times[-1]
            self._check_steps(time - anchor, key.time)
            found, expected = _hash_down(key.data, time, anchor, self.parameters), self._known[anchor]
            reason = (
                f"{(time - anchor) // SUBFRAME_S} steps earlier, to the key of {GalileoTime.from_gst_seconds(anchor)}"
            )
        if found != expected:
            raise AuthenticationError(f"key of {key.time}: {key.data.hex()} does not chain to {reason}")
        if time not in self._known:
            self._known[time] = key.data
            insort(self._times, time)

    def accepts(self, key: Key) -> bool:
        """Return whether `check` accepts a key."""
        try:
            self.check(key)
        except AuthenticationError:
            return False
        return True

    def knows(self, key: Key) -> bool:
        """Return whether a key was already validated along this chain."""
        return self._known.get(key.time.gst_seconds) == key.data

    def derive(self, time: GalileoTime) -> Key:
        """Compute the key of a subframe from the first validated key that is not earlier, and return the computed key.

        The function raises `AuthenticationError` if neither the key of the subframe nor a later key was validated, or
        if the first of these keys is more than `MAX_STEPS` subframes later.
        """
        at = bisect_right(self._times, time.gst_seconds - 1)
        if at == len(self._times):
            raise AuthenticationError(f"key of {time}: not received, and no later key of chain {self.chain_id} either")
        return Key(time=time, data=self._derived(time.gst_seconds, self._times[at]))

    def holds(self, root: RootKey) -> bool:
        """Return whether another signed root key belongs to this chain."""
        if (root.chain_id, root.parameters) != (self.chain_id, self.parameters):
            return False
        return self.accepts(Key(time=root.time, data=root.data))

    def _derived(self, time: int, later: int) -> bytes:
        self._check_steps(later - time, GalileoTime.from_gst_seconds(time))
        return _hash_down(self._known[later], later, time, self.parameters)

    def _check_steps(self, seconds: int, time: GalileoTime) -> None:
        if seconds > MAX_STEPS * SUBFRAME_S:
            raise AuthenticationError(f"key of {time}: more than {MAX_STEPS} steps from the nearest validated key")


def _check_types(key: Key) -> None:
    """Raise `TypeError` if a key, its time or its data has a type that can change, such as a bytearray."""
    if type(key) is not Key:
        raise TypeError(f"only a Key is validated along a Chain, not a {type(key).__name__}")
    if type(key.data) is not bytes or type(key.time) is not GalileoTime:
        raise TypeError(
            f"a Key has a GalileoTime and bytes, not a {type(key.time).__name__} and a {type(key.data).__name__}"
        )
    if (type(key.time.week), type(key.time.second)) != (int, int):
        raise TypeError("the time of a Key has a week and a second of the type int")


class _KeyOfChain(ValidatedKey):
    """The only class of validated keys, whose construction checks the key."""

    __slots__ = ("_chain", "_data", "_time")
    _chain: Chain
    _data: bytes
    _time: GalileoTime

    def __new__(cls, key: Key, chain: Chain) -> _KeyOfChain:
        if type(chain) is not Chain:
            raise TypeError(f"a Key is validated along a Chain, not along a {type(chain).__name__}")
        chain.check(key)
        self = object.__new__(cls)
        for name, value in (("_chain", chain), ("_data", key.data), ("_time", key.time)):
            object.__setattr__(self, name, value)
        return self

    def __reduce__(self) -> tuple[Callable[[Key, Chain], ValidatedKey], tuple[Key, Chain]]:
        """Return `validate` and its arguments for pickle, so that unpickling validates the key again."""
        return validate, (Key(time=self._time, data=self._data), self._chain)

    @property
    def chain_id(self) -> int:
        return self._chain.chain_id

    @property
    def time(self) -> GalileoTime:
        return self._time

    @property
    def disclosed_at(self) -> GalileoTime:
        return self._time + self._chain.parameters.disclosure_start_s

    @property
    def complete_at(self) -> GalileoTime:
        return self._time + self._chain.parameters.disclosure_end_s

    @property
    def data(self) -> bytes:
        return self._data

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _KeyOfChain) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    def __repr__(self) -> str:
        return f"ValidatedKey({self.data.hex()} of chain {self.chain_id}, {self.time})"

    @property
    def _identity(self) -> tuple[bytes, GalileoTime, int, ChainParameters]:
        return self._data, self._time, self._chain.chain_id, self._chain.parameters


def validate(key: Key, chain: Chain) -> ValidatedKey:
    """Validate a key against the chain's signed root key, and return the validated key.

    The chain stores the validated key.

    The function raises `AuthenticationError` if `Chain.check` does not accept the key. The function raises `TypeError`
    if key, chain, or the key's time or data has a type that can change later.
    """
    return _KeyOfChain(key, chain)


def fill_gaps(keys: tuple[ValidatedKey, ...], chain: Chain) -> tuple[ValidatedKey, ...]:
    """Return validated keys in time order, together with the keys of lost subframes, which follow from later keys.

    A derived key has the disclosure time of its own subframe, because the satellites disclosed the key in this
    subframe. Keys of chains other than `chain` are returned unchanged. If no key belongs to `chain`, all keys are
    returned in the given order.
    """
    times = {key.time.gst_seconds for key in keys if chain.knows(Key(time=key.time, data=key.data))}
    if not times:
        return keys
    missing = [time for time in range(min(times), max(times), SUBFRAME_S) if time not in times]
    # In the order from the newest to the oldest each key is one step from a stored key.
    derived = [validate(chain.derive(GalileoTime.from_gst_seconds(time)), chain) for time in reversed(missing)]
    return tuple(sorted((*keys, *derived), key=lambda key: key.time))
