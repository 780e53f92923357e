from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from click.testing import CliRunner, Result

from report_builder import QUICK, data_of, made, rows_of, threat_folder, unpacked
from results_builder import campaign_results, stored
from vestige.cli.campaigns.report import command
from vestige.errors import VestigeError

MEGABYTE = 1e6


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("store") / "my run.zarr", "quick", *QUICK)


def report(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def refused(*arguments: object) -> str:
    with pytest.raises(VestigeError) as caught:
        CliRunner().invoke(command, [str(one) for one in arguments], standalone_mode=False, catch_exceptions=False)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_page_of_a_run(store: Path, tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    result = report(store, "-o", file, "--question", "How <often>?")
    assert (result.exit_code, result.stdout, result.stderr) == (0, f"{file}\n", "")
    page = file.read_text(encoding="utf-8")
    assert "<title>my run: one satellite</title>" in page
    assert '<p class="question">How &lt;often&gt;?</p>' in page
    assert "vestige run scenario.toml -o my_run.zarr" in page
    assert report(store, "-o", file).exit_code == 0  # over an earlier one


def test_the_same_run_has_the_same_page(store: Path, tmp_path: Path) -> None:
    pages = []
    for name in ("a", "b"):
        again = made(tmp_path / name / "my run.zarr", "quick", *QUICK)
        assert report(again, "-o", tmp_path / f"{name}.html").exit_code == 0
        pages.append((tmp_path / f"{name}.html").read_bytes())
    assert pages[0] == pages[1]


def test_a_page_of_a_threat_table(tmp_path: Path) -> None:
    folder = threat_folder(tmp_path / "threats")
    assert report(folder, "-o", tmp_path / "t.html").exit_code == 0
    assert "<title>threats: attack against mitigation level</title>" in (tmp_path / "t.html").read_text(
        encoding="utf-8"
    )


def test_a_long_run_is_a_small_page_that_says_what_it_left_out(tmp_path: Path) -> None:
    file = tmp_path / "long.html"
    assert report(made(tmp_path / "long.zarr", "quick", "epochs=40000"), "-o", file).exit_code == 0
    assert file.stat().st_size < 3 * MEGABYTE
    page = file.read_text(encoding="utf-8")
    missed = int(rows_of(page, "Range offset, percentiles of the detections")["early detector"][0])
    assert missed > 0
    (drawn,) = data_of(page)["satellites"]
    offset_m = unpacked(drawn["offset_m"]["early"])
    assert np.count_nonzero(np.isnan(offset_m)) == missed
    assert "every 4th of the epochs; besides, all misses, all alarms, all outermost offsets." in page


def test_long_banks_and_several_attacks_keep_the_page_small(tmp_path: Path) -> None:
    attack = '{kind="lift-off", start_s=5, delay_m=20.0, power_db=3.0, bands=["E6"]}'
    settings = ("processor.n_taps=63", "processor.tap_spacing_m=2", f"attack=[{attack}, {attack}, {attack}]")
    store = made(tmp_path / "a.zarr", "liftoff", "epochs=7000", 'fidelity="correlators"', *settings)
    assert report(store, "-o", tmp_path / "a.html").exit_code == 0
    assert (tmp_path / "a.html").stat().st_size < 3 * MEGABYTE


def test_bad_input_is_one_line_with_the_file(store: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.html"
    sweep = tmp_path / "sweep"
    sweep.mkdir()
    (sweep / "sweep.csv").write_text("seed\n1\n")
    broken = threat_folder(tmp_path / "threats", {"detected": "many"})
    text = tmp_path / "text"
    text.write_text("hello")
    expected = "expected the store of `vestige run -o`, or the folder of `vestige threats -o`"
    good, other = threat_folder(tmp_path / "good"), tmp_path / "other.zarr"
    for store_of_something_else in (good / "threats.zarr", other):
        xarray.Dataset({"a": 1.0}).to_zarr(store_of_something_else, consolidated=False)
    for path, message in (
        (tmp_path / "nothing", f"found nothing, {expected}"),
        (tmp_path, f"found a folder without results, {expected}"),
        (text, f"found another file, {expected}"),
        (good / "threats.zarr", "found the store of a threat table, expected the folder that contains this store"),
        (other, "found no results of a campaign, expected the results of a campaign"),
        (stored(campaign_results(3), tmp_path / "foreign"), "found no status, expected results of `vestige run`"),
        (sweep, "found a sweep, expected one of the stores in this folder"),
    ):
        line = refused(path, "-o", out)
        assert line.startswith(f"{path}: ")
        assert message in line
    assert refused(broken, "-o", out).startswith(f"{broken / 'threats.csv'}: row 2, detected: found many, expected")
    assert not out.exists()
    out.write_text("something of mine")
    assert refused(store, "-o", out).startswith(f"{out}: output: found a file that is not a report")
    assert out.read_text() == "something of mine"


@pytest.mark.parametrize(
    "arguments", [(), ("x.zarr",), ("x.zarr", "-o", "a.pdf"), ("x.zarr", "y.zarr", "-o", "a.html")]
)
def test_usage_errors(arguments: tuple[str, ...]) -> None:
    result = report(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""


def test_help() -> None:
    assert "needs no network" in report("--help").stdout


def test_a_page_is_not_written_into_results(store: Path) -> None:
    before = sorted(store.rglob("*"))
    line = refused(store, "-o", store / "a.html")
    assert line.startswith(f"{store / 'a.html'}: output: found a path in the results {store.name}")
    assert sorted(store.rglob("*")) == before
