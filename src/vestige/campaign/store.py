"""The results of a campaign on disk: one zarr store, written chunk by chunk, that any interruption leaves usable.

The store is a zarr v3 group with one array for each column, full length from the beginning and cut along `epoch` into
the campaign's chunks, so that a chunk is a set of files of its own. A finished chunk is recorded in `progress/digest`,
an array with one number for each chunk: a 64-bit hash of the chunk's values, written after them; 0 is not finished.
On resuming, the values are read again and hashed. So it does not matter how a run ended (`kill -9` between two files,
a power failure that lost what had been written, a store that was copied in part): what does not agree with its hash is
computed again. A new store is made beside its place and renamed, so a store is there as a whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np
import xarray
import zarr

from vestige.campaign.origin import origin
from vestige.campaign.plan import EPOCH, Plan, shape_of
from vestige.errors import InputFileError

PROGRESS = "progress"  # a group of its own: xarray shows the arrays of the root only
DIGEST = "digest"
CHUNK = "chunk_epochs"
_COLUMN, _COORD = "column ", "coordinate "
EXPECTED = "the results of a campaign (zarr v3, written by vestige)"
UNFINISHED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Store:
    """An open store; `open_store` makes it.

    Attributes
    ----------
    attrs
        What the store says of the work whose results it holds.
    columns
        The arrays with an axis `epoch`.
    digests
        One hash for each chunk.
    chunk_epochs
        Epochs in a chunk (the last one may have fewer), fixed when the store was made.
    """

    path: Path
    attrs: Mapping[str, Any]
    columns: Mapping[str, zarr.Array[Any]]
    digests: zarr.Array[Any]
    n_epochs: int
    chunk_epochs: int

    @property
    def n_chunks(self) -> int:
        """How many chunks the epochs are cut into."""
        return -(-self.n_epochs // self.chunk_epochs)

    def epochs(self, chunk: int) -> range:
        """Return the epochs of a chunk."""
        first = chunk * self.chunk_epochs
        return range(first, min(first + self.chunk_epochs, self.n_epochs))

    def write(self, chunk: int, results: Mapping[str, np.ndarray]) -> None:
        """Write the columns of a chunk, then record it as finished."""
        for name, array in self.columns.items():
            array[self._region(array, chunk)] = results[name]
        self.digests[chunk] = _digest(results)

    def read(self, chunk: int) -> dict[str, np.ndarray]:
        """Return the columns of a chunk."""
        return {name: np.asarray(array[self._region(array, chunk)]) for name, array in self.columns.items()}

    def finished(self, *, verify: bool) -> frozenset[int]:
        """Return the chunks that are recorded as finished; with `verify` only those whose values agree with it."""
        digests = [self._recorded(chunk) for chunk in range(self.n_chunks)]
        recorded = [chunk for chunk, digest in enumerate(digests) if digest != UNFINISHED]
        return frozenset(chunk for chunk in recorded if not verify or self._holds(chunk, digests[chunk]))

    def _recorded(self, chunk: int) -> int:
        try:
            return int(np.asarray(self.digests[chunk]))
        except Exception:  # a torn file raises anything, and all of it means: not recorded
            return UNFINISHED

    def _holds(self, chunk: int, digest: int) -> bool:
        try:
            return _digest(self.read(chunk)) == digest
        except Exception:  # as above
            return False

    def _region(self, array: zarr.Array[Any], chunk: int) -> tuple[slice, ...]:
        epochs = self.epochs(chunk)
        return tuple(slice(epochs.start, epochs.stop) if dim == EPOCH else slice(None) for dim in _dims(array))


def open_store(path: Path | str, plan: Plan, *, chunk_epochs: int) -> Store:
    """Return the store of a plan: a new one, or the one that is there, if it is of the same work.

    Parameters
    ----------
    path
        A folder; those above it are made.
    chunk_epochs
        Epochs in a chunk of a new store. A store that is there keeps its own.

    Raises
    ------
    InputFileError
        If `path` is something else, or the store of another scenario, seed or source of vestige.
    """
    path = Path(path)
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        _create(path, plan, chunk_epochs)
    store = _open(path, mode="r+")
    _check_identity(store, plan)
    return store


def kept_chunk_epochs(path: Path | str, wanted: int) -> int | None:
    """Return the epochs in a chunk of a store that is there already, if they are others than wanted."""
    if not (Path(path) / "zarr.json").exists():
        return None
    store = _open(Path(path), mode="r")
    return None if store.chunk_epochs == min(wanted, store.n_epochs) else store.chunk_epochs


def open_results(path: Path | str, *, partial: bool = False, verify: bool = True) -> xarray.Dataset:
    """Return the results of a campaign; values are read from disk when they are used.

    Parameters
    ----------
    partial
        Whether a campaign that has not ended is accepted. Then the dataset holds the finished epochs only, and its
        coordinate `epoch` says which ones they are.
    verify
        Whether all values are read once and compared with their hashes; a million epochs take some seconds.

    Raises
    ------
    InputFileError
        If there is no such store, it is damaged, or the campaign has not ended and `partial` is not set.
    """
    store = _open(Path(path), mode="r")
    recorded = store.finished(verify=False)
    finished = store.finished(verify=True) if verify else recorded
    if damaged := recorded - finished:
        place = f"epoch {store.epochs(min(damaged)).start}"
        raise InputFileError(path, place, "values that do not agree with their hash", "the values that were written")
    if len(finished) < store.n_chunks and not partial:
        found = f"{sum(len(store.epochs(chunk)) for chunk in finished)} epochs"
        raise InputFileError(path, "results", found, f"{store.n_epochs} epochs (the same run again finishes it)")
    try:  # nothing for dask, no consolidated metadata (they are no part of zarr v3), and a unit `s` stays a number
        results = xarray.open_dataset(
            path, engine="zarr", chunks=None, consolidated=False, decode_times=False, decode_timedelta=False
        )
    except Exception as error:
        raise _no_store(Path(path), error) from error
    if len(finished) == store.n_chunks:
        return results
    kept = np.concatenate([np.array(store.epochs(chunk), dtype=np.int64) for chunk in sorted(finished)] or [_NO_EPOCHS])
    return results.isel({EPOCH: kept}).assign_coords({EPOCH: kept})


_NO_EPOCHS = np.zeros(0, dtype=np.int64)


def _create(path: Path, plan: Plan, chunk_epochs: int) -> None:
    if plan.n_epochs < 1 or chunk_epochs < 1:
        raise ValueError(f"{plan.n_epochs} epochs in chunks of {chunk_epochs}: both must be at least 1")
    chunk_epochs = min(chunk_epochs, plan.n_epochs)
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        private = TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        error.filename = str(path)  # the name that the user knows
        raise
    with private as folder:
        group = zarr.create_group(Path(folder) / "store", zarr_format=3, attributes=_identity(plan))
        for name, coord in plan.coords.items():
            values = np.asarray(coord.values)
            group.create_array(
                name,
                data=values.astype(np.dtypes.StringDType()) if values.dtype.kind == "U" else values,
                dimension_names=(coord.dim,),
                attributes={"units": coord.units, "long_name": coord.long_name},
            )
        for name, column in plan.columns.items():
            group.create_array(
                name,
                shape=shape_of(plan, column, plan.n_epochs),
                chunks=shape_of(plan, column, chunk_epochs),
                dtype=column.dtype,
                dimension_names=column.dims,
                attributes=_json(
                    {
                        "units": column.units,
                        "long_name": column.long_name,
                        "coordinates": " ".join(n for n, coord in plan.coords.items() if coord.dim in column.dims),
                        **column.attrs,
                    }
                ),
            )
        progress = group.create_group(PROGRESS, attributes={**_schema(plan), CHUNK: chunk_epochs})
        n_chunks = -(-plan.n_epochs // chunk_epochs)
        progress.create_array(DIGEST, shape=(n_chunks,), chunks=(1,), dtype="uint64", fill_value=UNFINISHED)
        (Path(folder) / "store").rename(path)


def _open(path: Path, *, mode: Any) -> Store:
    if not path.exists():
        raise InputFileError(path, "store", "nothing", EXPECTED)
    try:
        group = zarr.open_group(path, mode=mode, zarr_format=3)
        if PROGRESS not in group:
            raise InputFileError(path, "store", "no results of a campaign", EXPECTED)
        own: dict[str, Any] = group[PROGRESS].attrs.asdict()
        store = Store(
            path=path,
            attrs={**group.attrs.asdict(), **own},
            columns={name: array for name, array in group.arrays() if EPOCH in _dims(array)},
            digests=cast("zarr.Array[Any]", group[f"{PROGRESS}/{DIGEST}"]),
            n_epochs=int(own["n_epochs"]),
            chunk_epochs=int(own[CHUNK]),
        )
        columns = {_COLUMN + name: _column_text(a.dtype, _dims(a), a.shape) for name, a in store.columns.items()}
        coords = {_COORD + name: _coord_text(_dims(a)[0], a[:]) for name, a in group.arrays() if EPOCH not in _dims(a)}
        if {"n_epochs": store.n_epochs, CHUNK: store.chunk_epochs, **columns, **coords} != own:
            raise ValueError("arrays that are not those with which the store was made")
        if store.digests.shape != (store.n_chunks,):
            raise ValueError("another number of chunks than that with which the store was made")
    except InputFileError:
        raise
    except zarr.errors.GroupNotFoundError as error:
        raise InputFileError(path, "store", "no zarr store", EXPECTED) from error
    except Exception as error:  # damaged metadata raise anything
        raise _no_store(path, error) from error
    return store


def _no_store(path: Path, error: Exception) -> InputFileError:
    return InputFileError(path, "store", f"{type(error).__name__}: {error}", EXPECTED)


def _identity(plan: Plan) -> dict[str, Any]:
    """Return what must be equal in two runs with equal results, as JSON knows it."""
    return {**_json(plan.attrs), **origin(plan)}


def _schema(plan: Plan) -> dict[str, Any]:
    """Return what the arrays of a store must be, as text."""
    columns = {
        _COLUMN + name: _column_text(column.dtype, column.dims, shape_of(plan, column, plan.n_epochs))
        for name, column in plan.columns.items()
    }
    coords = {_COORD + name: _coord_text(coord.dim, coord.values) for name, coord in plan.coords.items()}
    return {"n_epochs": plan.n_epochs, **columns, **coords}


def _column_text(dtype: object, dims: tuple[str | None, ...], shape: tuple[int, ...]) -> str:
    return f"{dtype} " + ", ".join(f"{dim} {length}" for dim, length in zip(dims, shape, strict=True))


def _coord_text(dim: str | None, values: Any) -> str:
    return f"{dim} {np.asarray(values).tolist()}"


def _check_identity(store: Store, plan: Plan) -> None:
    found = {name: value for name, value in store.attrs.items() if name != CHUNK}
    expected = {**_identity(plan), **_schema(plan)}
    # The shortest first: that the seed differs says more than the text of the scenario in which it stands.
    for name in sorted(expected | found, key=lambda name: (len(str(expected.get(name))), name)):
        if found.get(name) != expected.get(name):
            advice = "; finish with the one that made it or begin anew" if name in origin(plan) else ", as in this run"
            raise InputFileError(
                store.path, name, found.get(name, "nothing"), f"{expected.get(name, 'nothing')}{advice}"
            )


def _json(values: Mapping[str, Any]) -> dict[str, Any]:
    return json.loads(json.dumps(dict(values), allow_nan=False))


def _dims(array: zarr.Array[Any]) -> tuple[str | None, ...]:
    return tuple(array.metadata.dimension_names or ())  # type: ignore[union-attr]


def _digest(results: Mapping[str, np.ndarray]) -> int:
    """Return a 64-bit hash of names and values, never `UNFINISHED`."""
    digest = hashlib.blake2b(digest_size=8)
    for name in sorted(results):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(results[name]).data)
    return int.from_bytes(digest.digest(), "little") | 1
