"""Nothing but `tesla.validate` makes a validated key or changes one; worker processes receive keys all the same."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from inspect import unwrap
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from simulated_chain import make_chain
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.osnma.messages.tesla import Chain, Key, one_way, validate
from vestige.crypto.recs.recs_segment import decrypt
from vestige.errors import AuthenticationError
from vestige.records import EncryptedSegment
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey, is_validated

START = GalileoTime(1400, 7200)
OPERATOR = make_chain(b"keys", START, 4)
ROOT = OPERATOR.root
KEYS = OPERATOR.validated_keys()
LATER = KEYS[0].disclosed_at + 3600


def test_its_constructor_refuses() -> None:
    values: dict[str, Any] = {
        name: getattr(KEYS[0], name) for name in ("chain_id", "time", "disclosed_at", "complete_at", "data")
    }
    with pytest.raises(TypeError, match=r"only vestige\.crypto\.osnma\.messages\.tesla\.validate"):
        ValidatedKey(**values)
    with pytest.raises(TypeError, match="may derive"):
        type("Mine", (ValidatedKey,), {})
    with pytest.raises(AuthenticationError, match="does not chain"):
        type(KEYS[0])(Key(time=START, data=bytes(16)), Chain(ROOT))


def test_it_cannot_be_changed() -> None:
    thing: Any = KEYS[0]
    with pytest.raises(TypeError, match="dataclass"):
        dataclasses.replace(thing, disclosed_at=LATER)
    for name in ("disclosed_at", "time", "_time", "_chain", "other"):
        with pytest.raises(AttributeError):
            setattr(thing, name, LATER)
        with pytest.raises(AttributeError):
            delattr(thing, name)
    assert not hasattr(thing, "__dict__")
    chain: Any = Chain(ROOT)
    for name in ("root", "check", "parameters", "other"):
        with pytest.raises(AttributeError):
            setattr(chain, name, ROOT)


def test_it_has_one_kind() -> None:
    """A class that says that it comes from the same module is refused, and so is one that derives from the kind."""
    for base in (ValidatedKey, type(KEYS[0])):
        with pytest.raises(TypeError, match="may derive"):
            type("Mine", (base,), {"__module__": "vestige.crypto.osnma.messages.tesla", "__slots__": ()})
    assert is_validated(KEYS[0])
    assert not is_validated(Mock(spec=ValidatedKey))
    assert not is_validated(object())


class LateTime(GalileoTime):
    """A time that adds an hour."""

    def __add__(self, seconds: float) -> GalileoTime:
        return GalileoTime(self.week, self.second) + (seconds + 3600)


class Number(int):
    """A number that may become another one."""


class Bytes(bytes):
    """Bytes that may say anything."""


TIME, DATA = KEYS[1].time, KEYS[1].data


@pytest.mark.parametrize(
    ("time", "data"),
    [
        (TIME, bytearray(DATA)), (TIME, memoryview(DATA)), (TIME, Bytes(DATA)),
        (LateTime(TIME.week, TIME.second), DATA),
        (GalileoTime(Number(TIME.week), TIME.second), DATA), (GalileoTime(TIME.week, Number(TIME.second)), DATA),
    ],
)  # fmt: skip
def test_a_key_of_what_can_change_later_is_refused(time: Any, data: Any) -> None:
    chain = Chain(ROOT)
    for check in (chain.check, chain.accepts, lambda key: validate(key, chain)):
        with pytest.raises(TypeError, match="Key"):
            check(Key(time=time, data=data))
    assert not chain.knows(Key(time=TIME, data=DATA))


def test_a_chain_cannot_be_led_to_another_key_by_its_buffer() -> None:
    """If the chain remembered the buffer, its owner could write into it what a forged later key hashes to."""
    chain, buffer, forged = Chain(ROOT), bytearray(DATA), bytes(16)
    with pytest.raises(TypeError):
        validate(Key(time=TIME, data=buffer), chain)  # type: ignore[arg-type]
    buffer[:] = one_way(forged, TIME, chain.parameters)
    with pytest.raises(AuthenticationError):
        validate(Key(time=TIME + 30, data=forged), chain)


def test_a_chain_hangs_on_a_root_key_and_nothing_like_it() -> None:
    class Unchecked(RootKey):
        def __post_init__(self) -> None:
            """Verify nothing."""

    values: dict[str, Any] = {field.name: getattr(ROOT, field.name) for field in dataclasses.fields(ROOT)}
    values["kroot"] = dataclasses.replace(ROOT.kroot, root_key=bytes(16))
    for fake in (Unchecked(**values), SimpleNamespace(time=ROOT.time, data=bytes(16))):
        with pytest.raises(TypeError, match="a Chain needs a RootKey"):
            Chain(fake)  # type: ignore[arg-type]


def test_a_root_key_verifies_what_nobody_else_has() -> None:
    buffer = bytearray(ROOT.data)
    root = dataclasses.replace(ROOT, kroot=dataclasses.replace(ROOT.kroot, root_key=buffer))  # type: ignore[arg-type]
    buffer[:] = bytes(16)
    assert Chain(root).root.data == ROOT.data
    for part in ("kroot", "header", "public_key", "time", "received_at"):
        with pytest.raises(TypeError, match="a RootKey has a"):
            dataclasses.replace(ROOT, **{part: Mock(spec=type(getattr(ROOT, part)))})


def test_keys_travel_to_workers_and_are_validated_there() -> None:
    arrived = pickle.loads(pickle.dumps(KEYS))  # noqa: S301  (ours)
    assert arrived == KEYS
    assert hash(arrived[0]) == hash(KEYS[0])
    assert [key.disclosed_at for key in arrived] == [key.disclosed_at for key in KEYS]
    assert all(is_validated(key) for key in arrived)
    assert copy.copy(KEYS[0]) == copy.deepcopy(KEYS[0]) == KEYS[0]


def test_a_pickle_that_was_changed_is_refused() -> None:
    """Its bits lead to no signed root key, neither the key's nor those of the root key."""
    whole = pickle.dumps(KEYS[1])
    for part in (KEYS[1].data, ROOT.data, OPERATOR.kroot.signature, OPERATOR.kroot.padding):
        changed = bytearray(whole)
        changed[whole.index(part)] ^= 1
        with pytest.raises(AuthenticationError):
            pickle.loads(bytes(changed))  # noqa: S301  (ours)
    make: Any
    make, (key, chain) = KEYS[1].__reduce__()  # type: ignore[misc]
    with pytest.raises(AuthenticationError):
        make(dataclasses.replace(key, time=key.time + 30), chain)


def test_a_root_key_is_checked_whenever_one_is_made() -> None:
    """A root key with a later time would be a key that is disclosed later."""
    other = make_chain(b"other", START, 1).root
    changes: tuple[dict[str, Any], ...] = (
        {"time": ROOT.time + 3600},
        {"kroot": other.kroot},
        {"public_key": other.public_key},
        {"kroot": dataclasses.replace(ROOT.kroot, root_key=bytes(16))},
    )
    for change in changes:
        with pytest.raises(AuthenticationError):
            dataclasses.replace(ROOT, **change)


@pytest.mark.parametrize("kind", [SimpleNamespace, lambda **values: Mock(spec=ValidatedKey, **values)])
def test_nothing_is_decrypted_with_what_only_looks_like_a_key(kind: Any) -> None:
    fake = kind(chain_id=0, time=START, disclosed_at=LATER, complete_at=LATER, data=bytes(16))
    segment = EncryptedSegment(
        svid=1, transmit_time=START, n_chips=5115, cipher=bytes(640), key_time=START, key_delay=0
    )
    with pytest.raises(TypeError, match="with a ValidatedKey, not with a"):
        unwrap(decrypt)(segment, fake)  # without the type checker of the tests


def test_a_chain_that_checks_nothing_validates_nothing() -> None:
    class Loose(Chain):
        def check(self, key: Key) -> None:
            """Accept it."""

    with pytest.raises(TypeError, match="along a Chain, not along a Loose"):
        validate(Key(time=START, data=bytes(16)), Loose(ROOT))
