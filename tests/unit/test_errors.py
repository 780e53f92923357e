"""Errors for the user: one line, and the same line when a worker process hands them back."""

import pickle

import pytest

from vestige.errors import LONGEST, AuthenticationError, InputFileError, UnsupportedError, VestigeError

ERRORS = (
    VestigeError("two\nlines"),
    AuthenticationError("a tag"),
    UnsupportedError("a part"),
    InputFileError("night/keys.csv", "line 3", b"\x00garbage", "32 hexadecimal digits"),
)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_is_one_line_and_survives_the_way_back_from_a_worker(error: VestigeError) -> None:
    returned = pickle.loads(pickle.dumps(error))  # noqa: S301  (our own)
    assert type(returned) is type(error)
    assert str(returned) == str(error)
    assert "\n" not in str(error)
    assert vars(returned) == vars(error)


def test_what_was_found_in_a_file_is_printable_and_short() -> None:
    text = str(InputFileError("a.bin", "byte 0", "\x1b" * 500, "RECS"))
    assert text.isprintable()
    assert len(text) < 150


def test_what_python_does_not_write_is_an_error_of_the_file_all_the_same() -> None:
    assert "found an integer of thousands of digits" in str(InputFileError("a.toml", "x", 1 << 20_000, "a number"))


def test_a_line_has_an_end() -> None:
    text = str(VestigeError(f"--set x={'9' * 70_000}: expected a number"))
    assert len(text) <= LONGEST + 3
    assert text.startswith("--set x=999")
    assert text.endswith(": expected a number")


def test_what_was_expected_is_never_cut() -> None:
    expected = "one of " + ", ".join(f"key_{number}" for number in range(40))
    assert str(InputFileError("a.toml", "x", "an unknown key", expected)).endswith(expected)
