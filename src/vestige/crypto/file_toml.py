"""Parse untrusted TOML in limited time, with limits on keys and nesting.

The time of Python's parser grows with the square of the number of parts of a key `a.b.c`. So a file of 80 kB can take a
minute. Code that walks through nested tables also needs a stack as deep as the tables.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from vestige.crypto.file_bytes import read_bytes
from vestige.errors import InputFileError

DEEPEST = 20  # largest number of nested tables and lists, and of parts of a key; real files need at most 5

# The pattern matches multi-line strings, single-line strings, and comments. The atomic group keeps a backslash and the
# escaped character together. An unterminated multi-line string extends to the end of the text, and an unterminated
# single-line string extends to the end of the line. A new search from every quote in the string would take too long.
_TEXTS = re.compile(
    r'"""(?>\\.|.)*?(?:"{3,5}|\Z)' r"|'''.*?(?:'{3,5}|\Z)" r'|"(?>\\[^\n]|[^"\\\n])*+"?' r"|'[^'\n]*+'?" r"|\#[^\n]*",
    re.DOTALL,
)
_LONG_KEY = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{DEEPEST}}}")
_TOO_DEEP = f"more than {DEEPEST} tables and lists in each other"


def parse_toml(text: str) -> dict[str, Any]:
    r"""Return the tables of a TOML document.

    The function raises `ValueError` if the text is not TOML, a key has more than 20 parts, or more than 20 tables and
    lists are nested.

    Examples
    --------
    >>> parse_toml("[receiver]\nclock.kind = 'none'")
    {'receiver': {'clock': {'kind': 'none'}}}
    """
    bare = _TEXTS.sub(lambda found: "_" + "\n" * found[0].count("\n"), text)
    if (key := _LONG_KEY.search(bare)) is not None:
        line = bare.count("\n", 0, key.start()) + 1
        raise ValueError(f"line {line}: a key of more than {DEEPEST} parts")
    try:
        tables = tomllib.loads(text)
    except RecursionError:  # too many nested brackets for the parser
        raise ValueError(_TOO_DEEP) from None
    _check_depth(tables)
    return tables


def read_toml_file(path: Path, *, at_most: int) -> dict[str, Any]:
    """Return the tables of a TOML file.

    The function raises `InputFileError` in the cases of `read_bytes`, and if the content is not TOML or exceeds the
    limits of `parse_toml`.
    """
    try:
        return parse_toml(read_bytes(path, at_most=at_most).decode())
    except ValueError as error:
        raise InputFileError(path, "content", str(error), "a TOML file") from error


def _check_depth(tables: dict[str, Any]) -> None:
    holders: list[Any] = [tables]
    for _ in range(DEEPEST + 1):
        values = (value for one in holders for value in (one.values() if isinstance(one, dict) else one))
        holders = [value for value in values if isinstance(value, dict | list)]
        if not holders:
            return
    raise ValueError(_TOO_DEEP)
