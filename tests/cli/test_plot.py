from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from click.testing import CliRunner, Result
from PIL import Image

from results_builder import RecordedPlan, campaign_results, lift_off, stored
from vestige.campaign.run import run as run_campaign
from vestige.cli.campaigns.plot import FORMATS, KINDS, command
from vestige.errors import InputFileError, VestigeError
from vestige.plots import figure

OF_A_CAMPAIGN = [
    name
    for name, kind in KINDS.items()
    if not (kind.of_sweep or kind.of_attack or kind.of_sky or kind.of_threats) and "png" in kind.formats
]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return campaign_results(150, cn0_dbhz=32.0)


@pytest.fixture(scope="module")
def store(results: xarray.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stored(results, tmp_path_factory.mktemp("store") / "harsh.zarr")


def plot(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def refused(*arguments: object) -> str:
    with pytest.raises(VestigeError) as caught:
        CliRunner().invoke(command, [str(one) for one in arguments], standalone_mode=False, catch_exceptions=False)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("kind", OF_A_CAMPAIGN)
def test_every_kind(kind: str, store: Path, tmp_path: Path) -> None:
    file = tmp_path / "figure.png"
    result = plot(kind, store, "-o", file, "--detector", "maximum", "--width-cm", 10, "--from", 20, "--to", 100)
    assert (result.exit_code, result.stdout, result.stderr) == (0, f"{file}\n", "")
    with Image.open(file) as image:
        assert image.size[0] == pytest.approx(10 / 2.54 * 300, abs=1)


@pytest.mark.parametrize("kind", ["sky", "position", "monitors"])
def test_a_sky_is_needed(kind: str, store: Path, tmp_path: Path) -> None:
    assert "[constellation]" in refused(kind, store, "-o", tmp_path / "a.png")


def test_what_one_line_of_sight_lacks_is_said(store: Path, tmp_path: Path) -> None:
    line = refused("sky", store, "-o", tmp_path / "a.png")
    assert "because its scenario has one line of sight" in line
    assert "`vestige init` writes" in line


def test_the_folder_of_a_figure_is_made_and_none_is_left_empty(store: Path, tmp_path: Path) -> None:
    file = tmp_path / "new" / "figures" / "range.png"
    assert "found no elevation_deg" in refused("sky", store, "-o", file)
    two = stored(campaign_results(3, svids=(1, 2)), tmp_path / "2")
    assert "expected one of 1, 2: give --svid" in refused("all", two, "-o", tmp_path / "new" / "figures")
    assert not (tmp_path / "new").exists()
    result = plot("all", store, "-o", file)
    assert result.exit_code == 2
    assert "all writes a folder of figures" in result.stderr
    assert not (tmp_path / "new").exists()
    assert plot("range-histogram", store, "-o", file).exit_code == 0
    assert file.exists()


def test_all(store: Path, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "figures"
    result = plot("all", store, "-o", folder)
    assert result.exit_code == 0
    files = [folder / f"{kind}.png" for kind in OF_A_CAMPAIGN]
    assert result.stdout.splitlines() == [str(file) for file in files]
    assert sorted(folder.iterdir()) == sorted(files)


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stored(campaign_results(150, spoofer=lift_off), tmp_path_factory.mktemp("store") / "attacked.zarr")


def test_all_of_an_attack_is_of_both_detectors(attacked: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which files there are; `test_all` writes figures, and the tests of the plots draw those of an attack."""
    monkeypatch.setattr("vestige.plots.write", lambda _, path, **__: path.touch())
    result = plot("all", attacked, "-o", tmp_path, "--detector", "maximum")
    assert result.exit_code == 0
    names = [*OF_A_CAMPAIGN, "attack-comparison", "detecting-correlator-early", "range-offset-early"]
    assert sorted(tmp_path.iterdir()) == sorted(tmp_path / f"{name}.png" for name in names)


def test_the_other_detector_is_the_other_one(attacked: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    titles = {}
    monkeypatch.setattr("vestige.plots.write", lambda ax, path, **_: titles.update({path.stem: ax.get_title()}))
    assert plot("all", attacked, "-o", tmp_path).exit_code == 0
    assert "early" in titles["range-offset"]
    assert "maximum" in titles["range-offset-maximum"]
    assert "maximum" in titles["detecting-correlator-maximum"]


def test_attack_comparison_and_animation(attacked: Path, tmp_path: Path) -> None:
    for kind, name in (("attack-comparison", "a.png"), ("animation", "a.gif")):
        file = tmp_path / name
        result = plot(kind, attacked, "-o", file, "--from", 100, "--to", 103)
        assert (result.exit_code, result.stdout, result.stderr) == (0, f"{file}\n", "")
    with Image.open(tmp_path / "a.gif") as image:
        assert getattr(image, "n_frames", 1) == 3


def test_without_an_attack_there_is_nothing_to_compare(store: Path, tmp_path: Path) -> None:
    line = refused("attack-comparison", store, "-o", tmp_path / "a.png")
    assert line.startswith(f"{store}: ")
    assert "found no attack" in line


@pytest.mark.parametrize("suffix", FORMATS)
def test_formats(store: Path, tmp_path: Path, suffix: str) -> None:
    assert plot("range-offset", store, "-o", tmp_path / f"a.{suffix}").exit_code == 0
    assert (tmp_path / f"a.{suffix}").exists()


def test_formats_are_those_of_the_library() -> None:
    assert FORMATS == figure.FIGURE_FORMATS


def _drawn(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Return the points of every line of the figure that a command draws."""
    lines = []

    def keep(ax: figure.Axes, path: Path, *, width_cm: float) -> None:
        lines.extend(tuple(tuple(np.asarray(values).tolist()) for values in line.get_data()) for line in ax.lines)

    monkeypatch.setattr("vestige.plots.write", keep)
    result = plot(*arguments)
    assert result.exit_code == 0, result.output
    return lines


def test_the_figure_is_of_the_detector_the_satellite_and_the_time_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = campaign_results(50, svids=(4, 9), cn0_dbhz=50.0)
    path = stored(results, tmp_path / "two.zarr")
    chosen = ("--svid", 9, "--detector", "maximum", "--from", 10, "--to", 20)
    lines = _drawn(monkeypatch, "range-offset", path, "-o", tmp_path / "a.png", *chosen)
    expected = results["range_offset_m"].values[1, 10:20, 1].astype(float)
    assert (tuple(range(10, 20)), tuple(expected.tolist())) in lines


def test_a_flank_is_fitted(store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ((x, _),) = _drawn(monkeypatch, "range-histogram", store, "-o", tmp_path / "a.png", "--flank-from", 2)
    assert x[0] == 2.0


def test_sweep_of_campaigns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaigns = {cn0: campaign_results(100, cn0_dbhz=cn0) for cn0 in (31.0, 29.0)}
    paths = [stored(results, tmp_path / f"{cn0}.zarr") for cn0, results in campaigns.items()]
    lines = _drawn(monkeypatch, "detection-curve", *paths, "-o", tmp_path / "a.png")
    frequencies = tuple(float(np.mean(campaigns[cn0]["tap_index"].values[0] >= 0)) for cn0 in (29.0, 31.0))
    assert ((29.0, 31.0), frequencies) in lines


@pytest.mark.parametrize("kind", ["detection-curve", "miss-curve", "false-alarm-curve"])
def test_sweep_from_a_table(kind: str, tmp_path: Path) -> None:
    table = tmp_path / "sweep.csv"
    table.write_text(
        "cn0_dbhz,trials,detections,false_alarm_trials,false_alarms,integration_s,p_fa\n"
        "30,1000,560,100000,9,0.016,1e-4\n32,1000,1000,100000,12,0.016,1e-4\n"
    )
    result = plot(kind, table, "-o", tmp_path / "a.png")
    assert (result.exit_code, result.stdout) == (0, f"{tmp_path / 'a.png'}\n")


def test_a_campaign_that_has_not_ended(tmp_path: Path) -> None:
    path = tmp_path / "half.zarr"
    with pytest.raises(RuntimeError, match="in the middle"):
        run_campaign(RecordedPlan(results=campaign_results(40), breaks_at=25), path, chunk_epochs=10)
    result = plot("waterfall-map", path, "-o", tmp_path / "a.png")
    assert result.exit_code == 0
    assert "20 epochs" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_bad_input_is_one_line_with_the_file(store: Path, tmp_path: Path, results: xarray.Dataset) -> None:
    out = tmp_path / "a.png"
    no_store, text, two = (
        tmp_path / "none.zarr",
        tmp_path / "text",
        stored(campaign_results(3, svids=(1, 2)), tmp_path / "2"),
    )
    text.write_text("hello")
    foreign = stored(results.drop_vars("taps").drop_vars("tap_offset_m"), tmp_path / "foreign")
    for path, more, message in (
        (no_store, (), "expected the results of a campaign"),
        (text, (), "expected the results of a campaign"),
        (tmp_path, (), "expected the results of a campaign"),
        (foreign, (), "found no taps"),
        (two, (), "expected one of 1, 2"),
        (store, ("--svid", 5), "no satellite 5, expected one of 11"),
        (store, ("--from", 1000), "found 0 to 149 s, expected an epoch from 1000 s"),
    ):
        line = refused("range-offset", path, "-o", out, *more)
        assert line.startswith(f"{path}: ")
        assert message in line
    assert str(tmp_path / "t.csv") in _missing_table(tmp_path)
    assert not out.exists()


def _missing_table(tmp_path: Path) -> str:
    with pytest.raises(InputFileError) as caught:
        CliRunner().invoke(
            command, ["detection-curve", str(tmp_path / "t.csv"), "-o", str(tmp_path / "a.png")],
            standalone_mode=False, catch_exceptions=False,
        )  # fmt: skip
    return str(caught.value)


@pytest.mark.parametrize(
    "arguments",
    [
        ("landscape", "x.zarr", "-o", "a.png"),
        ("waterfall", "-o", "a.png"),
        ("waterfall", "x.zarr"),
        ("waterfall", "x.zarr", "-o", "a.gif"),
        ("animation", "x.zarr", "-o", "a.png"),
        ("waterfall", "x.zarr", "y.zarr", "-o", "a.png"),
        ("waterfall", "x.zarr", "-o", "a.png", "--width-cm", "1"),
        ("waterfall", "x.zarr", "-o", "a.png", "--width-cm", "nan"),
        ("range-offset", "x.zarr", "-o", "a.png", "--from", "nan"),
        ("range-offset", "x.zarr", "-o", "a.png", "--detector", "late"),
    ],
)
def test_usage_errors(arguments: tuple[str, ...]) -> None:
    result = plot(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""


def test_help_names_every_kind() -> None:
    text = plot("--help").stdout
    for name, kind in KINDS.items():
        assert name in text
        assert kind.help in text


def test_a_figure_is_not_written_into_results(store: Path) -> None:
    before = sorted(store.rglob("*"))
    line = refused("range-offset", store, "-o", store / "a.png")
    assert line.startswith(f"{store / 'a.png'}: output: found a path in the results {store.name}")
    assert sorted(store.rglob("*")) == before
