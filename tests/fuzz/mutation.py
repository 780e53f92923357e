"""How inputs are spoiled: changes of bytes, of lines and of trees, all drawn from one `Random`."""

from __future__ import annotations

import base64
import contextlib
import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Any

Spoil = Callable[[Random, bytes], bytes]

NUMBERS = (
    "", " ", "0", "-0.0", "-1", "+5", "1.5", "1e3", "1e15", "1e16", "1e-320", "1e400", "-1e400", "nan", "-nan", "inf",
    "-inf", "Infinity", "0x10", "1_000", "4095", "4096", "65536", "604799", "604800", "2147483648",
    "18446744073709551616", "1000000000000000000", "9" * 400, "9" * 5000, "0x" + "f" * 5000,
    "0." + "1" * 400, "٣", "²", "１２", "true",
)  # fmt: skip
CHARACTERS = (
    "\0", "\a", "\x1b[2J", "\x7f", "\x85", "\x9b", "\u2028", "\u202e", "\u2066", "\ufeff", "\ufffe", "é", "😀", '"',
    "'", "\\", ",", ";", "=", "[", "]", "{", "}", "<", ">", "&", "%s", "#", "\t", "\r", "\n", "\r\n", "-", ".", "..",
    "/", "//etc/passwd", "../../x", "x" * 300, "x" * 70_000,
)  # fmt: skip
_BYTES = (b"\0", b"\xff", b"\x80", b"\x7f", b"\xc3\x28", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n")
_TOKEN = re.compile(r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?|\w+")


def spoil_bytes(rng: Random, data: bytes) -> bytes:
    """Return data with one to four changes that know nothing of what it is."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        rng.choice(_BYTE_CHANGES)(rng, changed)
    return bytes(changed)


def _flip(rng: Random, data: bytearray) -> None:
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _overwrite(rng: Random, data: bytearray) -> None:
    """Put an extreme number of 1, 2, 4 or 8 bytes somewhere, more often near the beginning, where headers are."""
    size = rng.choice((1, 2, 4, 8))
    value = rng.choice(
        (0, 1, 127, 128, 255, 65535, (1 << 8 * size) - 1, 1 << (8 * size - 1), rng.getrandbits(8 * size))
    )
    at = rng.randrange(min(len(data), rng.choice((48, 1 << 30))) + 1)
    data[at : at + size] = (value % (1 << 8 * size)).to_bytes(size, rng.choice(("big", "little")))


def _cut(rng: Random, data: bytearray) -> None:
    del data[rng.randrange(len(data) + 1) :]


def _remove(rng: Random, data: bytearray) -> None:
    first, end = _range(rng, data)
    del data[first:end]


def _repeat(rng: Random, data: bytearray) -> None:
    first, end = _range(rng, data)
    data[end:end] = data[first:end]


def _swap(rng: Random, data: bytearray) -> None:
    first, end = _range(rng, data)
    middle = rng.randint(first, end)
    data[first:end] = data[middle:end] + data[first:middle]


def _insert(rng: Random, data: bytearray) -> None:
    at = rng.randrange(len(data) + 1)
    data[at:at] = rng.choice((rng.randbytes(rng.randrange(1, 40)), rng.choice(_BYTES)))


def _blank(rng: Random, data: bytearray) -> None:
    first, end = _range(rng, data)
    data[first:end] = rng.choice((b"\0", b"\xff", b" ")) * (end - first)


_BYTE_CHANGES = (_flip, _flip, _overwrite, _overwrite, _cut, _remove, _repeat, _swap, _insert, _blank)


def _range(rng: Random, data: Sequence[Any]) -> tuple[int, int]:
    first = rng.randrange(len(data) + 1)
    return first, min(len(data), first + rng.choice((1, 4, 30, 1000)))


def spoil_text(rng: Random, data: bytes) -> bytes:
    """Return text with one or two changes: of its lines, its numbers and words, or its characters."""
    text = data.decode("utf-8", "surrogateescape")
    for _ in range(rng.choice((1, 1, 1, 2))):
        text = rng.choice(_TEXT_CHANGES)(rng, text)
    changed = text.encode("utf-8", "surrogateescape")
    return spoil_bytes(rng, changed) if rng.random() < 0.05 else changed


def _line(rng: Random, text: str) -> str:
    lines = text.splitlines(keepends=True) or [""]
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(6)
    if change == 0:
        del lines[at]
    elif change == 1:
        lines.insert(other, lines[at])
    elif change == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif change == 3:
        lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    elif change == 4:
        lines[at] = lines[at].rstrip("\n") + lines[other]
    else:
        lines = lines[: at + 1]
    return "".join(lines)


def _token(rng: Random, text: str) -> str:
    """Replace a number or a word, or write it twice."""
    tokens = list(_TOKEN.finditer(text))
    if not tokens:
        return rng.choice(NUMBERS)
    token = rng.choice(tokens)
    new = rng.choice((rng.choice(NUMBERS), rng.choice(tokens)[0], 2 * token[0], _near(rng, token[0])))
    return text[: token.start()] + new + text[token.end() :]


def _near(rng: Random, token: str) -> str:
    return str(int(token) + rng.choice((-1, 1, 36, 4096))) if re.fullmatch("[0-9]{1,9}", token) else token[::-1]


def _character(rng: Random, text: str) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(CHARACTERS) + text[at + rng.randrange(2) :]


def _ending(rng: Random, text: str) -> str:
    return rng.choice(
        (
            text.replace("\n", "\r\n"),
            text.rstrip("\n"),
            "\ufeff" + text,
            text + "\n\n",
            text + "\0",
            text.replace(",", ";"),
        )
    )


def _shortened(rng: Random, text: str) -> str:
    return text[: rng.randrange(len(text) + 1)]


_TEXT_CHANGES = (_line, _line, _token, _token, _token, _character, _character, _ending, _shortened)


class Raw(str):
    """Text that stands in a TOML or JSON document as it is."""

    __slots__ = ()


WRONG_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2.5, -0.0, 1e15, 1e300, 5e-324, float("nan"), float("inf"), float("-inf"), 1 << 63,
    10**18, 10**20, 10**400, Raw("9" * 5000), Raw("0x" + "f" * 5000),
    Raw("-" + "9" * 400 + ".5"), "", "x", "1", "nan", "none", "\0", "\x1b[2J",
    "\u202e", "\ud800", "x" * 70_000, "/dev/zero", "../..", "-", [], {}, [[]], [{}], [1, "x"], {"x": 1},
    {"kind": "none"}, Raw("[" * 20_000), Raw("[" * 500 + "]" * 500), "9999-12-31T23:59:59 UTC", "99999:0",
)  # fmt: skip


def spoil_tree(rng: Random, tree: Any) -> Any:
    """Return a copy of tables and lists with one or two nodes replaced, removed, renamed, repeated or swapped."""
    tree = json.loads(json.dumps(tree))
    for _ in range(rng.choice((1, 1, 2))):
        holders = [holder for holder in _holders(tree) if holder]
        if not holders or rng.random() < 0.02:
            return rng.choice(WRONG_VALUES)
        _change(rng, rng.choice(holders))
    return tree


def _change(rng: Random, holder: Any) -> None:
    places = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
    at, other = rng.choice(places), rng.choice(places)
    change = rng.randrange(10)
    if change == 0:
        del holder[at]
    elif change == 1:
        holder[at], holder[other] = holder[other], holder[at]
    elif change == 2 and isinstance(holder, dict):
        holder[rng.choice((at + "x", "", "\0", "\x1b[31m", "x" * 300, "kind", "\u202e"))] = holder.pop(at)
    elif change == 2:
        holder.insert(other, holder[at])
    elif change == 3 and isinstance(holder[at], int | float):
        holder[at] = rng.choice((-holder[at], holder[at] + 1, holder[at] * 1e6, holder[at] / 3, str(holder[at])))
    else:
        holder[at] = rng.choice(WRONG_VALUES)


def _holders(tree: Any) -> list[Any]:
    """Return all tables and lists of a tree."""
    inner = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    return ([tree] if isinstance(tree, dict | list) else []) + [one for value in inner for one in _holders(value)]


def json_of(value: Any) -> bytes:
    """Return a tree as JSON, with the texts in `Raw` as they are."""
    if isinstance(value, dict):
        return b"{" + b", ".join(json.dumps(key).encode() + b": " + json_of(one) for key, one in value.items()) + b"}"
    if isinstance(value, list):
        return b"[" + b", ".join(map(json_of, value)) + b"]"
    return value.encode() if isinstance(value, Raw) else json.dumps(value).encode()


def toml_of(tables: Any) -> bytes:
    """Return a tree as TOML; what TOML cannot hold becomes a text, and a tree that is no table a value."""
    if not isinstance(tables, dict):
        return b"value = " + toml_value(tables).encode("utf-8", "surrogatepass")
    lines = [f"{json.dumps(key)} = {toml_value(value)}\n" for key, value in tables.items()]
    return "".join(lines).encode("utf-8", "surrogatepass")


def toml_value(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml_value(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, Raw) or value is None:
        return str(value or "none")
    return json.dumps(value).replace("Infinity", "inf").replace("NaN", "nan")


def spoil_json(rng: Random, data: bytes) -> bytes:
    """Return JSON whose tree or text was spoiled."""
    return _spoil_document(rng, data, json.loads, json_of)


def spoil_toml(rng: Random, data: bytes) -> bytes:
    """Return TOML whose tree or text was spoiled, or that has a line with a key of many parts."""
    if rng.random() < 0.05:
        return _with_long_key(rng, data)
    return _spoil_document(rng, data, lambda content: tomllib.loads(content.decode()), toml_of)


_KEY_LINES = (
    b"%s = 1\n", b"[%s]\n", b"[[%s]]\n", b"x = {%s = 1}\n", b"%s", b'x = {y = """a"""", %s = 1, z = ""}\n',
)  # fmt: skip


def _with_long_key(rng: Random, data: bytes) -> bytes:
    parts = [rng.choice((b"a", b'"a.b"', b"'c'", b"1"))] * rng.choice((19, 21, 900, 40_000))
    key = rng.choice((b".", b" . ")).join(parts)
    lines = data.splitlines(keepends=True)
    line = rng.choice(_KEY_LINES)
    lines.insert(rng.randrange(len(lines) + 1), line % key)
    return b"".join(lines)


def _spoil_document(rng: Random, data: bytes, parse: Callable[[bytes], Any], write: Callable[[Any], bytes]) -> bytes:
    if rng.random() < 0.7:
        with contextlib.suppress(ValueError, RecursionError, OverflowError):  # it was spoiled before
            return write(spoil_tree(rng, parse(data)))
    return spoil_text(rng, data)


_ELEMENT = re.compile(r"<(\w+)>([^<]*)</\1>")
_BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">' + "".join(
    f'<!ENTITY {chr(98 + k)} "{10 * f"&{chr(97 + k)};"}">' for k in range(9)
)
_PROLOGUES = (
    _BOMB + "]><x>&j;</x>", '<!DOCTYPE x SYSTEM "file:///etc/passwd">', '<?xml version="1.0" encoding="utf-7"?>',
    '<?xml version="1.0" encoding="\x1b[2J"?>', "<a>" * 20_000, "<!--", "<![CDATA[",
)  # fmt: skip


def spoil_xml(rng: Random, data: bytes) -> bytes:
    """Return XML with the content of an element changed, an element removed, repeated or renamed, or text spoiled."""
    text = data.decode("utf-8", "surrogateescape")
    elements = list(_ELEMENT.finditer(text))
    choice = rng.random()
    if choice < 0.25 or not elements:
        return spoil_text(rng, data)
    if choice < 0.32:
        return (rng.choice(_PROLOGUES) + text).encode("utf-8", "surrogateescape")
    one, other = rng.choice(elements), rng.choice(elements)
    content = rng.choice(
        (rng.choice(NUMBERS), rng.choice(CHARACTERS), other[2], one[2][:-1], _digit(rng, one[2]), one[2] * 2, "<b/>")
    )
    new = rng.choice(
        (f"<{one[1]}>{content}</{one[1]}>",) * 6
        + ("", 2 * one[0], one[0] + other[0], f"<{other[1]}>{one[2]}</{other[1]}>")
    )
    return (text[: one.start()] + new + text[one.end() :]).encode("utf-8", "surrogateescape")


def _digit(rng: Random, text: str) -> str:
    """Return text with one character changed to a hexadecimal digit: the right form, another value."""
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice("0123456789abcdefABCDEF") + text[at + 1 :]


def spoil_pem(rng: Random, data: bytes) -> bytes:
    """Return a PEM file whose DER was spoiled and encoded anew, or whose text was."""
    match = re.fullmatch(rb"(-----BEGIN [^\n]+\n)([A-Za-z0-9+/\n]+=*\n)(-----END [^\n]+\n)", data)
    if match is not None and rng.random() < 0.7:
        with contextlib.suppress(ValueError):  # it was spoiled before
            return match[1] + base64.encodebytes(spoil_bytes(rng, base64.b64decode(match[2]))) + match[3]
    return spoil_text(rng, data)


def by_suffix(name: str) -> Spoil:
    """Return what spoils a file of this name best."""
    forms: Mapping[str, Spoil] = {
        "toml": spoil_toml, "json": spoil_json, "sigmf-meta": spoil_json, "sigmf-collection": spoil_json,
        "csv": spoil_text, "rnx": spoil_text, "txt": spoil_text, "jsonl": spoil_text, "xml": spoil_xml,
        "pem": spoil_pem,
    }  # fmt: skip
    return forms.get(name.rpartition(".")[2], spoil_bytes)
