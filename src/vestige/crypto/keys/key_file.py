"""Read and write files with TESLA keys.

The key file of an assistance folder is a CSV file that contains the proof of its keys. In addition to the keys, the
file has the signed DSM-KROOTs to which the keys lead, so a reader needs only the public key or the Merkle tree::

    # vestige OSNMA keys 2
    # public key,<DSM-PKR, hex>
    # root,<week>,<second>,<status>,<NMA header, hex>,<DSM-KROOT, hex>
    # alert,<week>,<second>
    gst_week,gst_second,chain_id,key_hex,disclosed_week,disclosed_second,gst
    1251,277200,3,be7801d2d4eb75a7e686054a18c58141,1251,277222,2023-08-16T05:00:00.000 GST

A key's time is the start of the subframe in which the key is sent. A key is disclosed when its first bit is on air. The
last column is for human readers. The reader verifies the signatures of the root keys, and the chain and the disclosure
time of every key.

If a root key is signed with a broadcast public key, the file has the DSM-PKR of this public key. To read a file with a
DSM-PKR, the reader needs the Merkle tree.

For each root key and alert message the file states the subframe of reception. The file also has root keys with the
status "don't use" or with a revocation. The reader refuses a file with a key that a root key or an alert message of the
file withdraws (`chain_register`). The file proves that the keys are genuine. The writer of a file can leave out root
keys that withdraw other keys, so the file does not prove that no key was withdrawn.

Files of version 1 lack the time of reception and the status of root keys. Files of version 1 are readable if none of
their root keys withdraws a chain.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vestige.constants import SECONDS_PER_WEEK
from vestige.crypto.file_bytes import read_bytes
from vestige.crypto.keys.merkle_tree import MerkleTree, verify_broadcast_key
from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.osnma.chain_register import ChainRegister
from vestige.crypto.osnma.messages.dsm import NMA_STATUS, NmaHeader, parse_kroot
from vestige.crypto.osnma.messages.root_key import RootKey, verify_root_key
from vestige.crypto.osnma.messages.tesla import Key, validate
from vestige.errors import AuthenticationError, InputFileError, VestigeError
from vestige.output import replacement
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

KEY_FILE_FIRST_LINE = "# vestige OSNMA keys 2"
FIRST_LINE_1 = "# vestige OSNMA keys 1"
KEY_COLUMNS = ("gst_week", "gst_second", "chain_id", "key_hex", "disclosed_week", "disclosed_second", "gst")
_MAX_FILE_BYTES = 100_000_000  # upper limit of the file size, which is enough for the keys of a year

_KEY_PREFIX, _ROOT_PREFIX, _ALERT_PREFIX = "# public key,", "# root,", "# alert,"
_ROOT_FIELDS = "week,second,status,NMA header,DSM-KROOT"
_ROOT_FIELDS_1 = "week,NMA header,DSM-KROOT"
_MAX_WEEK = 1 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyFile:
    """Content of a key file."""

    keys: tuple[ValidatedKey, ...]  # validated keys in time order
    roots: tuple[RootKey, ...]  # verified root keys in the order in which they were received
    alerts: tuple[GalileoTime, ...]  # first subframe with a verified alert message; empty without an alert


def write_key_file(
    path: Path, keys: Sequence[ValidatedKey], roots: Sequence[RootKey], alerts: Sequence[GalileoTime] = ()
) -> None:
    """Write validated keys, and the signed root keys to which the keys lead, into a key file.

    An existing file is replaced only when the new file is complete.

    `roots` are all verified root keys: the root keys of the keys' chains, and root keys that withdraw chains.
    """
    broadcast = dict.fromkeys(root.public_key.message for root in roots if root.public_key.message)
    lines = [KEY_FILE_FIRST_LINE, *(f"{_KEY_PREFIX}{message.hex()}" for message in broadcast)]
    for root in sorted(roots, key=lambda root: root.received_at):
        time, header = root.received_at, root.header
        lines.append(
            f"{_ROOT_PREFIX}{time.week},{time.second},{NMA_STATUS[header.status]},{header.value:02x},"
            f"{root.kroot.serialise().hex()}"
        )
    lines += [f"{_ALERT_PREFIX}{time.week},{time.second}" for time in sorted(alerts)]
    lines.append(",".join(KEY_COLUMNS))
    for key in sorted(keys, key=lambda key: key.time):
        disclosed = key.disclosed_at
        lines.append(
            f"{key.time.week},{key.time.second},{key.chain_id},{key.data.hex()},"
            f"{disclosed.week},{disclosed.second},{key.time}"
        )
    with replacement(path) as part:
        part.write_text("\n".join(lines) + "\n", "ascii")


def read_key_file(
    path: Path, public_keys: Sequence[PublicKey], tree: MerkleTree | None = None
) -> tuple[ValidatedKey, ...]:
    """Validate the keys of a key file, and return the keys in time order; see `load_key_file` for the errors."""
    return load_key_file(path, public_keys, tree).keys


def load_key_file(path: Path, public_keys: Sequence[PublicKey], tree: MerkleTree | None = None) -> KeyFile:
    """Validate each key of a key file down to a signed root key, and return the content of the file.

    Public keys that were broadcast are verified against the root of `tree`.

    The function raises `AuthenticationError` if a public key, a root key's signature, a key or its chain does not
    verify, or if a root key or an alert in the file withdraws a key. A broadcast public key does not verify without
    `tree`. The function raises `VestigeError` if a root key is signed with a public key that was not given. The
    function raises `InputFileError` if the file cannot be read, is not a key file, is cut off, or contradicts itself.
    The function raises `UnsupportedError` if a root key or a public key uses a part of the standard that vestige does
    not support.
    """
    lines = _lines(path)
    roots: list[tuple[int, RootKey]] = []
    alerts: list[GalileoTime] = []
    number = 1
    while number < len(lines) and lines[number].startswith(_KEY_PREFIX):
        public_keys = (*public_keys, _read_broadcast_key(path, number + 1, lines[number], public_keys, tree))
        number += 1
    while number < len(lines) and lines[number].startswith((_ROOT_PREFIX, _ALERT_PREFIX)):
        if lines[number].startswith(_ROOT_PREFIX):
            read = _read_root if lines[0] == KEY_FILE_FIRST_LINE else _read_root_1
            roots.append((number + 1, read(path, number + 1, lines[number], public_keys)))
        else:
            alerts.append(_read_alert(path, number + 1, lines[number]))
        number += 1
    register = ChainRegister()
    roots.sort(key=lambda root: root[1].received_at)
    for place, root in roots:
        try:
            register.add(root)
        except AuthenticationError as error:
            raise AuthenticationError(f"{path}: line {place}: root key: {error}") from None
    for time in alerts:
        register.add_alert(time)
    if number >= len(lines) or tuple(lines[number].split(",")) != KEY_COLUMNS:
        found = lines[number] if number < len(lines) else "end of the file"
        raise InputFileError(path, f"line {number + 1}", found, f"{_ROOT_PREFIX}… or {','.join(KEY_COLUMNS)}")
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
        valid = _validated(path, place, key, chain_id, register)
        if valid.disclosed_at != disclosed_at:
            raise InputFileError(path, f"line {place}", f"disclosed at {disclosed_at}", str(valid.disclosed_at))
        keys[key.time] = valid
    return KeyFile(keys=tuple(keys.values()), roots=tuple(root for _, root in roots), alerts=tuple(alerts))


def _lines(path: Path) -> list[str]:
    try:
        text = read_bytes(path, at_most=_MAX_FILE_BYTES).decode("ascii")
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"byte {error.start}", "not ASCII", "a key file") from None
    # Spreadsheets fill short lines with commas.
    lines = [line.rstrip("\r").rstrip(",") for line in text.split("\n")]
    if lines[0] not in (KEY_FILE_FIRST_LINE, FIRST_LINE_1):
        raise InputFileError(path, "line 1", lines[0], KEY_FILE_FIRST_LINE)
    if lines[-1]:
        raise InputFileError(path, f"line {len(lines)}", "no line end, so the file was cut off", "a whole line")
    return lines[:-1]


def _read_broadcast_key(
    path: Path, number: int, line: str, known: Sequence[PublicKey], tree: MerkleTree | None
) -> PublicKey:
    message = line[len(_KEY_PREFIX) :]
    if not re.fullmatch(r"(?:[0-9a-fA-F]{2})+", message):
        raise InputFileError(path, f"line {number}, public key", message, "a DSM-PKR in hexadecimal")
    if tree is None:
        raise AuthenticationError(
            f"{path}: line {number}: a public key that was broadcast; only the Merkle tree can verify it"
        )
    try:
        return verify_broadcast_key(bytes.fromhex(message), tree, known)
    except VestigeError as error:
        raise type(error)(f"{path}: line {number}: {error}") from None


def _read_root(path: Path, number: int, line: str, public_keys: Sequence[PublicKey]) -> RootKey:
    fields = line[len(_ROOT_PREFIX) :].split(",")
    if len(fields) != len(_ROOT_FIELDS.split(",")):
        raise InputFileError(path, f"line {number}", line, _ROOT_PREFIX + _ROOT_FIELDS)
    week, second, status, header, kroot = fields
    root = _verified(path, number, (header, kroot), public_keys, _time(path, number, week, second))
    expected = NMA_STATUS[root.header.status]
    if status != expected:
        raise InputFileError(path, f"line {number}, status", status, f"{expected}, as the signed NMA header says")
    return root


def _read_root_1(path: Path, number: int, line: str, public_keys: Sequence[PublicKey]) -> RootKey:
    fields = line[len(_ROOT_PREFIX) :].split(",")
    if len(fields) != len(_ROOT_FIELDS_1.split(",")):
        raise InputFileError(path, f"line {number}", line, _ROOT_PREFIX + _ROOT_FIELDS_1)
    week, header, kroot = fields
    near = _time(path, number, week, "0")
    root = _verified(path, number, (header, kroot), public_keys, near)
    if root.time.week != near.week:
        raise InputFileError(path, f"line {number}, week", near.week, root.time.week)
    if root.header.withdraws:
        raise InputFileError(
            path, f"line {number}", f"a root key of status {root.header}, without its time of reception",
            f"{KEY_FILE_FIRST_LINE!r}; write the file again with `vestige osnma verify`",
        )  # fmt: skip
    return root


def _verified(
    path: Path, number: int, fields: tuple[str, str], public_keys: Sequence[PublicKey], near: GalileoTime
) -> RootKey:
    header, kroot = fields
    if not re.fullmatch(r"[0-9a-fA-F]{2}", header) or not re.fullmatch(r"(?:[0-9a-fA-F]{2})+", kroot):
        raise InputFileError(path, f"line {number}", f"{header},{kroot}", "NMA header and DSM-KROOT in hexadecimal")
    try:
        return verify_root_key(parse_kroot(bytes.fromhex(kroot)), NmaHeader(int(header, 16)), public_keys, near)
    except VestigeError as error:
        raise type(error)(f"{path}: line {number}: root key: {error}") from None


def _read_alert(path: Path, number: int, line: str) -> GalileoTime:
    fields = line[len(_ALERT_PREFIX) :].split(",")
    if len(fields) != 2:
        raise InputFileError(path, f"line {number}", line, f"{_ALERT_PREFIX}week,second")
    return _time(path, number, *fields)


def _time(path: Path, number: int, week: str, second: str, name: str = "") -> GalileoTime:
    return GalileoTime(
        _number(path, number, f"{name}week", week, _MAX_WEEK),
        _number(path, number, f"{name}second", second, SECONDS_PER_WEEK),
    )


def _read_row(path: Path, number: int, line: str) -> tuple[Key, int, GalileoTime]:
    """Return the key of a line before its validation, the number of its chain, and its stated disclosure time."""
    fields = line.split(",")
    if len(fields) != len(KEY_COLUMNS):
        raise InputFileError(
            path, f"line {number}", f"{len(fields)} fields", f"{len(KEY_COLUMNS)}: {','.join(KEY_COLUMNS)}"
        )
    week, second, chain, data, disclosed_week, disclosed_second, _ = fields
    if not re.fullmatch(r"(?:[0-9A-Fa-f]{2})+", data):
        raise InputFileError(path, f"line {number}, key_hex", data, "hexadecimal digits")
    time = _time(path, number, week, second, "gst_")
    disclosed_at = _time(path, number, disclosed_week, disclosed_second, "disclosed_")
    return Key(time=time, data=bytes.fromhex(data)), _number(path, number, "chain_id", chain, 4), disclosed_at


def _validated(path: Path, number: int, key: Key, chain_id: int, register: ChainRegister) -> ValidatedKey:
    reason = f"key of {key.time}: the file has no root key of its chain"
    for chain in register.chains:
        if chain.chain_id == chain_id:
            try:
                valid = validate(key, chain)
            except AuthenticationError as error:
                reason = str(error)
                continue
            refusal = register.refusal(chain, key.time)
            if not refusal:
                return valid
            reason = f"key of {key.time}: {refusal}; leave out the keys from then on"
    raise AuthenticationError(f"{path}: line {number}: {reason}")


def _number(path: Path, line: int, name: str, text: str, below: int) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text) or int(text) >= below:
        raise InputFileError(path, f"line {line}, {name}", text, f"a number below {below}")
    return int(text)
