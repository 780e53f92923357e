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

from vestige.crypto.recs import decrypt
from vestige.crypto.simulated_chain import make_chain
from vestige.crypto.tesla import Chain, Key, validate
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
    with pytest.raises(TypeError, match=r"only vestige\.crypto\.tesla\.validate"):
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
    with pytest.raises(AttributeError):
        chain.root = ROOT


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

    with pytest.raises(TypeError, match="along a Chain, not a Key along Loose"):
        validate(Key(time=START, data=bytes(16)), Loose(ROOT))
