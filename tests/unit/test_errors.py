"""Errors for the user: one line, and the same line when a worker process hands them back."""

import pickle

import pytest

from vestige.errors import AuthenticationError, InputFileError, UnsupportedError, VestigeError

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
