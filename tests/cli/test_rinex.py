"""`vestige rinex`: what it prints, and one line for whatever is not the finished results of a sky."""

from __future__ import annotations

from pathlib import Path

import pytest

from night import invoke
from sky_builder import SCENARIO, sky_scenario
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.store.store import open_store
from vestige.cli.services.rinex import command as rinex
from vestige.errors import VestigeError
from vestige.scenario.load import load_scenario


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rinex") / "sky.zarr"
    run(ScenarioPlan(scenario=sky_scenario("epochs=4", "recs.every=2")), path, executor="threads")
    return path


def test_it_prints_the_files_and_how_to_use_them(store: Path, tmp_path: Path) -> None:
    found = invoke(rinex, store, "-o", tmp_path / "sky")
    assert found.exception is None
    names = ["observations.rnx", "navigation.rnx", "rtklib.conf"]
    assert found.stdout.splitlines() == [str(tmp_path / "sky" / name) for name in names]
    assert all((tmp_path / "sky" / name).stat().st_size > 100 for name in names)
    assert "4 epochs of E06, E07, E08, E12, E13, E14, E23, E24" in found.stderr
    assert f"cd {tmp_path / 'sky'} && rnx2rtkp -k rtklib.conf -o position.pos {names[0]} {names[1]}" in found.stderr


def test_equal_results_make_equal_files(store: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert invoke(rinex, store, "-o", tmp_path / name).exception is None
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def test_whatever_is_no_finished_sky_is_one_line(store: Path, tmp_path: Path) -> None:
    single = load_scenario(SCENARIO.parent / "quick.toml", ("epochs=3",))
    run(ScenarioPlan(scenario=single), tmp_path / "single.zarr", executor="threads")  # type: ignore[arg-type]
    open_store(tmp_path / "begun.zarr", ScenarioPlan(scenario=sky_scenario("epochs=4")), chunk_epochs=2)
    (tmp_path / "folder").mkdir()
    (tmp_path / "text.zarr").write_text("no store")
    (tmp_path / "taken").mkdir()
    for path, output, words in (
        (tmp_path / "single.zarr", "new", ("single.zarr", "single line of sight", "[constellation]")),
        (tmp_path / "begun.zarr", "new", ("begun.zarr", "0 epochs", "4 epochs")),
        (tmp_path / "folder", "new", ("folder", "expected the results of a campaign")),
        (tmp_path / "text.zarr", "new", ("text.zarr", "expected the results of a campaign")),
        (tmp_path / "absent", "new", ("absent", "found nothing")),
        (store, "taken", ("taken", "output folder", "an existing file or folder")),
    ):
        error = invoke(rinex, path, "-o", tmp_path / output).exception
        assert isinstance(error, VestigeError)
        assert "\n" not in str(error)
        for word in words:
            assert word in str(error)
        assert not (tmp_path / "new").exists()
