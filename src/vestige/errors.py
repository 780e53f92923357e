"""Errors about what comes from outside: each says the file, the place in it, what was found and what was expected."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

LONGEST = 1000  # characters of a message; what stands in a file or an option may be longer


class VestigeError(Exception):
    """Something from outside (a file, a key, an option) is not usable; the message is one line for the user.

    Our own mistakes are `ValueError` or `assert`, never this.

    Parameters
    ----------
    message
        File, place, what was found and what was expected. It is cut after 1000 characters.

    Examples
    --------
    >>> import vestige as vs
    >>> try:
    ...     vs.load_scenario("scenarios/quick.toml", ["epochs=none"])
    ... except vs.VestigeError as error:
    ...     print(error)
    scenarios/quick.toml: epochs: found nothing, expected a value: the key is needed
    """

    def __init__(self, message: str) -> None:
        line = printable(" ".join(message.split()))
        super().__init__(line if len(line) <= LONGEST else f"{line[: LONGEST - 200]} … {line[-200:]}")


class InputFileError(VestigeError):
    """A file that cannot be read as what it claims to be.

    Parameters
    ----------
    path
        The file.
    place
        Where in it: a byte offset, a line, a field.
    found, expected
        The value that stands there, and the one that should.
    """

    def __init__(self, path: Path | str, place: str, found: object, expected: object) -> None:
        super().__init__(f"{printable(str(path))}: {place}: found {_short(found)}, expected {_short(expected)}")
        self.path, self.place, self.found, self.expected = Path(path), place, found, expected

    def __reduce__(self) -> tuple[type[InputFileError], tuple[Path, str, object, object]]:
        """Return the class and its arguments for pickle: a worker process hands its errors back pickled."""
        return type(self), (self.path, self.place, self.found, self.expected)


class AuthenticationError(VestigeError):
    """A signature, hash, chain or tag does not verify; nothing that depends on it may be used."""


class UnsupportedError(VestigeError):
    """The input is valid, but vestige does not support this part of the standard; the message says which."""


def satellite_names(svids: Iterable[int]) -> str:
    """Return satellites as messages name them: `E02, E07`."""
    return ", ".join(f"E{svid:02d}" for svid in svids)


def printable(text: str) -> str:
    """Return `text` with what is not printable as escapes: control and C1 characters, line breaks, bidirectional marks.

    Names and contents of files come from outside. Such text can clear a terminal's screen, or show a line that differs
    from its characters.
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in text)


def _short(value: object, limit: int = 80) -> str:
    """Return `value` as printable text of at most `limit` characters (files may hold anything)."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except ValueError:  # Python writes no integer of more than 4300 digits
        text = "an integer of thousands of digits"
    text = printable(text[: limit + 1])
    return text if len(text) <= limit else text[: limit - 1] + "…"


class VestigeWarning(UserWarning):
    """Something that works and that a user should change; the command line prints it as one line."""
