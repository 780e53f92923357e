"""Results that were cut, damaged or made up are one line, and the same run mends what can be mended."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numcodecs
import numpy as np
import pytest
import xarray

import vestige as vs
from report_builder import LIFT_OFF, made
from toy_plan import ToyPlan
from vestige.campaign.run import run
from vestige.campaign.store.attributes import attributes_of, scenario_of
from vestige.campaign.store.results import open_results
from vestige.campaign.store.store import open_store
from vestige.errors import InputFileError, VestigeError
from vestige.folder_lock import only_writer
from vestige.report import run_page
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.stored import stored_scenario
from vestige.threats.scenes import read_threats
from vestige.threats.scenes import scene_scenario as scenario_of_threat
from vestige.threats.table import STORE, read_threat_dataset, write_table

PLAN = ToyPlan(n_epochs=10)
TRUTH = PLAN.measure(0, PLAN.prepare().advance(0, 10))
SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
HUGE = int("9" * 400)

_CUTS: dict[str, Callable[[bytes], bytes | None]] = {
    "lost": lambda _: None,
    "empty": lambda _: b"",
    "half": lambda content: content[: len(content) // 2],
    "last byte": lambda content: content[:-1],
}


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("toy") / "a.zarr"
    run(PLAN, path, chunk_epochs=4)
    return path


@pytest.fixture(scope="module")
def lift_off(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    path = made(tmp_path_factory.mktemp("lift-off") / "a", "liftoff_sudden", *LIFT_OFF, "epochs=20")
    return open_results(path).dataset.load()


def files_of(store: Path) -> list[Path]:
    """Return the names of all files in a store."""
    return sorted(path.relative_to(store) for path in store.rglob("*") if path.is_file())


def is_right(results: vs.Results) -> bool:
    """Return whether the epochs that are here are those of the toy, with its labels."""
    for name, truth in TRUTH.items():
        expected = truth.take(results.epochs, axis=PLAN.columns[name].dims.index("epoch"))
        if results.dataset[name].values.tobytes() != expected.tobytes():
            return False
    return results.dataset["svid"].values.tolist() == [4, 11]


def cut_at(file: Path, cut: str) -> None:
    content = _CUTS[cut](file.read_bytes())
    file.unlink()
    if content is not None:
        file.write_bytes(content)


@pytest.mark.slow
def test_a_store_cut_at_every_file_is_one_line_and_the_same_run_mends_it(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    files = files_of(toy)
    assert len(files) == 1 + 2 * 3 + 4 + 4 * 3 + 2 + 3  # root; labels; columns and their chunks; progress and digests
    for number, name in enumerate(files):
        cut_at(path / name, list(_CUTS)[number % len(_CUTS)])
        with contextlib.suppress(InputFileError):
            assert is_right(open_results(path, partial=True)), name
        run(PLAN, path, chunk_epochs=4)
        assert is_right(open_results(path)), name
    assert {one.name for one in tmp_path.iterdir()} == {"a.zarr"}


@pytest.mark.parametrize("cut", list(_CUTS))
def test_nothing_that_was_computed_is_lost_with_the_metadata(toy: Path, tmp_path: Path, cut: str) -> None:
    for name in (name for name in files_of(toy) if name.name == "zarr.json"):
        path = shutil.copytree(toy, tmp_path / str(name).replace("/", "-"))
        cut_at(path / name, cut)
        assert open_store(path, PLAN, chunk_epochs=7).finished(verify=True) == {0, 1, 2}, name


def test_a_store_that_may_be_of_another_plan_is_not_mended(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    for name in ("zarr.json", "progress/zarr.json"):
        (path / name).write_bytes(b"{")
    before = {name: (path / name).read_bytes() for name in files_of(path)}
    with pytest.raises(InputFileError, match="expected the results of a campaign"):
        open_store(path, PLAN, chunk_epochs=4)
    (path / "zarr.json").write_bytes((toy / "zarr.json").read_bytes())
    with pytest.raises(InputFileError, match="expected the results of a campaign"):
        open_store(path, ToyPlan(n_epochs=10, seed=2), chunk_epochs=4)
    (path / "zarr.json").write_bytes(b"{")
    assert {name: (path / name).read_bytes() for name in files_of(path)} == before


def test_damaged_epochs_can_be_left_out_and_are_named(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    (path / "time_s" / "c" / "1").write_bytes(b"")
    with pytest.raises(InputFileError, match=r"epoch 4: found values .* \(4 epochs in all\), .*same command repairs"):
        open_results(path, partial=True)
    with pytest.raises(InputFileError, match="found 6 epochs, expected 10"):
        open_results(path, damaged="leave out")
    results = open_results(path, partial=True, damaged="leave out")
    assert results.damaged == (range(4, 8),)
    assert results.epochs.tolist() == [0, 1, 2, 3, 8, 9]
    assert is_right(results)
    assert results.n_epochs == 10


def test_results_are_typed(lift_off: xarray.Dataset, toy: Path) -> None:
    scenario = scenario_of(lift_off)
    assert (scenario.epochs, scenario.interval_s, scenario.recs.every) == (20, 1.0, 1)
    assert scenario.attack[0].kind == "lift-off"
    assert scenario.constellation is None
    found = attributes_of(lift_off)
    assert found.signal
    assert found.cn0_dbhz == scenario.receiver.cn0_dbhz
    assert found.p_fa == scenario.processor.p_fa
    whole = vs.open_results(toy).load()
    assert whole.epochs.tolist() == list(range(whole.n_epochs))
    assert whole.damaged == ()
    assert whole.time_s.tobytes() == TRUTH["time_s"].tobytes()
    with pytest.raises(VestigeError, match="scenario: found no text that agrees with its digest"):
        _ = whole.scenario
    with pytest.raises(VestigeError, match="found no scenario_digest"):
        _ = whole.attributes


def test_every_scenario_comes_back_from_its_results() -> None:
    every = [load_scenario(path) for path in sorted(SCENARIOS.glob("*.toml"))]
    every += [scenario_of_threat(one, scene, 1, attacked=True) for one in read_threats()[::4] for scene in one.scene]
    campaigns = [one for one in every if isinstance(one, CampaignScenario)]
    assert len(campaigns) > 8
    for one in campaigns:
        found = stored_scenario(one.model_dump_json())
        assert found.processor == one.processor
        assert found.recs == one.recs
        assert found.start_time == one.start_time
        assert found.receiver.clock == one.receiver.clock
        assert found.receiver.front_end == one.receiver.front_end
        assert found.receiver.accelerometers == one.receiver.accelerometers
        assert [attack.kind for attack in found.attack] == [attack.kind for attack in one.attack]
        assert (found.constellation is None) == (one.constellation is None)


def of_scenario(results: xarray.Dataset, text: str) -> xarray.Dataset:
    return results.assign_attrs(scenario=text, scenario_digest=hashlib.sha256(text.encode()).hexdigest())


def changed(tables: Mapping[str, Any], place: str, value: object) -> str:
    """Return a scenario with one value replaced, as JSON."""
    result = json.loads(json.dumps(tables))
    *above, key = place.split(".")
    table = result
    for name in above:
        table = table[name]
    table[key] = value
    return json.dumps(result)


def test_scenarios_that_were_made_up_are_one_line(lift_off: xarray.Dataset) -> None:
    tables = json.loads(lift_off.attrs["scenario"])
    optional = {"constellation", "trajectory", "line_of_sight", "atmosphere", "osnma"}  # not looked at, or none
    wrong = [(place, value) for place in tables.keys() - optional for value in (None, "x", [1], -1, HUGE)]
    wrong += [
        ("interval_s", 0), ("recs.every", 0), ("processor.budget", {}), ("processor.kappa", "3"),
        ("processor.level", 4), ("receiver.cn0_dbhz", None), ("receiver.clock", {"kind": "sundial"}),
        ("start", "yesterday"), ("attack", [{"no": "kind"}]), ("constellation", {}), ("receiver", {}),
    ]  # fmt: skip
    texts = ["null", "[]", "{}", "nothing", "[" * 100_000, *(changed(tables, *one) for one in wrong)]
    for text in texts:
        with pytest.raises(VestigeError, match="scenario: "):
            run_page(of_scenario(lift_off, text), "made up")
    for place in optional - {"constellation"}:
        for value in (None, "x", [1], HUGE):
            run_page(of_scenario(lift_off, changed(tables, place, value)), "made up")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("p_fa", HUGE), ("p_fa", "1e-7"), ("p_fa", 0), ("threshold_sigma", HUGE), ("threshold_sigma", None),
        ("integration_s", 0.0), ("cn0_dbhz", HUGE), ("cn0_dbhz", "x"), ("cn0_dbhz", None), ("signal", "yes"),
        ("seed", "one"), ("fidelity", "perfect"), ("vestige_version", 1), ("vestige_version", [1]),
    ],
)  # fmt: skip
def test_attributes_that_were_made_up_are_one_line(lift_off: xarray.Dataset, name: str, value: object) -> None:
    with pytest.raises(VestigeError, match=name):
        run_page(lift_off.assign_attrs({name: value}), "made up")


def test_attributes_are_those_with_which_a_store_was_made(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    content = json.loads((path / "zarr.json").read_bytes())
    for value in (2, HUGE, "1"):
        content["attributes"]["seed"] = value
        (path / "zarr.json").write_text(json.dumps(content))
        with pytest.raises(InputFileError, match="attributes differ from"):
            open_results(path)


@pytest.mark.parametrize("place", ["a pipe", "taps/c/0/0/0", "zarr.json", "progress/digest/c/0"])
def test_a_pipe_in_a_store_is_refused_before_it_is_opened(toy: Path, tmp_path: Path, place: str) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    (path / place).unlink(missing_ok=True)
    os.mkfifo(path / place)
    for read in (open_results, lambda path: open_store(path, PLAN, chunk_epochs=4)):
        with pytest.raises(InputFileError, match="found a pipe, expected a regular file"):
            read(path)


def test_a_link_in_a_store_is_refused(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    shutil.rmtree(path / "taps")
    (path / "taps").symlink_to(toy / "taps")
    with pytest.raises(InputFileError, match="found a link, expected a regular file"):
        open_results(path)


def test_a_store_that_claims_a_million_chunks_costs_what_it_holds(tmp_path: Path) -> None:
    plan = ToyPlan(n_epochs=1_000_000)
    store = open_store(tmp_path / "a.zarr", plan, chunk_epochs=1)
    one = ToyPlan(n_epochs=1)
    store.write(0, one.measure(0, one.prepare().advance(0, 1)))
    before = time.process_time()
    assert open_results(store.path, partial=True).dataset.sizes["epoch"] == 1
    with pytest.raises(InputFileError, match="found 1 epochs, expected 1000000 epochs"):
        open_results(store.path)
    assert time.process_time() - before < 20  # reading 2 million records takes some 10 minutes


@pytest.mark.parametrize("field", ["n_epochs", "chunk_epochs"])
@pytest.mark.parametrize("value", [0, -4, 10**18, HUGE, "10"])
def test_a_store_that_claims_impossible_numbers(toy: Path, tmp_path: Path, field: str, value: object) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    content = json.loads((path / "progress/zarr.json").read_bytes())
    content["attributes"][field] = value
    (path / "progress/zarr.json").write_text(json.dumps(content))
    with pytest.raises(InputFileError, match="expected the results of a campaign"):
        open_results(path)


def test_a_chunk_that_unpacks_to_two_gigabytes_is_not_unpacked(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    small = numcodecs.Zstd().encode(np.zeros(1 << 20, np.uint8))
    # a frame says to how many bytes it unpacks: in 4 bytes from byte 5 or 6 on
    first = 5 if small[4] & 0x20 else 6
    assert int.from_bytes(small[first : first + 4], "little") == 1 << 20
    large = small[:first] + (0x9000_0000).to_bytes(4, "little") + small[first + 4 :]
    for name, found in (("taps/c/1/0/0", "epoch 4: found values"), ("svid/c/0", "unpack to 2415919104")):
        kept = (path / name).read_bytes()
        (path / name).write_bytes(large)
        with pytest.raises(InputFileError, match=found):
            open_results(path)
        (path / name).write_bytes(kept)
    assert is_right(open_results(path))


def test_metadata_that_claim_a_large_chunk_are_refused(toy: Path, tmp_path: Path) -> None:
    for name, shape in (("svid", [1 << 28]), ("taps", [1 << 20, 2, 5]), ("progress/digest", [1 << 30])):
        path = shutil.copytree(toy, tmp_path / name.replace("/", "-"))
        content = json.loads((path / name / "zarr.json").read_bytes())
        content["chunk_grid"]["configuration"]["chunk_shape"] = shape
        (path / name / "zarr.json").write_text(json.dumps(content))
        with pytest.raises(InputFileError, match="expected the results of a campaign"):
            open_results(path)
        path = shutil.copytree(toy, tmp_path / f"{path.name}-packed")
        content = json.loads((path / name / "zarr.json").read_bytes())
        content["codecs"].append({"name": "gzip", "configuration": {"level": 5}})
        (path / name / "zarr.json").write_text(json.dumps(content))
        with pytest.raises(InputFileError, match="codecs: found"):
            open_results(path)


def test_metadata_of_forty_gigabytes_are_not_read(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    os.truncate(path / "taps" / "zarr.json", 40_000_000_000)
    with pytest.raises(InputFileError, match="length: found 40000000000 bytes, expected at most 16777216"):
        open_results(path)


def test_a_second_writer_is_told_so(toy: Path, tmp_path: Path) -> None:
    path = shutil.copytree(toy, tmp_path / "a.zarr")
    with only_writer(path), pytest.raises(InputFileError, match="another process that writes into it"):
        run(PLAN, path)
    assert is_right(open_results(run_again(path)))


def run_again(path: Path) -> Path:
    run(PLAN, path)
    return path


def test_the_lock_is_held_while_a_run_writes(tmp_path: Path) -> None:
    refused = []

    def second(_: object) -> None:
        try:
            run(PLAN, tmp_path / "a.zarr")
        except InputFileError as error:
            refused.append(str(error))

    run(PLAN, tmp_path / "a.zarr", chunk_epochs=4, progress=second)
    assert len(refused) == 4  # at the beginning and after each chunk
    assert is_right(open_results(tmp_path / "a.zarr"))


@pytest.fixture(scope="module")
def threat_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("threats")
    write_table(folder, [])
    return folder


@pytest.mark.parametrize("cut", list(_CUTS))
def test_a_threat_table_cut_at_every_file_is_one_line(threat_store: Path, tmp_path: Path, cut: str) -> None:
    whole = read_threat_dataset(threat_store)
    for name in files_of(threat_store / STORE):
        folder = shutil.copytree(threat_store, tmp_path / str(name).replace("/", "-"))
        cut_at(folder / STORE / name, cut)
        with contextlib.suppress(InputFileError):
            assert cut == "lost" or read_threat_dataset(folder).identical(whole), name


def test_chunks_that_could_not_be_read_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(VestigeError, match=r"found chunks of 100000000 epochs, expected at most \d+"):
        run(ToyPlan(n_epochs=100_000_000), tmp_path / "a.zarr", chunk_epochs=100_000_000)
    assert list(tmp_path.iterdir()) == []
