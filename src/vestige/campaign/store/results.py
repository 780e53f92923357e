"""Open the stored results of a campaign: columns, parsed scenario, and the numbers of available and damaged epochs.

    results = open_results("night.zarr", partial=True)
    results.scenario.processor.level, results.dataset["status"], results.damaged

Use `open_results` to open any store of a campaign. For any content of the folder, this function returns `Results` or
raises an error with a message of one line.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import xarray
import zarr
from jaxtyping import Float, Int8, Int64

from vestige.campaign.plan import EPOCH
from vestige.campaign.store.attributes import (
    CheckColumns,
    RunAttributes,
    attributes_of,
    check_columns,
    scenario_of,
    values,
)
from vestige.campaign.store.store import MENDS, Store, open_existing
from vestige.campaign.store.store_files import EXPECTED_RESULTS, arrays_of, check_files, check_small_array
from vestige.errors import InputFileError
from vestige.scenario.stored import StoredScenario
from vestige.scenario.toml.toml_file import LARGEST_NUMBER

_NO_EPOCHS = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Results of a campaign of n epochs and m satellites; `open_results` and `vestige.run` return this class.

    Attributes
    ----------
    path
        Folder of the results.
    dataset
        All columns with their coordinates, units and attributes; values are read from disk when they are used. If
        epochs are missing, the coordinate `epoch` has the numbers of the available epochs.
    n_epochs
        Number of epochs of the complete campaign.
    damaged
        Ranges of epochs with values that do not agree with their hash; `dataset` does not contain these epochs.

    Examples
    --------
    >>> import vestige as vs
    >>> results = vs.run("scenarios/quick.toml", "quick.zarr", settings=["epochs=100", "receiver.cn0_dbhz=45"])
    >>> list(vs.Status)[results.status[0, 0]].name
    'AUTHENTIC'
    >>> offsets = results.check("E1-E6 range").statistic  # in m
    >>> offsets.shape, bool(abs(offsets).max() < 15)
    ((100, 1), True)
    """

    path: Path
    dataset: xarray.Dataset
    n_epochs: int
    damaged: tuple[range, ...]

    @property
    def scenario(self) -> StoredScenario:
        """Scenario of the campaign; the property raises `VestigeError` if the results have no valid scenario."""
        return scenario_of(self.dataset)

    @property
    def attributes(self) -> RunAttributes:
        """Attributes of the run; the property raises `VestigeError` if an attribute is missing or out of its range."""
        return attributes_of(self.dataset)

    @property
    def epochs(self) -> Int64[np.ndarray, " n"]:
        """Numbers of the available epochs."""
        found = self.dataset.coords.get(EPOCH)
        return np.arange(self.n_epochs) if found is None else np.asarray(found.values, dtype=np.int64)

    @property
    def time_s(self) -> Float[np.ndarray, " n"]:
        """Time of each epoch in s after the start of the campaign."""
        return values(self.dataset, "time_s")

    @property
    def status(self) -> Int8[np.ndarray, "n m"]:
        """Verdict of each epoch and satellite at the level of the scenario, as index in `Status`."""
        return values(self.dataset, "status", EPOCH, "satellite").astype(np.int8)

    @property
    def state(self) -> Int8[np.ndarray, "n m"]:
        """State of each satellite that the receiver shows to its user after each epoch, as index in `Status`."""
        return values(self.dataset, "state", EPOCH, "satellite").astype(np.int8)

    @property
    def range_in_use_m(self) -> Float[np.ndarray, "n m"]:
        """Range in use of each epoch and satellite in m; NaN if no range of the satellite is in use."""
        return values(self.dataset, "range_in_use_m", EPOCH, "satellite")

    def check(self, name: str) -> CheckColumns:
        """Return the result, statistic and threshold of a check for every epoch and satellite.

        Raises
        ------
        VestigeError
            If the results have no check with this name.
        """
        return check_columns(self.dataset, name)

    def load(self) -> Results:
        """Return the results with all values in memory."""
        return Results(path=self.path, dataset=self.dataset.load(), n_epochs=self.n_epochs, damaged=self.damaged)


def open_results(
    path: Path | str, *, partial: bool = False, damaged: Literal["refuse", "leave out"] = "refuse", verify: bool = True
) -> Results:
    """Return the results of a campaign that `run` or `vestige run` has stored.

    Parameters
    ----------
    path
        Folder of the results.
    partial
        Whether a campaign that has not ended is accepted.
    damaged
        Treatment of epochs with values that do not agree with their hash. `refuse` raises an error. `leave out` needs
        `partial`, and removes the damaged epochs from the results. `Results.damaged` lists the damaged epochs.
    verify
        Whether all values are read once and compared with their hashes. The comparison takes some seconds for a million
        epochs.

    Returns
    -------
    Results
        Columns of n epochs × m satellites, and the scenario. Columns are read when they are used.

    Raises
    ------
    InputFileError
        If the folder is no store, the metadata are damaged, or the campaign has not ended and `partial` is not set. If
        values are damaged and `damaged` is `refuse`.

    Examples
    --------
    >>> import vestige as vs
    >>> _ = vs.run("scenarios/quick.toml", "quick.zarr", settings=["epochs=100", "receiver.cn0_dbhz=45"])
    >>> results = vs.open_results("quick.zarr")
    >>> results.n_epochs, results.attributes.p_fa
    (100, 1e-07)
    """
    path = Path(path)
    store = open_existing(path, mode="r")
    recorded = store.finished(verify=False)
    finished = store.finished(verify=True) if verify else recorded
    torn = tuple(store.epochs(chunk) for chunk in sorted(recorded - finished))
    if torn and damaged == "refuse":
        found = f"values that do not agree with their hash ({sum(map(len, torn))} epochs in all)"
        raise InputFileError(path, f"epoch {torn[0].start}", found, f"the values that were written; {MENDS}")
    if len(finished) < store.n_chunks and not partial:
        found = f"{sum(len(store.epochs(chunk)) for chunk in finished)} epochs"
        raise InputFileError(path, "results", found, f"{store.n_epochs} epochs (the same command finishes the run)")
    dataset = open_dataset(path)
    _check_attributes(path, dataset)
    if len(finished) < store.n_chunks:
        kept = np.concatenate([*_numbers(store, sorted(finished)), _NO_EPOCHS])
        dataset = dataset.isel({EPOCH: kept}).assign_coords({EPOCH: kept})
    return Results(path=path, dataset=dataset, n_epochs=store.n_epochs, damaged=torn)


def open_dataset(path: Path) -> xarray.Dataset:
    """Return the content of a zarr store; values are read when they are used.

    The function raises `InputFileError` if the folder is no store, or its metadata are damaged.
    """
    check_files(path)
    try:  # dask is not needed, zarr v3 has no consolidated metadata, and values with the unit `s` must stay numbers
        return xarray.open_dataset(
            path, engine="zarr", chunks=None, consolidated=False, decode_times=False, decode_timedelta=False
        )
    except Exception as error:  # damaged metadata may raise any error
        raise InputFileError(path, "store", f"{type(error).__name__}: {error}", EXPECTED_RESULTS) from error


def load_small(path: Path, expected: str) -> xarray.Dataset:
    """Return a small zarr store, such as a threat table, with all values in memory.

    `expected` describes the expected store in the message of an error.

    The function raises `InputFileError` if the folder is no store, the store is damaged, or an array has more than
    `MAX_LABELS_BYTES`.
    """
    check_files(path, expected)
    try:
        for name, array in arrays_of(path, zarr.open_group(path, mode="r", zarr_format=3)).items():
            check_small_array(path, name, array)
        return open_dataset(path).load()
    except InputFileError:
        raise
    except Exception as error:  # damaged metadata and values may raise any error
        raise InputFileError(path, "store", f"{type(error).__name__}: {error}", expected) from error


def _numbers(store: Store, chunks: Iterable[int]) -> list[np.ndarray]:
    return [np.array(store.epochs(chunk), dtype=np.int64) for chunk in chunks]


def _check_attributes(path: Path, dataset: xarray.Dataset) -> None:
    """Raise `InputFileError` if a number among the attributes is not finite, or is too large for a computation."""
    for name, value in dataset.attrs.items():
        if isinstance(value, (int, float)) and not abs(value) <= LARGEST_NUMBER:
            raise InputFileError(path, name, value, f"a number between {-LARGEST_NUMBER:g} and {LARGEST_NUMBER:g}")
