"""Define errors and warnings about input. An `InputFileError` names file, position, found value and expected value."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

LONGEST = 1000  # a message of more characters is shortened, because the message may quote long contents of a file


class VestigeError(Exception):
    """Input (a file, a key, an option) is not usable. The message is one line for the user.

    An error in the program itself raises another exception, such as `ValueError` or `AssertionError`.

    Parameters
    ----------
    message
        Text with the file, the position in the file, the found value and the expected value. The middle of a text of
        more than 1000 characters is left out.

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
    """A file cannot be read in its expected format.

    Parameters
    ----------
    path
        File that cannot be read.
    place
        Position in the file: a byte offset, a line, or a field.
    found, expected
        Value that was found at the position, and expected value.
    """

    def __init__(self, path: Path | str, place: str, found: object, expected: object) -> None:
        super().__init__(f"{printable(str(path))}: {place}: found {_short(found)}, expected {_whole(expected)}")
        self.path, self.place, self.found, self.expected = Path(path), place, found, expected

    def __reduce__(self) -> tuple[type[InputFileError], tuple[Path, str, object, object]]:
        """Return the class and its arguments for pickle, because a worker process returns its errors pickled."""
        return type(self), (self.path, self.place, self.found, self.expected)


class AuthenticationError(VestigeError):
    """A signature, hash, chain or tag does not verify, so dependent data must not be used."""


class UnsupportedError(VestigeError):
    """The input is valid, but uses a part of a standard that vestige does not support.

    The message names the part.
    """


class SettingError(ValueError):
    """A value of a setting is outside its range, or does not fit other settings.

    Parameters
    ----------
    place
        Key of the value in the table of settings that is checked, such as `delay_s` or `receiver.clock`.
    found, expected
        Value that was found at the key, and expected value.
    """

    def __init__(self, place: str, found: object, expected: str) -> None:
        super().__init__(f"{place}: found {found}, expected {expected}")
        self.place, self.found, self.expected = place, found, expected


def satellite_names(svids: Iterable[int]) -> str:
    """Return the names of satellites for messages, such as `E02, E07`."""
    return ", ".join(f"E{svid:02d}" for svid in svids)


def printable(text: str) -> str:
    """Return `text` with unprintable characters escaped, such as control characters, line breaks, bidirectional marks.

    Names and contents of files are untrusted text. Untrusted text can clear a terminal's screen, or make the terminal
    show other characters than the text has.
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in text)


def _whole(value: object) -> str:
    """Return the expected value as printable text. The text is not shortened, because it tells the user what to do."""
    return printable(value if isinstance(value, str) else repr(value))


def _short(value: object, limit: int = 80) -> str:
    """Return `value` as printable text of at most `limit` characters, because files may contain any value."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except ValueError:  # Python does not print integers of more than 4300 digits
        text = "an integer of thousands of digits"
    text = printable(text[: limit + 1])
    return text if len(text) <= limit else text[: limit - 1] + "…"


class VestigeWarning(UserWarning):
    """Warning about valid input that a user should change. The command line prints the warning as one line."""
