"""Write a store without values: metadata and coordinates that follow from a plan.

The same plan gives the same bytes. Metadata that were damaged on the disk or lost in a copy can therefore be written
again, and the values of the store are kept. The metadata are written again only if the attributes of the store, or
their digest, show that the store belongs to the plan.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import zarr
from zarr.core.buffer import Buffer
from zarr.storage import MemoryStore

from vestige.campaign.plan import EPOCH, Plan, shape_of
from vestige.campaign.store.build_id import build_id
from vestige.campaign.store.store_files import MAX_CHUNK_BYTES, METADATA
from vestige.errors import VestigeError

# name of a separate group, which the user does not see, because xarray shows only arrays of the root
PROGRESS = "progress"
DIGEST = "digest"
CHUNK = "chunk_epochs"
WORK = "work"  # digest of the attributes that identify plan and build
UNFINISHED = 0
COLUMN, COORD = "column ", "coordinate "


def identity(plan: Plan) -> dict[str, Any]:
    """Return the attributes that identify plan and build, as JSON types; equal attributes mean equal results."""
    return {**_json(plan.attrs), **build_id(plan)}


def work_digest(attributes: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the attributes that identify plan and build of a store, in hexadecimal digits."""
    return hashlib.sha256(json.dumps(dict(attributes), sort_keys=True).encode()).hexdigest()


def store_schema(plan: Plan) -> dict[str, Any]:
    """Return the required type, axes and coordinates of the arrays of a store as text, and the number of epochs."""
    columns = {
        COLUMN + name: column_text(column.dtype, column.dims, shape_of(plan, column, plan.n_epochs))
        for name, column in plan.columns.items()
    }
    coords = {COORD + name: coord_text(coord.dim, coord.values) for name, coord in plan.coords.items()}
    return {"n_epochs": plan.n_epochs, **columns, **coords}


def column_text(dtype: object, dims: tuple[str | None, ...], shape: tuple[int, ...]) -> str:
    """Return the type of a column, and its axes with their lengths, as text."""
    return f"{dtype} " + ", ".join(f"{dim} {length}" for dim, length in zip(dims, shape, strict=True))


def coord_text(dim: str | None, values: Any) -> str:
    """Return the axis and the values of a coordinate as text."""
    return f"{dim} {np.asarray(values).tolist()}"


def write_skeleton(path: Path, plan: Plan, chunk_epochs: int) -> None:
    """Write a store without values into a new folder.

    zarr makes the files in memory, because zarr takes three times as long to write so many small files to the disk.

    The function raises `VestigeError` if a chunk would be too large to be read again (`MAX_CHUNK_BYTES`).
    """
    row_bytes = {
        name: int(np.prod(shape_of(plan, column, 1))) * np.dtype(column.dtype).itemsize
        for name, column in plan.columns.items()
    }
    if (most := MAX_CHUNK_BYTES // max(row_bytes.values(), default=1)) < chunk_epochs:
        raise VestigeError(f"{path.name}: found chunks of {chunk_epochs} epochs, expected at most {most} (--chunk)")
    files: dict[str, Buffer] = {}
    coords = plan.coords
    group = zarr.create_group(MemoryStore(files), zarr_format=3, attributes=identity(plan))
    for name, coord in coords.items():
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
                    "coordinates": " ".join(n for n, coord in coords.items() if coord.dim in column.dims),
                    **column.attrs,
                }
            ),
        )
    own = {**store_schema(plan), CHUNK: chunk_epochs, WORK: work_digest(identity(plan))}
    progress = group.create_group(PROGRESS, attributes=own)
    n_chunks = -(-plan.n_epochs // chunk_epochs)
    progress.create_array(DIGEST, shape=(n_chunks,), chunks=(1,), dtype="uint64", fill_value=UNFINISHED)
    for name, content in files.items():
        place = path / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content.to_bytes())


def mended(path: Path, plan: Plan) -> bool:
    """Write the damaged metadata and coordinates of a store again, and return whether the repair was possible.

    The repair is possible if the attributes of the store, or their digest in the group `progress`, agree with the plan.
    Some readable metadata must also state the number of epochs in a chunk.
    """
    root, own = _attributes(path), _attributes(path / PROGRESS)
    if root != identity(plan) and own.get(WORK) != work_digest(identity(plan)):
        return False
    stated = Counter([own.get(CHUNK), *_chunk_lengths(path, plan)])
    lengths = [length for length, _ in stated.most_common() if isinstance(length, int) and 0 < length <= plan.n_epochs]
    if not lengths:
        return False
    with TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
        fresh = Path(folder) / "store"
        write_skeleton(fresh, plan, lengths[0])
        for file in [one for one in fresh.rglob("*") if one.is_file()]:
            place = path / file.relative_to(fresh)
            if not place.exists() or place.read_bytes() != file.read_bytes():
                place.parent.mkdir(parents=True, exist_ok=True)
                file.replace(place)
    return True


def _chunk_lengths(path: Path, plan: Plan) -> Iterator[Any]:
    """Yield the number of epochs in a chunk, as stated by each column whose metadata can be read."""
    for name, column in plan.columns.items():
        try:
            content = json.loads((path / name / METADATA).read_bytes())
            yield content["chunk_grid"]["configuration"]["chunk_shape"][column.dims.index(EPOCH)]
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            continue


def _attributes(path: Path) -> dict[str, Any]:
    """Return the attributes of a group; an empty dictionary if the metadata of the group are damaged."""
    try:
        found = json.loads((path / METADATA).read_bytes())["attributes"]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _json(values: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(json.dumps(dict(values), allow_nan=False))
    return found
