"""A jammer that is stronger than int8 holds: `vestige simulate` says how much clips, and what to do about it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from vestige.cli.main import main
from vestige.cli.recordings.simulate import command as simulate
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.records import Band
from vestige.simulated import simulated_recording
from vestige.simulated.clipping import clipping_warning, largest_level, n_clipped
from vestige.simulated.unfinished_recording import unfinished_folder

QUICK = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
CHIRP = (
    'attack=[{kind="jamming", start_s=0, j_over_n_db=30, bands=["E6"], waveform={kind="chirp", bandwidth_hz=2e6}}]',
    "receiver.sample_rate_hz=3e6",
)
GAIN = ("receiver.front_end.bits=8", 'fidelity="samples"')


def simulated(*arguments: object, settings: tuple[str, ...] = CHIRP) -> Result:
    words = ["--epochs", "5:6", *(f"--set={one}" for one in settings), *map(str, arguments)]
    result = CliRunner().invoke(simulate, [str(QUICK), *words], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result


def warnings(result: Result) -> list[str]:
    return [line for line in result.stderr.splitlines() if line.startswith("warning")]


def test_one_line_says_how_much_clips_and_what_to_do(tmp_path: Path) -> None:
    (line,) = warnings(simulated("-o", tmp_path / "a"))
    samples = np.fromfile(tmp_path / "a" / "e6.sigmf-data", np.int8)
    share = np.mean(np.abs(samples.astype(int)) >= 127)
    assert share > 0.8
    assert f"{100 * share:.2g} % of the numbers of E6 clip" in line
    assert "E1" not in line
    advice = re.findall(r"--set '?([^' ]+)'?", line)
    assert warnings(simulated("-o", tmp_path / "b", settings=(*CHIRP, *advice))) == []  # what it says helps
    assert tuple(advice) == GAIN


def test_through_a_pipe(tmp_path: Path) -> None:
    (line,) = warnings(simulated("-o", "-", "--band", "both"))
    assert "% of the numbers of E6 clip" in line
    assert "E1" not in line
    assert warnings(simulated("-o", "-", "--band", "e1")) == []
    assert warnings(simulated("-o", "-", "--band", "e6", "--format", "float32")) == []


@pytest.mark.parametrize("output", [("-o", "-", "--band", "e6"), ("-o", "{}/quiet")])
def test_quiet_keeps_the_line(
    tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes], output: tuple[str, ...]
) -> None:
    """With `--quiet` one line stands for all warnings; of a single warning it is the warning itself."""
    words = [one.format(tmp_path) for one in output]
    with pytest.raises(SystemExit) as stop:
        main(["simulate", str(QUICK), "--epochs", "5:6", *(f"--set={one}" for one in CHIRP), "--quiet", *words])
    assert not stop.value.code
    (line,) = capfdbinary.readouterr().err.decode().splitlines()
    assert line.startswith("warning: ")
    assert line.count("warning") == 1
    assert "% of the numbers of E6 clip" in line


def test_a_gain_that_does_not_follow_the_power(tmp_path: Path) -> None:
    settings = (*CHIRP, *GAIN, "receiver.front_end.agc=false")
    for component in ("int8", "int16"):
        (line,) = warnings(simulated("-o", tmp_path / component, "--format", component, settings=settings))
        assert line.endswith("receiver.front_end.agc = true")


def test_samples_of_a_killed_process_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The share is that of the whole file, wherever the process was killed."""
    (whole,) = warnings(simulated("-o", tmp_path / "a"))
    monkeypatch.setattr(simulated_recording, "_KEPT_BATCHES", 5)

    class KilledError(BaseException):
        pass

    def killed(*_: object) -> None:
        raise KilledError

    with monkeypatch.context() as patch:
        patch.setattr(simulated_recording, "write_collection", killed)
        patch.setattr("vestige.simulated.unfinished_recording.shutil.rmtree", lambda *_, **__: None)
        with pytest.raises(KilledError):
            simulated("-o", tmp_path / "b")
    assert unfinished_folder(tmp_path / "b").exists()
    resumed = simulated("-o", tmp_path / "b")
    assert "resumes" in resumed.stderr
    assert warnings(resumed) == [whole]


def test_what_is_not_clipping() -> None:
    assert largest_level("float32", FrontEnd(sample_rate_hz=1e7)) is None
    assert largest_level("int8", FrontEnd(sample_rate_hz=1e7, bits=2)) is None  # its outermost levels are in use
    assert n_clipped(np.ones(3), None) == 0
    assert clipping_warning({Band.E1: 1e-3, Band.E6: 0.0}, FrontEnd(sample_rate_hz=1e7)) == ""
    pulses = clipping_warning({Band.E1: 0.01}, FrontEnd(sample_rate_hz=1e7, bits=8))
    assert "1 % of the numbers of E1 clip" in pulses
    assert "shorter pulses" in pulses
