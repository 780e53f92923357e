"""`vestige search` from files: a small recording of open codes, RECS made for it, the three searches."""

from __future__ import annotations

import json
import re
import shutil
from contextlib import closing
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from night import TWO_SATELLITES, invoke
from vestige.cli.recordings.searches import search as module
from vestige.cli.recordings.searches.search import command as search
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.services.recs_make import command as recs_make
from vestige.errors import InputFileError, VestigeError
from vestige.sample_processor.search.engines import choice
from vestige.sample_processor.search.engines.engine import EngineUnavailableError


def _json(*arguments: object) -> dict:
    result = invoke(search, *arguments, "--json")
    if result.exception is not None:
        raise result.exception
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    room = tmp_path_factory.mktemp("search")
    (room / "scenario.toml").write_text(TWO_SATELLITES)
    assert invoke(simulate, room / "scenario.toml", "-o", room / "night").exception is None
    made = invoke(
        recs_make, "--from-recording", room / "night", "--keys", room / "night" / "osnma" / "keys.csv",
        "--public-key", room / "night" / "osnma" / "public_key.pem", "-o", room / "night" / "assistance",
        "--svids", "3,8", "--json",
    )  # fmt: skip
    assert made.exception is None
    return room / "night"


def test_e1_lists_one_signal_for_each_satellite(night: Path) -> None:
    told = _json("e1", night, "--svids", "1-9", "--periods", 4)
    found = told["signals"]
    assert [one["svid"] for one in found] == [3, 8]
    assert all(one["measured"] for one in found)
    for one, cn0_dbhz, rate_mps in zip(found, (45.0, 43.0), (-120.0, 310.5), strict=True):
        assert one["doppler_hz"] == pytest.approx(-rate_mps / 299_792_458 * 1575.42e6, abs=3)
        assert one["cn0_dbhz"] == pytest.approx(cn0_dbhz, abs=1.5)
        assert one["statistic"] > one["threshold"]
    assert (told["first_sample"], told["jumps"]) == (0, [])
    assert told["time"].startswith("2026-11-21T12:00:16.0")
    text = invoke(search, "e1", night, "--svids", "3", "--periods", 2).stdout
    first, second = text.splitlines()
    assert first.startswith("at 2026-11-21T12:00:16.0")
    assert second.startswith("E03  code phase")
    assert "spoofing" not in text


def test_handover_finds_each_recs_once(night: Path) -> None:
    result = _json("handover", night, "--svids", "3,8", "--uncertainty-s", "0.1")
    assert result["complete"]
    assert [(one["svid"], one["spoofed"], len(one["peaks"])) for one in result["satellites"]] == [
        (3, False, 1),
        (8, False, 1),
    ]
    told = invoke(search, "handover", night, "--svids", "3", "--uncertainty-s", "0.1")
    assert re.search(r"E03  \d+ hypotheses, P_FA 0.001: threshold \d\.\d\d σ, .* dBHz for P_d 0.9", told.stderr)
    text = told.stdout
    assert "true: the earliest" in text


@pytest.mark.parametrize("verb", ["handover", "exhaustive"])
def test_recs_are_decrypted_in_the_cipher_mode_of_the_command(night: Path, verb: str) -> None:
    """They are encrypted in CBC, so decrypted in CTR they are noise."""
    more = () if verb == "handover" else ("--integration-ms", "16", "--doppler-span-hz", "1000")
    found = _json(verb, night, "--svids", "8", "--uncertainty-s", "0.005", "--cipher-mode", "ctr", *more)
    assert [one["peaks"] for one in found["satellites"]] == [[]]


@pytest.mark.slow
def test_exhaustive_finds_what_the_handover_finds(night: Path) -> None:
    """Open E6-C repeats its primary code every millisecond: the window is the travel time of one satellite ± 0.2 ms."""
    handed = _json("handover", night, "--svids", "8", "--uncertainty-s", "0.1")["satellites"][0]["peaks"][0]
    result = invoke(
        search, "exhaustive", night, "--svids", "8", "--uncertainty-s", "0.01", "--doppler-span-hz", "1500",
        "--integration-ms", "16", "--engine", "segment", "--json",
    )  # fmt: skip
    assert result.exception is None
    strongest = max(json.loads(result.stdout)["satellites"][0]["peaks"], key=lambda one: one["magnitude_sigma"])
    assert strongest["start_fraction_s"] == pytest.approx(handed["start_fraction_s"], abs=0.05e-6)
    assert strongest["doppler_hz"] == pytest.approx(handed["doppler_hz"], abs=10)
    for line in ("hypotheses", "P_FA of all", "threshold", "C/N0 for P_d 0.9", "expected run time"):
        assert line in result.stderr
    assert re.search(r"^engine +segment \(processor\)$", result.stderr, re.MULTILINE)


def test_a_search_says_which_engine_it_took_and_refuses_one_that_does_not_run(
    night: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_gpu() -> str:
        raise EngineUnavailableError("cuda", "CuPy cannot be imported", "pip install 'vestige[cuda]'")

    monkeypatch.setattr(choice, "FASTEST_FIRST", ("cuda", "fft"))
    monkeypatch.setitem(choice._WHERE, "cuda", no_gpu)
    command = ("exhaustive", night, "--svids", "8", "--uncertainty-s", "0.001", "--integration-ms", "1")
    told = invoke(search, *command).stderr
    assert re.search(r"^engine +fft \(processor\); no cuda: CuPy cannot be imported$", told, re.MULTILINE)
    refused = invoke(search, *command, "--engine", "cuda").exception
    assert isinstance(refused, VestigeError)
    assert str(refused) == ("engine cuda: CuPy cannot be imported: pip install 'vestige[cuda]', or take --engine auto")


def test_an_interrupted_search_says_what_it_found(night: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch, SearchState
    from vestige.sample_processor.search.peak import Peak
    from vestige.time import GalileoTime

    peak = Peak(
        svid=8, start_time=GalileoTime(1420, 7, 0.25), doppler_hz=1.0, magnitude=9.0, threshold=7.0, cn0_dbhz=42.0
    )

    def run(*_arguments: object, **_options: object) -> object:
        yield SearchState(done=1.0, total=4.0, peaks=(peak,), block_start=peak.start_time)
        raise KeyboardInterrupt

    monkeypatch.setattr(ExhaustiveSearch, "run", run)
    monkeypatch.setattr("vestige.sample_processor.search.speed.expected_seconds", lambda *_: 1.0)
    result = CliRunner().invoke(search, ["exhaustive", str(night), "--svids", "8"])
    assert result.exit_code == module.INTERRUPTED
    assert "E08" in result.stdout
    assert "INTERRUPTED" in result.stdout
    assert "25.0%" in result.stderr
    assert "found: E08" in result.stderr
    result = CliRunner().invoke(search, ["exhaustive", str(night), "--svids", "8", "--json"])
    assert json.loads(result.stdout)["complete"] is False


@pytest.mark.slow
def test_a_killed_search_continues(night: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed behind its second block: what was kept is what an uninterrupted search comes through, to the last bit."""
    from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch

    command = ("exhaustive", night, "--svids", "8", "--uncertainty-s", "0.01", "--doppler-span-hz", "1500")
    whole, cut = tmp_path / "whole.json", tmp_path / "cut.json"
    expected = _json(*command, "-o", whole)
    run = ExhaustiveSearch.run

    def killed(*arguments: object, **options: object) -> object:
        with closing(run(*arguments, **options)) as states:  # type: ignore[arg-type]
            yield next(states)
            yield next(states)
            raise SystemError("power cut")

    monkeypatch.setattr(ExhaustiveSearch, "run", killed)
    monkeypatch.setattr("vestige.cli.recordings.searches.search_report.REPORT_EVERY_S", -1.0)
    assert isinstance(invoke(search, *command, "-o", cut).exception, SystemError)
    ((name, kept),) = json.loads(cut.read_bytes())["states"].items()
    assert name == "2026-11-21T12:00:16.000 GST"
    assert kept["blocks"] == 2
    monkeypatch.setattr(ExhaustiveSearch, "run", run)
    result = invoke(search, *command, "-o", cut, "--json")
    assert json.loads(result.stdout) == expected
    assert "continues after" in result.stderr
    assert cut.read_bytes() == whole.read_bytes()
    other = invoke(search, *command, "-o", cut, "--p-fa-overall", "0.01").exception
    assert isinstance(other, VestigeError)
    assert "search of another P_FA" in str(other)
    swapped = tmp_path / "swapped"
    shutil.copytree(night, swapped)
    samples = swapped / "e6.sigmf-data"
    samples.write_bytes(samples.read_bytes()[::-1])
    other = invoke(search, "exhaustive", swapped, *command[2:], "-o", cut).exception
    assert "search of another recording" in str(other)


def test_what_was_found_is_not_written_over_the_recording(night: Path) -> None:
    before = {path: path.stat().st_size for path in night.rglob("*")}
    for name in ("e6.sigmf-data", "new.json", "assistance/keys.csv"):
        refused = invoke(search, "exhaustive", night, "--svids", "8", "-o", night / name).exception
        assert isinstance(refused, InputFileError)
        assert f"{name}: output: found a path in the input folder" in str(refused)
    assert {path: path.stat().st_size for path in night.rglob("*")} == before


@pytest.mark.slow
def test_what_came_when_the_key_may_have_been_known_proves_nothing(night: Path) -> None:
    """The clock is good to 100 s only, and the key was on air a minute later."""
    text = invoke(search, "handover", night, "--svids", "8", "--uncertainty-s", "100").stdout
    assert "proves nothing" in text
    (result,) = _json("handover", night, "--svids", "8", "--uncertainty-s", "100")["satellites"]
    assert (result["true_start_time"], result["spoofed"]) == (None, False)
    assert [one["before_disclosure"] for one in result["peaks"]] == [False]
    (near,) = _json("handover", night, "--svids", "8", "--uncertainty-s", "0.1")["satellites"]
    assert near["true_start_time"] == near["peaks"][0]["start_time"]


def test_a_label_that_is_wrong_within_the_uncertainty_keeps_its_recs(night: Path) -> None:
    command = ("handover", night, "--svids", "8", "--start", "2026-11-21T12:00:20 GST", "--json")
    assert isinstance(invoke(search, *command, "--uncertainty-s", "0.1").exception, VestigeError)
    (result,) = _json(*command[:-1], "--uncertainty-s", "6")["satellites"]
    assert len(result["peaks"]) == 1


def test_what_is_missing_is_one_line(night: Path, tmp_path: Path) -> None:
    with pytest.raises(VestigeError, match="no RECS of these satellites"):
        raise invoke(search, "handover", night, "--svids", "30").exception  # type: ignore[misc]
    (tmp_path / "e1.bin").write_bytes(bytes(2_000_000))
    (tmp_path / "recording.toml").write_text(
        'start = "2026-11-21T12:00:16 GST"\nsample_rate_hz = 6.2e6\n[e1]\nfile = "e1.bin"\nformat = "int8"\n'
        'layout = "iq"\ncenter_frequency_hz = 1575.42e6\n'
    )
    with pytest.raises(VestigeError, match="no E6 samples"):
        raise invoke(search, "exhaustive", tmp_path).exception  # type: ignore[misc]
    assert _json("e1", tmp_path, "--svids", "3", "--periods", "1")["signals"] == []
    assert invoke(search, "e1", tmp_path, "--svids", "3", "--periods", "1").stdout == "no signal found\n"


@pytest.mark.slow
def test_a_search_is_drawn(night: Path, tmp_path: Path) -> None:
    common = ("--uncertainty-s", "0.001", "--svids", "8")
    _json("e1", night, "--svids", "8", "--periods", 2, "--plot", tmp_path / "e1.png")
    _json("handover", night, *common, "--plot", tmp_path / "handover.pdf")
    _json("exhaustive", night, *common, "--doppler-span-hz", 1500, "--plot", tmp_path / "exhaustive.svg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["e1.png", "exhaustive.svg", "handover.pdf"]
    for arguments in (
        ("e1", night, "--svids", "3,8", "--plot", tmp_path / "a.png"),
        ("e1", night, "--svids", "8", "--plot", tmp_path / "a.gif"),
        ("handover", night, "--svids", "3,8", "--plot", tmp_path / "a.png"),
    ):
        assert isinstance(invoke(search, *arguments).exception, click.UsageError)
