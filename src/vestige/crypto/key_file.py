"""Files with TESLA keys.

The key file of an assistance folder is a CSV that proves itself: beside the keys it has the signed DSM-KROOTs that they
chain to, so that a reader needs nothing but the public key::

    # vestige OSNMA keys 1
    # root,<week>,<NMA header, hex>,<DSM-KROOT, hex>
    gst_week,gst_second,chain_id,key_hex,disclosed_week,disclosed_second,gst
    1251,277200,3,be7801d2d4eb75a7e686054a18c58141,1251,277222,2023-08-16T05:00:00.000 GST

A key's time is the start of the subframe in which it is sent; it is disclosed when its first bit is on air. The last
column is for people. Reading validates every key: the root key's signature, the chain, the disclosure time.

The XML form `<OsnmaKeys><key><osnma_key>…<epoch>…` [SASLIB] holds keys without proof; they need a root key from
elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from vestige.constants import SECONDS_PER_WEEK, SUBFRAME_S
from vestige.crypto.dsm import NmaHeader, parse_kroot
from vestige.crypto.file_bytes import read_bytes
from vestige.crypto.public_key import PublicKey
from vestige.crypto.root_key import RootKey, verify_root_key
from vestige.crypto.tesla import Chain, Key, validate
from vestige.errors import AuthenticationError, InputFileError, VestigeError
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

FIRST_LINE = "# vestige OSNMA keys 1"
COLUMNS = ("gst_week", "gst_second", "chain_id", "key_hex", "disclosed_week", "disclosed_second", "gst")
MAX_FILE_BYTES = 100_000_000  # a year of keys

_ROOT_PREFIX = "# root,"
_MAX_WEEK = 1 << 16


def write_key_file(path: Path, keys: Sequence[ValidatedKey], roots: Sequence[RootKey]) -> None:
    """Write keys with the signed root keys that they chain to; the file is replaced only when it is complete.

    Parameters
    ----------
    path
        The file.
    keys
        Validated keys.
    roots
        Verified root keys of their chains.
    """
    lines = [FIRST_LINE]
    for root in roots:
        lines.append(f"{_ROOT_PREFIX}{root.time.week},{root.header.value:02x},{root.kroot.serialise().hex()}")
    lines.append(",".join(COLUMNS))
    for key in sorted(keys, key=lambda key: key.time):
        disclosed = key.disclosed_at
        lines.append(
            f"{key.time.week},{key.time.second},{key.chain_id},{key.data.hex()},"
            f"{disclosed.week},{disclosed.second},{key.time}"
        )
    unfinished = path.with_name(path.name + ".part")
    unfinished.write_text("\n".join(lines) + "\n", "ascii")
    unfinished.replace(path)


def read_key_file(path: Path, public_keys: Sequence[PublicKey]) -> tuple[ValidatedKey, ...]:
    """Return the keys of a key file in time order, each validated down to a root key that a public key signed.

    Parameters
    ----------
    path
        The file.
    public_keys
        Keys that the root keys may be signed with.

    Raises
    ------
    AuthenticationError
        If a root key's signature, a key or its chain does not verify.
    VestigeError
        If a root key is signed with another public key than those given.
    InputFileError
        If the file is not a key file, is cut off, or contradicts itself.
    UnsupportedError
        If a root key uses a part of the standard that vestige does not support.
    """
    lines = _lines(path)
    chains: list[Chain] = []
    number = 1
    while number < len(lines) and lines[number].startswith(_ROOT_PREFIX):
        root = _read_root(path, number + 1, lines[number], public_keys)
        if not any(chain.holds(root) for chain in chains):
            chains.append(Chain(root))
        number += 1
    if number >= len(lines) or tuple(lines[number].split(",")) != COLUMNS:
        found = lines[number] if number < len(lines) else "end of the file"
        raise InputFileError(path, f"line {number + 1}", found, f"{_ROOT_PREFIX}… or {','.join(COLUMNS)}")
    rows = [
        (place, *_read_row(path, place, line))
        for place, line in enumerate(lines[number + 1 :], start=number + 2)
        if line.strip(",")
    ]
    if not rows:
        raise InputFileError(path, f"line {number + 2}", "end of the file", "a key")
    keys: dict[GalileoTime, ValidatedKey] = {}
    for place, key, chain_id, disclosed_at in sorted(rows, key=lambda row: row[1].time):
        if key.time in keys:
            raise InputFileError(path, f"line {place}", f"a second key of {key.time}", "one key for each subframe")
        valid = _validated(path, place, key, [chain for chain in chains if chain.chain_id == chain_id])
        if valid.disclosed_at != disclosed_at:
            raise InputFileError(path, f"line {place}", f"disclosed at {disclosed_at}", str(valid.disclosed_at))
        keys[key.time] = valid
    return tuple(keys.values())


def read_raw_keys(path: Path) -> tuple[Key, ...]:
    """Return the keys of an `<OsnmaKeys>` XML file in its order; they prove nothing until they are validated.

    Raises
    ------
    InputFileError
        If the file is not of this kind.
    """
    try:
        document = ElementTree.fromstring(read_bytes(path, at_most=MAX_FILE_BYTES))
    except (ElementTree.ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise InputFileError(path, "document", str(error), "well-formed XML without entities") from None
    if document.tag != "OsnmaKeys":
        raise InputFileError(path, "root element", document.tag, "OsnmaKeys")
    keys = []
    for number, element in enumerate(document.findall("key"), start=1):
        data = (element.findtext("osnma_key") or "").strip()
        epoch = (element.findtext("epoch") or "").strip()
        if not re.fullmatch(r"([0-9A-Fa-f]{2}){12,32}", data):
            raise InputFileError(path, f"key {number}, osnma_key", data, "hexadecimal digits of 96 to 256 bits")
        if not re.fullmatch(r"[0-9]{1,11}", epoch) or int(epoch) % SUBFRAME_S:
            raise InputFileError(path, f"key {number}, epoch", epoch, "GST seconds of the start of a subframe")
        keys.append(Key(time=GalileoTime.from_gst_seconds(int(epoch)), data=bytes.fromhex(data)))
    return tuple(keys)


def _lines(path: Path) -> list[str]:
    try:
        text = read_bytes(path, at_most=MAX_FILE_BYTES).decode("ascii")
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"byte {error.start}", "not ASCII", "a key file") from None
    # Spreadsheets fill short lines up with commas.
    lines = [line.rstrip("\r").rstrip(",") for line in text.split("\n")]
    if lines[0] != FIRST_LINE:
        raise InputFileError(path, "line 1", lines[0], FIRST_LINE)
    if lines[-1]:
        raise InputFileError(path, f"line {len(lines)}", "no line end, so the file was cut off", "a whole line")
    return lines[:-1]


def _read_root(path: Path, number: int, line: str, public_keys: Sequence[PublicKey]) -> RootKey:
    match = re.fullmatch(r"([0-9]{1,5}),([0-9a-fA-F]{2}),((?:[0-9a-fA-F]{2})+)", line[len(_ROOT_PREFIX) :])
    if match is None:
        raise InputFileError(path, f"line {number}", line, f"{_ROOT_PREFIX}week,NMA header,DSM-KROOT")
    near = GalileoTime(_number(path, number, "week", match[1], _MAX_WEEK), 0)
    header = NmaHeader(int(match[2], 16))
    try:
        root = verify_root_key(parse_kroot(bytes.fromhex(match[3])), header, public_keys, near)
    except VestigeError as error:
        raise type(error)(f"{path}: line {number}: root key: {error}") from None
    if root.time.week != near.week:
        raise InputFileError(path, f"line {number}, week", near.week, root.time.week)
    return root


def _read_row(path: Path, number: int, line: str) -> tuple[Key, int, GalileoTime]:
    """Return key, chain and disclosure time of a line."""
    fields = line.split(",")
    if len(fields) != len(COLUMNS):
        raise InputFileError(path, f"line {number}", f"{len(fields)} fields", f"{len(COLUMNS)}: {','.join(COLUMNS)}")
    week, second, chain, data, disclosed_week, disclosed_second, _ = fields
    if not re.fullmatch(r"(?:[0-9A-Fa-f]{2})+", data):
        raise InputFileError(path, f"line {number}, key_hex", data, "hexadecimal digits")
    times = [
        GalileoTime(
            _number(path, number, f"{name}_week", w, _MAX_WEEK),
            _number(path, number, f"{name}_second", s, SECONDS_PER_WEEK),
        )
        for name, w, s in (("gst", week, second), ("disclosed", disclosed_week, disclosed_second))
    ]
    return Key(time=times[0], data=bytes.fromhex(data)), _number(path, number, "chain_id", chain, 4), times[1]


def _validated(path: Path, number: int, key: Key, chains: Sequence[Chain]) -> ValidatedKey:
    reason = f"key of {key.time}: the file has no root key of its chain"
    for chain in chains:
        try:
            return validate(key, chain)
        except AuthenticationError as error:
            reason = str(error)
    raise AuthenticationError(f"{path}: line {number}: {reason}")


def _number(path: Path, line: int, name: str, text: str, below: int) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text) or int(text) >= below:
        raise InputFileError(path, f"line {line}, {name}", text, f"a number below {below}")
    return int(text)
