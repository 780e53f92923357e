"""The type of a TESLA key that may be used. RECS are decrypted with no other, and it says when it was on air."""

from __future__ import annotations

from typing import Any, NoReturn

from vestige.time import GalileoTime

_ROOM = "vestige.crypto.osnma.messages.tesla"
_KINDS: list[type] = []  # the one kind of validated key, from the moment when its class is there


class ValidatedKey:
    """A TESLA key that leads to a signed root key; only `vestige.crypto.osnma.messages.tesla.validate` makes one.

    Nothing else makes or changes one: not its constructor, not `dataclasses.replace`, not a pickle, which is validated
    again where it is read. This protects against mistakes and short cuts. Code that calls `object.__setattr__`, uses
    attributes whose names begin with an underscore, or replaces functions of vestige, can do anything in Python and is
    not kept from it.
    """

    __slots__ = ()

    def __new__(cls, *_args: object, **_values: object) -> ValidatedKey:
        """Refuse: `validate` makes its own kind."""
        raise TypeError(f"only {_ROOM}.validate makes a ValidatedKey")

    def __init_subclass__(cls, **options: Any) -> None:
        """Refuse every kind but the first, which is that of `vestige.crypto.osnma.messages.tesla`."""
        if cls.__module__ != _ROOM or _KINDS:
            raise TypeError(f"only {_ROOM} may derive from ValidatedKey")
        super().__init_subclass__(**options)
        _KINDS.append(cls)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        """Refuse."""
        raise AttributeError(f"a ValidatedKey cannot be changed: {name}")

    def __delattr__(self, name: str) -> NoReturn:
        """Refuse."""
        raise AttributeError(f"a ValidatedKey cannot be changed: {name}")

    @property
    def chain_id(self) -> int:
        """OSNMA chain (CID) that it belongs to."""
        raise NotImplementedError

    @property
    def time(self) -> GalileoTime:
        """GST_SF of the key: start of the subframe in which it is transmitted."""
        raise NotImplementedError

    @property
    def disclosed_at(self) -> GalileoTime:
        """Earliest time at which a bit of the key is on air. Samples must be taken before."""
        raise NotImplementedError

    @property
    def complete_at(self) -> GalileoTime:
        """Time at which its last bit has been sent: nobody can have a verdict earlier."""
        raise NotImplementedError

    @property
    def data(self) -> bytes:
        """The key."""
        raise NotImplementedError


def is_validated(key: object) -> bool:
    """Return whether a thing is a validated key; what only looks like one is none."""
    return type(key) in _KINDS
