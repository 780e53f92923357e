"""Write the results of a campaign chunk by chunk into a zarr store, which stays usable after any interruption.

The store is a zarr v3 group with one array for each column. Each array has its full length from the beginning, and is
divided along `epoch` into the campaign's chunks. Each chunk therefore has its own files. The array `progress/digest`
has one number for each chunk: a 64-bit hash of the chunk's values, or 0 if the chunk is not finished. The hash is
written after the values.

A resumed run reads the values again and compares their hash with the stored hash. Chunks that do not agree with their
hash are computed again. A run may therefore end in any way, such as by `kill -9` between two files or by a power
failure that loses written data. A store may also be copied only in part. A new store is made in a temporary folder, and
the complete folder gets the path of the store. An interruption therefore leaves no incomplete new store at this path.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, cast

import numpy as np
import zarr

from vestige.campaign.plan import EPOCH, Plan
from vestige.campaign.store.build_id import build_id
from vestige.campaign.store.store_files import (
    EXPECTED_RESULTS,
    METADATA,
    arrays_of,
    check_array,
    check_chunk,
    check_files,
    check_small_array,
)
from vestige.campaign.store.store_skeleton import (
    CHUNK,
    COLUMN,
    COORD,
    DIGEST,
    PROGRESS,
    UNFINISHED,
    WORK,
    column_text,
    coord_text,
    identity,
    mended,
    store_schema,
    work_digest,
    write_skeleton,
)
from vestige.errors import InputFileError
from vestige.scenario.limits import MAX_EPOCHS

MENDS = "the same command repairs it"
_DIGITS = 10  # numbers of chunks have fewer digits than this value


@dataclass(frozen=True, slots=True, kw_only=True)
class Store:
    """An open store of campaign results; `open_store` and `open_existing` return objects of this class."""

    path: Path
    attrs: Mapping[str, Any]  # attributes that identify the plan, the build, and the schema of the arrays
    columns: Mapping[str, zarr.Array[Any]]  # arrays with an axis `epoch`, by name
    digests: zarr.Array[Any]  # 64-bit hash of each chunk; `UNFINISHED` if the chunk is not finished
    n_epochs: int
    # number of epochs in a chunk, fixed when the store was made; the last chunk may have fewer epochs
    chunk_epochs: int

    @property
    def n_chunks(self) -> int:
        """Number of chunks into which the epochs are divided."""
        return -(-self.n_epochs // self.chunk_epochs)

    def epochs(self, chunk: int) -> range:
        """Return the numbers of the epochs in a chunk."""
        first = chunk * self.chunk_epochs
        return range(first, min(first + self.chunk_epochs, self.n_epochs))

    def write(self, chunk: int, results: Mapping[str, np.ndarray]) -> None:
        """Write the columns of a chunk, and then record the chunk as finished."""
        for name, array in self.columns.items():
            array[self._region(array, chunk)] = results[name]
        self.digests[chunk] = _digest(results)

    def read(self, chunk: int) -> dict[str, np.ndarray]:
        """Return the columns of a chunk."""
        return {name: np.asarray(array[self._region(array, chunk)]) for name, array in self.columns.items()}

    def finished(self, *, verify: bool) -> frozenset[int]:
        """Return the numbers of the finished chunks; with `verify`, only of chunks that agree with their hash."""
        digests = {chunk: self._recorded(chunk) for chunk in self._touched()}
        recorded = [chunk for chunk, digest in digests.items() if digest != UNFINISHED]
        return frozenset(chunk for chunk in recorded if not verify or self._holds(chunk, digests[chunk]))

    def _touched(self) -> list[int]:
        """Return the numbers of the chunks with a file in `progress/digest`; chunks without a file are not finished."""
        names = (path.name for path in (self.path / PROGRESS / DIGEST / "c").glob("*"))
        numbers = (int(name) for name in names if name.isascii() and name.isdecimal() and len(name) < _DIGITS)
        return sorted(number for number in numbers if number < self.n_chunks)

    def _recorded(self, chunk: int) -> int:
        try:
            check_chunk(self.path, f"{PROGRESS}/{DIGEST}", self.digests, (chunk,))
            return int(np.asarray(self.digests[chunk]))
        except Exception:  # A damaged file may raise any error. The chunk of the file counts as not finished.
            return UNFINISHED

    def _holds(self, chunk: int, digest: int) -> bool:
        try:
            for name, array in self.columns.items():
                check_chunk(self.path, name, array, tuple(chunk if dim == EPOCH else 0 for dim in _dims(array)))
            return _digest(self.read(chunk)) == digest
        except Exception:  # A damaged file may raise any error. The chunk of the file counts as damaged.
            return False

    def _region(self, array: zarr.Array[Any], chunk: int) -> tuple[slice, ...]:
        epochs = self.epochs(chunk)
        return tuple(slice(epochs.start, epochs.stop) if dim == EPOCH else slice(None) for dim in _dims(array))


def make_store(path: Path, plan: Plan, *, chunk_epochs: int) -> None:
    """Make the store of a plan, without values, if the path does not exist or is an empty folder."""
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        return
    if plan.n_epochs < 1 or chunk_epochs < 1:
        raise ValueError(f"{plan.n_epochs} epochs in chunks of {chunk_epochs}: both must be at least 1")
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        private = TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        error.filename = str(path)  # the error names the path that the user has given
        raise
    with private as folder:
        write_skeleton(Path(folder) / "store", plan, min(chunk_epochs, plan.n_epochs))
        try:
            (Path(folder) / "store").rename(path)
        except OSError:
            if not (path / METADATA).exists():  # the metadata exist if another process has made the store first
                raise


def open_store(path: Path | str, plan: Plan, *, chunk_epochs: int) -> Store:
    """Open the store of a plan, or make the store if it does not exist, and return the store.

    Damaged metadata and coordinates are written again. The caller must be the only process that writes into the store
    (`only_writer`).

    Missing parent folders are made. An existing store keeps its own `chunk_epochs`.

    The function raises `InputFileError` if `path` is no store, is damaged beyond repair, or is the store of another
    plan or another build (`build_id`).
    """
    path = Path(path)
    make_store(path, plan, chunk_epochs=chunk_epochs)
    check_files(path)
    try:
        store = open_existing(path, mode="r+")
    except InputFileError:
        if not mended(path, plan):
            raise
        store = open_existing(path, mode="r+")
    _check_identity(store, plan)
    return store


def kept_chunk_epochs(path: Path | str, wanted: int) -> int | None:
    """Return the number of epochs in a chunk of an existing store, if this number differs from `wanted`.

    A number `wanted` above the number of all epochs means a single chunk. The result is None if the numbers agree,
    there is no store, or the store is damaged.
    """
    try:
        store = open_existing(Path(path), mode="r")
    except InputFileError:
        return None
    return None if store.chunk_epochs == min(wanted, store.n_epochs) else store.chunk_epochs


def open_existing(path: Path, *, mode: Literal["r", "r+"]) -> Store:
    """Return the existing store in a folder; the store may belong to any plan.

    The function raises `InputFileError` if the folder is no store, or if metadata or coordinates of the store are
    damaged.
    """
    check_files(path)
    try:
        group = zarr.open_group(path, mode=mode, zarr_format=3)
        if PROGRESS not in group:
            raise InputFileError(path, "store", "no results of a campaign", EXPECTED_RESULTS)
        own: dict[str, Any] = group[PROGRESS].attrs.asdict()
        attributes = group.attrs.asdict()
        if own.pop(WORK, work := work_digest(attributes)) != work:
            raise ValueError("attributes differ from the attributes with which the store was made")
        arrays = arrays_of(path, group)
        store = Store(
            path=path,
            attrs={**attributes, **own},
            columns={name: array for name, array in arrays.items() if EPOCH in _dims(array)},
            digests=cast("zarr.Array[Any]", group[f"{PROGRESS}/{DIGEST}"]),
            n_epochs=int(own["n_epochs"]),
            chunk_epochs=int(own[CHUNK]),
        )
        _check_sizes(store)
        columns = {COLUMN + name: column_text(a.dtype, _dims(a), a.shape) for name, a in store.columns.items()}
        labels = {name: array for name, array in arrays.items() if name not in store.columns}
        for name, array in labels.items():
            check_small_array(path, name, array)
        coords = {COORD + name: coord_text(_dims(a)[0], a[:]) for name, a in labels.items()}
        if {"n_epochs": store.n_epochs, CHUNK: store.chunk_epochs, **columns, **coords} != own:
            raise ValueError("arrays differ from the arrays with which the store was made")
    except InputFileError:
        raise
    except zarr.errors.GroupNotFoundError as error:
        raise InputFileError(path, "store", "no zarr store", EXPECTED_RESULTS) from error
    except Exception as error:  # damaged metadata may raise any error
        raise InputFileError(
            path, "store", f"{type(error).__name__}: {error}", f"{EXPECTED_RESULTS}; {MENDS}"
        ) from error
    return store


def _check_sizes(store: Store) -> None:
    """Raise `ValueError` if the metadata of a store give sizes or codecs that a campaign does not write."""
    if not 1 <= store.chunk_epochs <= store.n_epochs <= MAX_EPOCHS:
        raise ValueError(f"{store.n_epochs} epochs in chunks of {store.chunk_epochs}, expected at most {MAX_EPOCHS}")
    if store.digests.shape != (store.n_chunks,) or store.digests.chunks != (1,):
        raise ValueError("the number of chunks differs from the number with which the store was made")
    check_array(DIGEST, store.digests)
    for name, array in store.columns.items():
        check_array(name, array)
        of_one = tuple(
            store.chunk_epochs if dim == EPOCH else length
            for dim, length in zip(_dims(array), array.shape, strict=True)
        )
        if array.chunks != of_one:
            raise ValueError(f"{name}: chunks of {array.chunks}, expected {of_one}")


def _check_identity(store: Store, plan: Plan) -> None:
    found = {name: value for name, value in store.attrs.items() if name not in (CHUNK, WORK)}
    expected = {**identity(plan), **store_schema(plan)}
    # The shortest attribute is compared first, because an error about the seed is clearer than the text of a scenario.
    for name in sorted(expected | found, key=lambda name: (len(str(expected.get(name))), name)):
        if found.get(name) != expected.get(name):
            advice = (
                f"; finish with the {name} that made the store, or write a new store"
                if name in build_id(plan)
                else ", as in this run"
            )
            raise InputFileError(
                store.path, name, found.get(name, "nothing"), f"{expected.get(name, 'nothing')}{advice}"
            )


def _dims(array: zarr.Array[Any]) -> tuple[str | None, ...]:
    return tuple(array.metadata.dimension_names or ())  # type: ignore[union-attr]


def _digest(results: Mapping[str, np.ndarray]) -> int:
    """Return a 64-bit hash of the names and values of columns; the hash is never equal to `UNFINISHED`."""
    digest = hashlib.blake2b(digest_size=8)
    for name in sorted(results):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(results[name]).data)
    return int.from_bytes(digest.digest(), "little") | 1
