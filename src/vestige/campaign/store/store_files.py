"""Validation of a store's files before any value is read: regular files of the size that a campaign writes.

A store may come from anywhere. So its metadata decide nothing alone: an array is read only if what it claims to hold
is what a campaign writes, and a compressed chunk only if it unpacks to the size of its values.
"""

from __future__ import annotations

import math
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from vestige.errors import InputFileError

EXPECTED_RESULTS = "the results of a campaign (zarr v3, written by vestige)"
METADATA = "zarr.json"
MAX_METADATA_BYTES = 1 << 24  # scenario and ephemerides stand there: some 100 kB
MAX_CHUNK_BYTES = 1 << 30  # size of one column; 2000 epochs of 36 satellites and 63 taps have 36 MB
# size of a coordinate (satellites, taps, reflections, detectors) or of one number of a chunk
MAX_LABELS_BYTES = 1 << 20
_CODECS = {"bytes", "vlen-utf8", "zstd"}  # those that are written
_FRAME = b"\x28\xb5\x2f\xfd"  # magic number of zstd [RFC8878]
_LONGEST_FRAME_HEADER = 18


def check_files(folder: Path, expected: str = EXPECTED_RESULTS) -> None:
    """Return nothing if a store has regular files and folders only, and none of its metadata is too long.

    Opening a pipe would wait for ever, and a link may lead anywhere.

    Raises `InputFileError` if it is not so; with the file.
    """
    if not folder.is_dir():
        raise InputFileError(folder, "store", "a file" if folder.exists() else "nothing", expected)
    for place, folders, names in os.walk(folder, onerror=_unreadable):
        for name in (*folders, *names):
            path = Path(place, name)
            found = path.lstat()
            if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
                kind = {stat.S_IFLNK: "a link", stat.S_IFIFO: "a pipe"}.get(stat.S_IFMT(found.st_mode), "a device")
                raise InputFileError(path, "file", kind, "a regular file, as every file of a store is")
            if name == METADATA and found.st_size > MAX_METADATA_BYTES:
                raise InputFileError(path, "length", f"{found.st_size} bytes", f"at most {MAX_METADATA_BYTES} bytes")


def _unreadable(error: OSError) -> None:
    raise error


def arrays_of(folder: Path, group: zarr.Group) -> dict[str, zarr.Array[Any]]:
    """Return the arrays in the root of a store by name, opened one by one.

    `group.arrays()` opens them at once, and after a damaged one Python complains about the others when it ends.

    Raises `ValueError` if the metadata of one are damaged; with its name.
    """
    names = sorted(path.parent.name for path in folder.glob(f"*/{METADATA}"))
    arrays = {}
    for name in names:
        try:
            member = group[name]
        except Exception as error:  # damaged metadata raise anything
            raise ValueError(f"{name}/{METADATA}: {error}") from error
        if isinstance(member, zarr.Array):
            arrays[name] = member
    return arrays


def check_array(name: str, array: zarr.Array[Any], *, at_most: int = MAX_CHUNK_BYTES) -> None:
    """Return nothing if an array is packed as a campaign packs it, and a chunk of it has at most so many bytes.

    Raises `ValueError` if it is not so.
    """
    codecs = {str(codec.to_dict()["name"]) for codec in array.metadata.codecs}  # type: ignore[union-attr]
    if not codecs <= _CODECS:
        raise ValueError(f"{name}: packed with {', '.join(sorted(codecs))}")
    if (size := _values_bytes(array, array.chunks)) > at_most:
        raise ValueError(f"{name}: {size} bytes in a chunk, at most {at_most} bytes are written")


def check_small_array(folder: Path, name: str, array: zarr.Array[Any]) -> None:
    """Return nothing if an array of labels, or of a table, may be read as a whole; else raise ValueError."""
    check_array(name, array, at_most=MAX_LABELS_BYTES)
    if (size := _values_bytes(array, array.shape)) > MAX_LABELS_BYTES:
        raise ValueError(f"{name}: {size} bytes, at most {MAX_LABELS_BYTES} bytes are written")
    for index in np.ndindex(*(-(-length // of_one) for length, of_one in zip(array.shape, array.chunks, strict=True))):
        check_chunk(folder, name, array, index)


def check_chunk(folder: Path, name: str, array: zarr.Array[Any], index: tuple[int, ...]) -> None:
    """Return nothing if the file of a chunk is not there, or unpacks to the size of the chunk's values.

    Raises `ValueError` if it unpacks to another size, or does not say to which.
    """
    path = folder.joinpath(name, "c", *map(str, index))
    try:
        with path.open("rb") as file:
            head, length = file.read(_LONGEST_FRAME_HEADER), os.fstat(file.fileno()).st_size
    except FileNotFoundError:
        return  # zarr has its fill value there, and the hash says whether that was meant
    text = _is_text(array)
    expected = MAX_LABELS_BYTES if text else _values_bytes(array, array.chunks)
    unpacked = _unpacked_bytes(head)
    fits = unpacked is not None and (unpacked <= expected if text else unpacked == expected)
    if not fits or length > 2 * expected + 1024:
        raise ValueError(f"{name}: {length} bytes that unpack to {unpacked}, expected {expected}")


def _values_bytes(array: zarr.Array[Any], shape: tuple[int, ...]) -> int:
    return math.prod(shape) * (16 if _is_text(array) else np.dtype(array.dtype).itemsize)


def _is_text(array: zarr.Array[Any]) -> bool:
    return np.dtype(array.dtype).kind in "TOU"


def _unpacked_bytes(head: bytes) -> int | None:
    """Return to how many bytes a zstd frame says that it unpacks; None if it does not say so or is none."""
    if len(head) < 6 or not head.startswith(_FRAME):
        return None
    flags = head[4]
    single, length = bool(flags & 0x20), (1, 2, 4, 8)[flags >> 6]
    if flags >> 6 == 0 and not single:
        return None
    first = 5 + (not single) + (0, 1, 2, 4)[flags & 3]
    field = head[first : first + length]
    return None if len(field) < length else int.from_bytes(field, "little") + 256 * (length == 2)
