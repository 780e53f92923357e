"""A store is there as a whole or not at all, knows what it holds, and trusts no value without its hash."""

from __future__ import annotations

import contextlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray
import zarr
from hypothesis import given
from hypothesis import strategies as st

import vestige
from toy_plan import ToyPlan
from vestige.campaign.store.results import open_results
from vestige.campaign.store.store import Store, open_store
from vestige.errors import InputFileError
from vestige.source_version import vestige_version

PLAN = ToyPlan(n_epochs=10)
TRUTH = PLAN.measure(0, PLAN.prepare().advance(0, 10))


def part(epochs: range) -> dict[str, np.ndarray]:
    """Return the results of some epochs."""
    return {
        name: values.take(np.array(epochs), axis=PLAN.columns[name].dims.index("epoch"))
        for name, values in TRUTH.items()
    }


def filled(path: Path, *chunks: int) -> Store:
    """Return a store of three chunks (4, 4 and 2 epochs) of which some are written."""
    store = open_store(path, PLAN, chunk_epochs=4)
    for chunk in chunks:
        store.write(chunk, part(store.epochs(chunk)))
    return store


def files_of(path: Path, chunk: int) -> list[Path]:
    """Return the files in which the values of a chunk are."""
    place = {
        "time_s": f"{chunk}",
        "taps": f"{chunk}/0/0",
        "tap_index": f"0/{chunk}/0",
        "range_offset_m": f"0/{chunk}/0",
    }
    return [path / name / "c" / where for name, where in place.items()]


def test_what_was_written_is_read(tmp_path: Path) -> None:
    filled(tmp_path / "a.zarr", 2, 0, 1)
    results = open_results(tmp_path / "a.zarr").dataset
    for name, values in TRUTH.items():
        assert results[name].dims == PLAN.columns[name].dims
        assert results[name].values.tobytes() == values.tobytes()


def test_labels_units_and_attributes(tmp_path: Path) -> None:
    filled(tmp_path / "a.zarr", 0, 1, 2)
    results = open_results(tmp_path / "a.zarr").dataset
    assert results.attrs == {**PLAN.attrs, "vestige_version": vestige_version()}
    assert results["tap_index"].attrs == {"units": "1", "long_name": "tap", "least": -1}
    assert results["time_s"].attrs["units"] == "s"
    assert set(results.coords) == {"svid", "tap_offset_m", "detector"}
    assert results["svid"].values.tolist() == [4, 11]
    assert results.sel(detector="maximum")["tap_index"].values.tolist() == TRUTH["tap_index"][1].tolist()


def test_opens_without_vestige(tmp_path: Path) -> None:
    filled(tmp_path / "a.zarr", 0, 1, 2)
    plain = xarray.open_zarr(tmp_path / "a.zarr", chunks=None, consolidated=False)
    assert plain.identical(open_results(tmp_path / "a.zarr").dataset)


@pytest.mark.filterwarnings("ignore:Consolidated metadata is currently not part")
def test_consolidated_metadata_do_no_harm(tmp_path: Path) -> None:
    filled(tmp_path / "a.zarr", 0, 1, 2)
    before = open_results(tmp_path / "a.zarr").dataset.load()
    zarr.consolidate_metadata(tmp_path / "a.zarr")
    assert open_results(tmp_path / "a.zarr").dataset.identical(before)


def test_a_campaign_that_has_not_ended(tmp_path: Path) -> None:
    filled(tmp_path / "a.zarr", 0, 2)
    with pytest.raises(InputFileError, match="found 6 epochs, expected 10 epochs"):
        open_results(tmp_path / "a.zarr")
    results = open_results(tmp_path / "a.zarr", partial=True).dataset
    assert results["epoch"].values.tolist() == [0, 1, 2, 3, 8, 9]
    assert results["time_s"].values.tolist() == [0, 1, 2, 3, 8, 9]
    assert open_results(filled(tmp_path / "b.zarr").path, partial=True).dataset.sizes["epoch"] == 0


def test_finished_chunks_are_known_again(tmp_path: Path) -> None:
    filled(tmp_path / "a.zarr", 0, 2)
    store = open_store(tmp_path / "a.zarr", PLAN, chunk_epochs=7)
    assert store.chunk_epochs == 4
    assert store.finished(verify=True) == store.finished(verify=False) == {0, 2}


@pytest.mark.parametrize("n_written", range(5))
def test_a_chunk_that_was_being_written(tmp_path: Path, n_written: int) -> None:
    store = filled(tmp_path / "a.zarr", 0)
    for name in sorted(store.columns)[:n_written]:
        array = store.columns[name]
        array[store._region(array, 1)] = part(store.epochs(1))[name]
    assert open_store(tmp_path / "a.zarr", PLAN, chunk_epochs=4).finished(verify=True) == {0}


@pytest.mark.parametrize("index", range(4))
@pytest.mark.parametrize("damage", ["lost", "empty", "torn", "other values"])
def test_values_that_did_not_reach_the_disk(tmp_path: Path, index: int, damage: str) -> None:
    path = filled(tmp_path / "a.zarr", 0, 1, 2).path
    file, other = files_of(path, 1)[index], files_of(path, 0)[index]
    if damage == "lost":
        file.unlink()
    else:
        content = {"empty": b"", "torn": file.read_bytes()[:-5], "other values": other.read_bytes()}[damage]
        file.write_bytes(content)
    assert open_store(path, PLAN, chunk_epochs=4).finished(verify=True) == {0, 2}
    with pytest.raises(InputFileError, match="epoch 4: found values that do not agree with their hash"):
        open_results(path)


@pytest.mark.parametrize("content", [b"", b"\x00\x01", bytes(8), bytes(range(200))])
def test_a_record_that_was_torn(tmp_path: Path, content: bytes) -> None:
    path = filled(tmp_path / "a.zarr", 0, 1, 2).path
    (path / "progress/digest/c/1").write_bytes(content)
    store = open_store(path, PLAN, chunk_epochs=4)
    assert store.finished(verify=True) == {0, 2}
    store.write(1, part(store.epochs(1)))
    assert store.finished(verify=True) == {0, 1, 2}


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (ToyPlan(n_epochs=10, seed=2), "seed: found 1, expected 2, as in this run"),
        (ToyPlan(n_epochs=10, scenario="another"), r"scenario: found a toy\\nwith two lines, expected another"),
        (ToyPlan(n_epochs=11), "n_epochs: found 10, expected 11"),
    ],
)
def test_a_store_of_other_work(tmp_path: Path, other: ToyPlan, message: str) -> None:
    filled(tmp_path / "a.zarr", 0)
    with pytest.raises(InputFileError, match=message):
        open_store(tmp_path / "a.zarr", other, chunk_epochs=4)


def test_a_store_of_another_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    filled(tmp_path / "a.zarr", 0)
    monkeypatch.setattr("vestige.campaign.store.build_id.vestige_version", lambda: "9.9")
    with pytest.raises(
        InputFileError, match=rf"vestige_version: found {vestige.__version__}\+.*expected 9\.9; finish with the"
    ):
        open_store(tmp_path / "a.zarr", PLAN, chunk_epochs=4)


def test_what_is_no_store(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("text")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "notes.txt").write_text("text")
    zarr.create_group(tmp_path / "group", zarr_format=3)
    for name in ("file", "folder", "group"):
        with pytest.raises(InputFileError, match="expected the results of a campaign"):
            open_store(tmp_path / name, PLAN, chunk_epochs=4)
        with pytest.raises(InputFileError, match="expected the results of a campaign"):
            open_results(tmp_path / name)
    with pytest.raises(InputFileError, match="found nothing"):
        open_results(tmp_path / "missing")
    assert (tmp_path / "folder" / "notes.txt").read_text() == "text"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return filled(tmp_path_factory.mktemp("whole") / "a.zarr", 0, 1, 2).path


@given(file=st.sampled_from(["", "progress/", "progress/digest/", "taps/", "svid/", "detector/"]), data=st.data())
def test_damaged_metadata_raise_one_kind_of_error(whole: Path, file: str, data: st.DataObject) -> None:
    path = whole / file / "zarr.json"
    content = path.read_bytes()
    place = data.draw(st.integers(0, len(content) - 1))
    damaged = content[:place] + data.draw(st.binary(max_size=3)) + content[place + data.draw(st.integers(0, 20)) :]
    try:
        path.write_bytes(damaged)
        with contextlib.suppress(InputFileError):
            results = open_results(whole).dataset.load()
            assert all(results[name].values.tobytes() == TRUTH[name].tobytes() for name in TRUTH)
            assert results["svid"].values.tolist() == [4, 11]
            assert results["detector"].values.tolist() == ["early", "maximum"]
    finally:
        path.write_bytes(content)


@pytest.mark.parametrize("name", ["svid", "tap_offset_m", "detector"])
def test_labels_that_were_lost(tmp_path: Path, name: str) -> None:
    path = filled(tmp_path / "a.zarr", 0, 1, 2).path
    (path / name / "c" / "0").unlink()
    with pytest.raises(InputFileError, match="arrays differ from"):
        open_results(path)
    assert open_store(path, PLAN, chunk_epochs=4).finished(verify=True) == {0, 1, 2}
    assert open_results(path).dataset["svid"].values.tolist() == [4, 11]


def test_a_new_store_leaves_nothing_beside_it(tmp_path: Path) -> None:
    filled(tmp_path / "new" / "a.zarr")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["a.zarr"]
    (tmp_path / "empty").mkdir()
    assert filled(tmp_path / "empty", 0).finished(verify=True) == {0}


def test_a_store_that_cannot_be_made_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "rename", lambda *_: (_ for _ in ()).throw(OSError("no space")))
    with pytest.raises(OSError, match="no space"):
        filled(tmp_path / "a.zarr")
    assert list(tmp_path.iterdir()) == []


def test_impossible_plans(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        open_store(tmp_path / "a.zarr", ToyPlan(n_epochs=0), chunk_epochs=4)
    with pytest.raises(ValueError, match="at least 1"):
        open_store(tmp_path / "a.zarr", PLAN, chunk_epochs=0)
    assert list(tmp_path.iterdir()) == []


def test_a_store_may_be_copied(tmp_path: Path) -> None:
    filled(tmp_path / "a.zarr", 0, 1, 2)
    shutil.copytree(tmp_path / "a.zarr", tmp_path / "b.zarr")
    assert open_results(tmp_path / "a.zarr").dataset.identical(open_results(tmp_path / "b.zarr").dataset)
    assert json.loads((tmp_path / "b.zarr/zarr.json").read_text())["zarr_format"] == 3
