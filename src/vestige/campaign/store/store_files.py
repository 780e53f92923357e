"""Check the files of a store before values are read: only regular files, with the sizes that a campaign writes.

A store may come from an unknown source, so its metadata are not trusted. An array is read only if a campaign would
write the same sizes and codecs. A chunk of numbers is read only if the unpacked size that the chunk states is the size
of its values.
"""

from __future__ import annotations

import json
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
ZARR_FORMAT = 3
MAX_METADATA_BYTES = 1 << 24  # upper limit; metadata with scenario and ephemerides have about 100 kB
MAX_CHUNK_BYTES = 1 << 30  # upper limit; 2000 epochs of 36 satellites and 63 correlators have 36 MB
# largest size of a coordinate (satellites, correlators, reflections, detectors) or of an array of a small table
MAX_LABELS_BYTES = 1 << 20
_CODECS = {"bytes", "vlen-utf8", "zstd"}  # codecs of stores that vestige writes
_FRAME = b"\x28\xb5\x2f\xfd"  # magic number of zstd [RFC8878]
_LONGEST_FRAME_HEADER = 18


def check_files(folder: Path, expected: str = EXPECTED_RESULTS) -> None:
    """Check that a store has only regular files and folders, and that no metadata file is too long.

    A pipe would block the program without end when the pipe is opened. A link may lead to any other file.

    The function raises `InputFileError` if `folder` is no folder, or with the path of the first wrong file.
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
    """Return the arrays in the root of a store by name; the metadata of each array are read separately.

    This function uses neither `group.arrays()` nor `group[name]` of zarr. `group.arrays()` opens all arrays at once. If
    one array is damaged, Python therefore prints warnings about all other arrays when Python exits. `group[name]` takes
    three times as long as this function.

    The function raises `ValueError` with the name of the array if its metadata are damaged.
    """
    names = sorted(path.parent.name for path in folder.glob(f"*/{METADATA}"))
    arrays = {}
    for name in names:
        try:
            content = json.loads((folder / name / METADATA).read_bytes())
            if content["zarr_format"] != ZARR_FORMAT:
                raise ValueError(f"found zarr_format {content['zarr_format']}, expected {ZARR_FORMAT}")
            if content["node_type"] != "group":
                arrays[name] = zarr.Array.from_dict(group.store_path / name, content)
        except Exception as error:  # damaged metadata may raise any error
            raise ValueError(f"{name}/{METADATA}: {error}") from error
    return arrays


def check_array(name: str, array: zarr.Array[Any], *, at_most: int = MAX_CHUNK_BYTES) -> None:
    """Check that an array has only codecs that vestige writes, and that a chunk has at most `at_most` bytes.

    The function raises `ValueError` if the array has another codec or larger chunks.
    """
    codecs = {str(codec.to_dict()["name"]) for codec in array.metadata.codecs}  # type: ignore[union-attr]
    if not codecs <= _CODECS:
        raise ValueError(f"{name}: codecs: found {', '.join(sorted(codecs))}, expected {', '.join(sorted(_CODECS))}")
    if (size := _values_bytes(array, array.chunks)) > at_most:
        raise ValueError(f"{name}: found {size} bytes in a chunk, expected at most {at_most} bytes")


def check_small_array(folder: Path, name: str, array: zarr.Array[Any]) -> None:
    """Raise `ValueError` if an array of coordinates or of a table is too large, or has wrong codecs or chunks."""
    check_array(name, array, at_most=MAX_LABELS_BYTES)
    if (size := _values_bytes(array, array.shape)) > MAX_LABELS_BYTES:
        raise ValueError(f"{name}: found {size} bytes, expected at most {MAX_LABELS_BYTES} bytes")
    for index in np.ndindex(*(-(-length // of_one) for length, of_one in zip(array.shape, array.chunks, strict=True))):
        check_chunk(folder, name, array, index)


def check_chunk(folder: Path, name: str, array: zarr.Array[Any], index: tuple[int, ...]) -> None:
    """Check that the file of a chunk is missing, or that its unpacked size is the size of the chunk's values.

    The size of texts is not known beforehand, so texts may have any size up to `MAX_LABELS_BYTES`. The function raises
    `ValueError` if the file has another unpacked size, does not state its unpacked size, or is much too long.
    """
    path = folder.joinpath(name, "c", *map(str, index))
    try:
        with path.open("rb") as file:
            head, length = file.read(_LONGEST_FRAME_HEADER), os.fstat(file.fileno()).st_size
    except FileNotFoundError:
        return  # zarr gives the fill value for a missing file, and the hash shows whether the file was ever written
    text = _is_text(array)
    expected = MAX_LABELS_BYTES if text else _values_bytes(array, array.chunks)
    unpacked = _unpacked_bytes(head)
    fits = unpacked is not None and (unpacked <= expected if text else unpacked == expected)
    if not fits or length > 2 * expected + 1024:
        raise ValueError(f"{name}: found {length} bytes that unpack to {unpacked}, expected {expected}")


def _values_bytes(array: zarr.Array[Any], shape: tuple[int, ...]) -> int:
    return math.prod(shape) * (16 if _is_text(array) else np.dtype(array.dtype).itemsize)


def _is_text(array: zarr.Array[Any]) -> bool:
    return np.dtype(array.dtype).kind in "TOU"


def _unpacked_bytes(head: bytes) -> int | None:
    """Return the unpacked size in bytes that a zstd frame states; None if `head` is no frame or states no size."""
    if len(head) < 6 or not head.startswith(_FRAME):
        return None
    flags = head[4]
    single, length = bool(flags & 0x20), (1, 2, 4, 8)[flags >> 6]
    if flags >> 6 == 0 and not single:
        return None
    first = 5 + (not single) + (0, 1, 2, 4)[flags & 3]
    field = head[first : first + length]
    return None if len(field) < length else int.from_bytes(field, "little") + 256 * (length == 2)
