"""Samples of a band or both to standard output: the bytes of the file, and a silent end when nobody reads on."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result

from vestige.cli.recordings.simulate import command as simulate

QUICK = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
SETTINGS = ("--epochs", "5:7", "--set", "receiver.sample_rate_hz=3e6", "--set", "interval_s=0.1")


def invoked(*arguments: object) -> Result:
    return CliRunner().invoke(simulate, [str(one) for one in (QUICK, *SETTINGS, *arguments)], standalone_mode=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("pipe") / "case"
    assert invoked("-o", output).exception is None
    return output


@pytest.mark.parametrize(("band", "workers"), [("e1", 1), ("e6", 3)])
def test_the_bytes_are_those_of_the_file(folder: Path, band: str, workers: int) -> None:
    result = invoked("-o", "-", "--band", band, "-j", workers)
    assert result.exception is None
    assert result.stdout_bytes == (folder / f"{band}.sigmf-data").read_bytes()
    center_hz = {"e1": 1575420000, "e6": 1278750000}[band]
    first, *rest = result.stderr.splitlines()
    assert (
        first
        == f"0.4 s of {band.upper()}: int8 I,Q at 3000000 Hz around {center_hz} Hz, from 2026-11-21T12:00:00.500 GST"
    )
    assert rest == [f"{band.upper()} samples"]


@pytest.mark.parametrize("component", ["int8", "int16"])
def test_both_bands_take_turns(folder: Path, component: str) -> None:
    """E1[0] E6[0] E1[1] E6[1] …, each I and then Q: every other pair is that of the band's own pipe."""
    result = invoked("-o", "-", "--band", "both", "--format", component)
    assert result.exception is None
    frames = np.frombuffer(result.stdout_bytes, component).reshape(-1, 2, 2)
    for place, band in enumerate(("e1", "e6")):
        if component == "int8":
            expected = np.fromfile(folder / f"{band}.sigmf-data", np.int8)
        else:
            alone = invoked("-o", "-", "--band", band, "--format", component)
            expected = np.frombuffer(alone.stdout_bytes, component)
        assert np.array_equal(frames[:, place].ravel(), expected)
    first, *rest = result.stderr.splitlines()
    assert first == (
        f"0.4 s of E1 and E6, sample by sample in turn: {component} I,Q at 3000000 Hz around 1575420000 Hz and "
        "1278750000 Hz, from 2026-11-21T12:00:00.500 GST"
    )
    assert rest == ["E1 and E6 samples"]


def test_another_number_format(folder: Path) -> None:
    wide = np.frombuffer(invoked("-o", "-", "--band", "e6", "--format", "int16").stdout_bytes, "<i2")
    narrow = np.fromfile(folder / "e6.sigmf-data", np.int8)
    assert np.abs(wide / 50.0 - narrow).max() <= 0.51  # 1000 and 20 counts of one unit


@pytest.mark.parametrize(
    "options",
    [("-o", "-"), ("-o", "-", "--band", "e1", "--export", "gnss-sdr"), ("-o", "folder", "--band", "e1")],
)
def test_options_that_do_not_go_together(options: tuple[str, ...]) -> None:
    result = invoked(*options)
    assert isinstance(result.exception, click.UsageError)
    assert "\n" not in str(result.exception)


@pytest.mark.slow
def test_a_reader_that_has_enough_ends_it_without_a_message() -> None:
    """The pipe holds 64 KiB and the recording 18 MB, so the writer meets the end of the reader."""
    arguments = [sys.executable, "-m", "vestige", "simulate", str(QUICK), *SETTINGS, "--epochs", "5:35", "-o", "-"]
    process = subprocess.Popen([*arguments, "--band", "e1"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)  # noqa: S603
    assert process.stdout is not None
    assert process.stderr is not None
    assert len(process.stdout.read(100_000)) == 100_000
    process.stdout.close()
    said = process.stderr.read().decode().splitlines()
    assert process.wait(60) == 0
    assert len(said) == 2, said  # what it is, and the step
    process.stderr.close()
