"""Define the type of a validated TESLA key with its times on air; only validated keys decrypt RECS."""

from __future__ import annotations

from typing import Any, NoReturn

from vestige.time import GalileoTime

_ROOM = "vestige.crypto.osnma.messages.tesla"
_KINDS: list[type] = []  # contains the only class of validated keys, after the class is defined


class ValidatedKey:
    """TESLA key that leads to a signed root key.

    Only `vestige.crypto.osnma.messages.tesla.validate` makes validated keys. The constructor and `dataclasses.replace`
    refuse to make or change a validated key. A pickled key is validated again when the pickle is read. These checks
    protect against programming errors. Python cannot stop code that calls `object.__setattr__`, uses attributes whose
    names begin with an underscore, or replaces functions of vestige.
    """

    __slots__ = ()

    def __new__(cls, *_args: object, **_values: object) -> ValidatedKey:
        """Refuse the construction, because only `validate` makes validated keys."""
        raise TypeError(f"only {_ROOM}.validate makes a ValidatedKey")

    def __init_subclass__(cls, **options: Any) -> None:
        """Refuse every subclass except the first subclass in `vestige.crypto.osnma.messages.tesla`."""
        if cls.__module__ != _ROOM or _KINDS:
            raise TypeError(f"only {_ROOM} may derive from ValidatedKey")
        super().__init_subclass__(**options)
        _KINDS.append(cls)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        """Refuse any change of an attribute."""
        raise AttributeError(f"a ValidatedKey cannot be changed: {name}")

    def __delattr__(self, name: str) -> NoReturn:
        """Refuse to delete an attribute."""
        raise AttributeError(f"a ValidatedKey cannot be changed: {name}")

    @property
    def chain_id(self) -> int:
        """Number (CID) of the OSNMA chain of the key."""
        raise NotImplementedError

    @property
    def time(self) -> GalileoTime:
        """GST_SF of the key, the start of the subframe in which the key is transmitted."""
        raise NotImplementedError

    @property
    def disclosed_at(self) -> GalileoTime:
        """Earliest time at which a bit of the key is on air.

        Samples for a RECS with this key must be taken before this time.
        """
        raise NotImplementedError

    @property
    def complete_at(self) -> GalileoTime:
        """Time at which the last bit of the key has been sent; no verdict with this key is possible earlier."""
        raise NotImplementedError

    @property
    def data(self) -> bytes:
        """Bytes of the key."""
        raise NotImplementedError


def is_validated(key: object) -> bool:
    """Return whether an object is a validated key; objects that only look like a validated key do not count."""
    return type(key) in _KINDS
