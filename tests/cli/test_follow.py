"""`process --follow`: a recording that is written while it is read has the verdicts of the finished one."""

from __future__ import annotations

import gc
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from night import invoke
from vestige.cli.main import main
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.errors import InputFileError, VestigeError
from vestige.recording.live.follow_journal import LINES, STATE, FollowJournal, FollowProgress
from vestige.recording.live.following import Following
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase, with_default_range
from vestige.simulated.exported_case_folder import write_companions

QUICK = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
FS = 6.2e6
SETTINGS = (
    f"receiver.sample_rate_hz={FS}", "interval_s=0.2", "receiver.cn0_dbhz=45.0", "receiver.cn0_e1_dbhz=43.0",
)  # fmt: skip
N_EPOCHS = 6
SLOW = pytest.mark.slow  # levels 2 and 3 search the samples
UNSURE = ("--time-uncertainty", "0.2", "--search-window", "2e-4")  # the searches of levels 2 and 3 look as far as that
GROWING = ("e1.sigmf-data", "e6.sigmf-data", "observations.csv")
FAST = ("--follow", "--poll-s", "0.02")
AGREEMENTS = ["PASS"] + ["NOT_RUN"] * (N_EPOCHS - 1)  # a subframe is compared once; all RECS are of one subframe
SEARCH_1_MS = ("--search-ms", "1")  # where the searches are not what is tested
ONCE = (*FAST, "--idle-s", "0.3", "--json")


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("follow") / "night"
    chosen = [argument for setting in SETTINGS for argument in ("--set", setting)]
    result = invoke(simulate, QUICK, "--epochs", f"0:{N_EPOCHS}", "-o", folder, *chosen)
    assert result.exception is None
    return folder


@pytest.fixture(scope="module")
def expected(night: Path) -> Callable[[str], list[dict]]:
    """The verdicts of the finished recording at a level."""
    known: dict[str, list[dict]] = {}

    def at(level: str) -> list[dict]:
        if level not in known:
            result = invoke(process, night, "--level", level, *UNSURE, "--json")
            assert result.exception is None
            known[level] = json.loads(result.stdout)["verdicts"]
            assert [one["status"] for one in known[level]] == ["AUTHENTIC"] * N_EPOCHS
        return known[level]

    return at


def _begun(night: Path, folder: Path) -> Path:
    """Return a copy of the recording of which no sample, observation or key is there yet."""
    shutil.copytree(night, folder, ignore=shutil.ignore_patterns("*.sigmf-data", "rinex"))
    (folder / "assistance" / "keys.csv").unlink()
    for name in GROWING:
        (folder / name).write_bytes(b"")
    return folder


def _append(source: Path, target: Path, part: float) -> None:
    data = source.read_bytes()
    with target.open("ab") as stream:
        stream.write(data[stream.tell() : round(part * len(data))])


@contextmanager
def _written(night: Path, folder: Path, *, n_steps: int, pause_s: float, keys_at: float) -> Iterator[None]:
    """Write a recording in pieces that end anywhere, the keys in two halves from a part of it on."""

    def write() -> None:
        for step in range(1, n_steps + 1):
            part = step / n_steps
            for name in GROWING:
                _append(night / name, folder / name, part)
            if part >= keys_at:
                key_part = 1.0 if part >= min(keys_at + 0.1, 1.0) else 0.5
                _append(night / "assistance" / "keys.csv", folder / "assistance" / "keys.csv", key_part)
            time.sleep(pause_s)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        yield
    finally:
        thread.join()


def _objects(text: str, kind: str = "verdict") -> list[dict]:
    found = [json.loads(line) for line in text.splitlines()]
    return [{key: value for key, value in one.items() if key != "kind"} for one in found if one["kind"] == kind]


@pytest.mark.parametrize(
    ("level", "keys_at"),
    [
        pytest.param("1", 0.0, marks=SLOW),
        ("1", 0.9),
        pytest.param("2", 0.5, marks=SLOW),
        pytest.param("3", 0.5, marks=SLOW),
    ],
)
def test_the_verdicts_are_those_of_the_finished_recording(
    night: Path, expected: Callable[[str], list[dict]], tmp_path: Path, level: str, keys_at: float
) -> None:
    folder = _begun(night, tmp_path / "night")
    with _written(night, folder, n_steps=37, pause_s=0.02, keys_at=keys_at):
        result = invoke(process, folder, "--level", level, *UNSURE, *FAST, "--idle-s", "1", "--json")
    assert result.exception is None
    assert _objects(result.stdout) == expected(level)
    (change,) = _objects(result.stdout, "state")
    assert (change["before"], change["after"], change["alarm"]) == ("NOT_AVAILABLE", "AUTHENTIC", False)
    assert "half" not in result.stderr
    assert "cut off" not in result.stderr  # what is half written is waited for


def _second_channel(night: Path, folder: Path, names: tuple[str, ...]) -> Path:
    """Return the folder of a second channel with these files of the assistance folder."""
    folder.mkdir(exist_ok=True)
    for name in names:
        shutil.copy(night / "assistance" / name, folder / name)
    return folder


def _agreements(verdicts: list[dict]) -> list[str]:
    return [check["outcome"] for one in verdicts for check in one["checks"] if check["name"] == "OSNMA agreement"]


@pytest.mark.parametrize("more", [(), ONCE])
def test_an_estimator_of_the_cn0_needs_e1_out_of_samples(night: Path, more: tuple[str, ...]) -> None:
    result = invoke(process, night, "--cn0-estimator", "moments", *more)
    assert isinstance(result.exception, click.UsageError)
    assert "observations" in str(result.exception)


@SLOW
def test_keys_of_a_second_channel_are_waited_for(night: Path, tmp_path: Path) -> None:
    """They come after everything else; what is compared is what the finished recording compares."""
    second = _second_channel(night, tmp_path / "second", ("public_key.pem",))
    later = threading.Timer(1.0, _second_channel, (night, second, ("keys.csv",)))
    later.start()
    arguments = (night, "--level", "3", *UNSURE, *SEARCH_1_MS, "--second-channel", second)
    followed = invoke(process, *arguments, *FAST, "--idle-s", "1.5", "--json")
    later.join()
    assert followed.exception is None
    finished = json.loads(invoke(process, *arguments, "--json").stdout)["verdicts"]
    assert _objects(followed.stdout) == finished
    assert _agreements(finished) == AGREEMENTS


def test_a_second_channel_that_stays_silent_is_not_waited_for_for_ever(night: Path, tmp_path: Path) -> None:
    second = _second_channel(night, tmp_path / "second", ("public_key.pem",))
    result = invoke(
        process, night, "--level", "3", *UNSURE, *SEARCH_1_MS, "--second-channel", second, *ONCE, "--wait-s", "0.05"
    )
    assert result.exception is None
    assert _agreements(_objects(result.stdout)) == ["NOT_RUN"] * N_EPOCHS


def test_a_second_channel_without_a_validated_key_is_one_line(night: Path, tmp_path: Path) -> None:
    second = _second_channel(night, tmp_path / "second", ("keys.csv",))
    arguments = (night, "--level", "3", *UNSURE, *SEARCH_1_MS, "--second-channel", second, "--json")
    refused = invoke(process, *arguments)
    assert "second channel: found no validated OSNMA key" in str(refused.exception)
    assert "keys.csv" in refused.stderr
    trusted = invoke(process, *arguments, "--public-key", night / "assistance" / "public_key.pem")
    assert _agreements(json.loads(trusted.stdout)["verdicts"]) == AGREEMENTS


def test_a_finished_recording_is_followed_to_its_end(
    night: Path, expected: Callable[[str], list[dict]], tmp_path: Path
) -> None:
    result = invoke(process, night, *ONCE[:-1])
    assert result.exception is None
    assert result.stdout.count("snapshot ") == N_EPOCHS
    assert "state 2026-11-21T12:00:00.086 GST E11: NOT_AVAILABLE -> AUTHENTIC" in result.stdout
    assert f"{N_EPOCHS} snapshots: {N_EPOCHS} AUTHENTIC" in result.stderr
    assert "own public key" in result.stderr


def test_a_key_that_never_comes_is_not_waited_for_for_ever(night: Path, tmp_path: Path) -> None:
    folder = tmp_path / "night"
    shutil.copytree(night, folder, ignore=shutil.ignore_patterns("keys.csv"))
    result = invoke(process, folder, *ONCE, "--wait-s", "0.05")
    assert {one["status"] for one in _objects(result.stdout)} == {"NOT_AVAILABLE"}
    assert all("no validated OSNMA key" in one["reason"] for one in _objects(result.stdout))


def test_a_damaged_line_is_one_warning(night: Path, expected: Callable[[str], list[dict]], tmp_path: Path) -> None:
    shutil.copytree(night, tmp_path / "night")
    path = tmp_path / "night" / "observations.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:3], "1421,5616xx,11", *lines[3:]]) + "\n")
    result = invoke(process, tmp_path / "night", *ONCE)
    assert _objects(result.stdout) == expected("1")
    assert result.stderr.count("observations.csv: line 4") == 1


_STARTED: list[subprocess.Popen[bytes]] = []


@pytest.fixture(autouse=True)
def _no_process_is_left() -> Iterator[None]:
    """A process that outlives a failed test would fail the next one in which the garbage collector finds it."""
    yield
    while _STARTED:
        with _STARTED.pop() as run:
            run.kill()


def _run(*arguments: object, **options: object) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "vestige", "process", *map(str, arguments)]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)  # type: ignore[call-overload]  # noqa: S603
    _STARTED.append(run)
    return run  # type: ignore[no-any-return]


def _wait_for(kept: Path, index: int) -> None:
    """Wait until a snapshot is kept."""
    deadline = time.monotonic() + 240  # a loaded machine takes a minute to import and compile
    while True:
        progress = json.loads((kept / STATE).read_text())["progress"] if (kept / STATE).exists() else None
        if progress is not None and progress["index"] >= index:
            return
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.slow
def test_killed_and_started_again(night: Path, expected: Callable[[str], list[dict]], tmp_path: Path) -> None:
    folder, kept = _begun(night, tmp_path / "night"), tmp_path / "kept"
    arguments = (folder, "--json", "-o", kept, *FAST)
    with _written(night, folder, n_steps=40, pause_s=0.1, keys_at=0.0):
        first = _run(*arguments)
        _wait_for(kept, 1)
        first.send_signal(signal.SIGKILL)
        printed = first.communicate()[0]
        assert first.returncode == -signal.SIGKILL
        second = invoke(process, *arguments, "--idle-s", "1")
    assert second.exception is None
    assert "continuing after snapshot" in second.stderr
    assert _objects((kept / LINES).read_text()) == expected("1")
    # On the screen nothing is there twice; what was kept in the moment of the kill may be in the file only.
    shown = [one["snapshot"] for one in _objects(printed.decode())]
    shown_later = [one["snapshot"] for one in _objects(second.stdout)]
    assert shown == list(range(len(shown)))
    assert shown_later == list(range(shown_later[0], N_EPOCHS))
    assert shown_later[0] - len(shown) in (0, 1)


@pytest.mark.parametrize("level", ["1", pytest.param("2", marks=SLOW), pytest.param("3", marks=SLOW)])
def test_any_number_of_interruptions_changes_nothing(
    night: Path, expected: Callable[[str], list[dict]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, level: str
) -> None:
    """Ended before, in the middle of and after each record: what a receiver remembers comes back from the file."""
    kept = tmp_path / "kept"
    record, keep, calls = FollowJournal.record, FollowJournal._keep, [0]

    def stopped_after(self: FollowJournal, lines: list[str], progress: FollowProgress) -> None:
        record(self, lines, progress)
        raise KeyboardInterrupt

    def stopped_between(self: FollowJournal, *state: Any) -> None:
        calls[0] += 1
        if calls[0] == 2:  # the first one is that of opening
            raise KeyboardInterrupt
        keep(self, *state)

    arguments = (night, "--level", level, *UNSURE, *ONCE, "-o", kept)
    monkeypatch.setattr(FollowJournal, "_keep", stopped_between)
    assert isinstance(invoke(process, *arguments).exception, (KeyboardInterrupt, click.Abort))
    assert len(_objects((kept / LINES).read_text())) == 1  # written, but it does not count yet
    monkeypatch.setattr(FollowJournal, "_keep", keep)
    monkeypatch.setattr(FollowJournal, "record", stopped_after)
    while not isinstance(result := invoke(process, *arguments), Exception) and result.exception is not None:
        assert isinstance(result.exception, (KeyboardInterrupt, click.Abort))
    assert _objects((kept / LINES).read_text()) == expected(level)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_stops_cleanly(night: Path, tmp_path: Path, number: signal.Signals) -> None:
    kept = tmp_path / "kept"
    # A job in the background of a shell inherits a SIGINT that is ignored; a program at a terminal does not.
    at_a_terminal = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    run = _run(night, *FAST, "-o", kept, preexec_fn=at_a_terminal)
    _wait_for(kept, 2)
    time.sleep(0.1)  # it waits for samples after the last RECS
    run.send_signal(number)
    _, errors = run.communicate(timeout=240)
    assert run.returncode == 130
    last = errors.decode().splitlines()[-1]
    assert last.startswith("interrupted; ")
    assert "AUTHENTIC; the same command continues" in last
    assert "Traceback" not in errors.decode()
    assert json.loads((kept / STATE).read_text())["progress"]["index"] >= 2


@pytest.mark.slow
def test_samples_from_a_pipe(night: Path, expected: Callable[[str], list[dict]], tmp_path: Path) -> None:
    """E6 alone, cut out of a buffer that is smaller than the recording, and piped in odd pieces."""
    meta = json.loads((night / "e6.sigmf-meta").read_text())
    run = _run(
        "-", *FAST, "--json", "--observations", night / "observations.csv", "--assistance", night / "assistance",
        "--format", "int8", "--layout", "iq", "--sample-rate-hz", FS, "--center-frequency-hz", 1278.75e6,
        "--start", meta["captures"][0]["vestige:start_gst"], "--time-uncertainty", "1", "--buffer-mb", "30",
        stdin=subprocess.PIPE,
    )  # fmt: skip
    data = (night / "e6.sigmf-data").read_bytes()

    def feed() -> None:
        assert run.stdin is not None
        for first in range(0, len(data), 77_777):
            run.stdin.write(data[first : first + 77_777])
        run.stdin.close()

    feeder = threading.Thread(target=feed)
    feeder.start()
    with run:
        assert run.stdout is not None
        assert run.stderr is not None
        printed, errors = run.stdout.read(), run.stderr.read()
        feeder.join()
    assert run.wait() == 0, errors.decode()
    assert _objects(printed.decode()) == expected("1")


@pytest.mark.slow
def test_a_description_may_say_what_standard_input_is(night: Path, tmp_path: Path) -> None:
    meta = json.loads((night / "e6.sigmf-meta").read_text())
    start = meta["captures"][0]["vestige:start_gst"]
    (tmp_path / "recording.toml").write_text(
        f'start = "{start}"\ntime_uncertainty_s = 1.0\nsample_rate_hz = {FS}\n'
        '[e6]\nfile = "-"\nformat = "int8"\nlayout = "iq"\ncenter_frequency_hz = 1278.75e6\n'
        f'[observations]\nfile = "{night / "observations.csv"}"\n'
    )
    with (night / "e6.sigmf-data").open("rb") as samples:
        run = _run(
            "-", *FAST, "--json", "--description", tmp_path / "recording.toml", "--assistance", night / "assistance",
            "--level", "2", "--buffer-mb", "80", stdin=samples,
        )  # fmt: skip
        printed, errors = run.communicate(timeout=240)
    assert run.returncode == 0, errors.decode()
    assert [one["status"] for one in _objects(printed.decode())] == ["AUTHENTIC"] * N_EPOCHS


def _unplugged(folder: Path, n_epochs: int) -> None:
    """Write a recording of a receiver whose E6 antenna is unplugged, with a RECS each 0.1 s."""
    settings = [*SETTINGS, "interval_s=0.1", "receiver.sample_rate_hz=3e6", f"epochs={n_epochs}"]
    scenario = with_default_range(load_scenario(QUICK, settings))  # type: ignore[arg-type]
    write_companions(AcasTestCase(scenario=scenario, first=0, end=n_epochs), folder)
    (folder / "recording.toml").write_text(
        'start = "2026-11-21T12:00:00 GST"\ntime_uncertainty_s = 1.0\nsample_rate_hz = 3e6\n'
        '[e6]\nfile = "zeros"\nformat = "int8"\nlayout = "iq"\ncenter_frequency_hz = 1278.75e6\n'
        f'[observations]\nfile = "{folder / "observations.csv"}"\n'
    )
    with (folder / "zeros").open("wb") as stream:
        os.truncate(stream.fileno(), round((0.1 * n_epochs + 0.5) * 3e6 * 2))  # sparse


def test_what_had_to_be_dropped_is_said_and_the_exit_status_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A source that cannot wait, keys that never come, a buffer of 2.3 s: 40 RECS in 4 s do not fit."""
    _unplugged(tmp_path, 40)
    (tmp_path / "assistance" / "keys.csv").unlink()
    with (tmp_path / "zeros").open() as samples:
        monkeypatch.setattr(sys, "stdin", samples)
        with pytest.raises(SystemExit) as stop:
            main(
                ["process", "-", *FAST, "--json", "--description", str(tmp_path / "recording.toml"),
                 "--assistance", str(tmp_path / "assistance"), "--buffer-mb", "14", "--real-time"]
            )  # fmt: skip
    printed, errors = capsys.readouterr()
    assert stop.value.code == 1
    (end,) = _objects(printed, "end")
    assert end["snapshots"] == 40
    assert 0 < end["dropped"] < 40
    assert errors.count("the E6 samples were dropped") == end["dropped"]
    assert f"the E6 samples of {end['dropped']} of 40 snapshots were dropped" in errors.splitlines()[-1]


@pytest.mark.slow
def test_nothing_is_kept_of_an_epoch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred epochs: memory is what it was after the first thirty."""
    _unplugged(tmp_path, 100)
    held: list[int] = []
    follow = Following.__iter__

    def watched(self: Following) -> Iterator[object]:
        for number, epoch in enumerate(follow(self)):
            if number in (30, 95):
                gc.collect()  # what waits for it is not kept
                held.append(tracemalloc.get_traced_memory()[0])
            yield epoch

    monkeypatch.setattr(Following, "__iter__", watched)
    monkeypatch.setattr(click, "echo", lambda *_arguments, **_options: None)  # CliRunner keeps what is printed
    tracemalloc.start()
    try:
        result = invoke(process, tmp_path, *ONCE, "-o", tmp_path / "kept")
    finally:
        tracemalloc.stop()
    assert result.exception is None
    assert (tmp_path / "kept" / LINES).read_text().count('"kind": "verdict"') == 100
    assert held[1] - held[0] < 30_000  # 65 verdicts with their measurements would be some 200 kB


@pytest.mark.parametrize("name", ["", "assistance"])
def test_the_verdicts_are_not_kept_in_an_input_folder(night: Path, name: str) -> None:
    before = sorted(night.rglob("*"))
    refused = invoke(process, night, *ONCE, "-o", night / name).exception
    assert isinstance(refused, InputFileError)
    assert "output: found an input of this command" in str(refused)
    assert sorted(night.rglob("*")) == before


def test_another_recording_or_other_settings_are_refused(night: Path, tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    assert invoke(process, night, *ONCE, "-o", kept).exception is None
    for other, said in (
        (("--level", "2"), "--level: found 2, expected 1"),
        (("--kappa", "2"), "--kappa: found 2"),
        (("--start", "2026-11-21T12:00:01 GST"), "recording: found"),
    ):
        refused = invoke(process, night, *ONCE, "-o", kept, *other).exception
        assert isinstance(refused, InputFileError)
        assert said in str(refused)
    state = (kept / STATE).read_text()
    for damaged, said in (
        (state[:-20], "content"),
        (state.replace('"format": 3', '"format": 2'), "format: found 2, expected 3"),
        (state.replace('"index": 5', '"index": -5'), "greater than or equal to 0"),
        (state.replace('"n_bytes": ', '"n_bytes": -'), "greater than or equal to 0"),
        (state.replace('"week": 1421', '"week": -1'), "Galileo"),
        (state.replace('"week": 1421', f'"week": {10**18}'), "Galileo"),
        (
            state.replace('"index": 5', '"index": 4'),
            "progress: found other contents, expected the state as it was written",
        ),
        ("[]", "expected"),
    ):
        (kept / STATE).write_text(damaged)
        refused = invoke(process, night, *ONCE, "-o", kept).exception
        assert isinstance(refused, InputFileError)
        assert said in str(refused)
    (kept / STATE).write_text(state)
    lines = (kept / LINES).read_bytes()
    first = lines.index(b"\n") + 1
    for damaged_lines, said in (
        (lines[:-1], f"lines: found {len(lines) - 1} bytes, expected {len(lines)} bytes as they were written"),
        (b"", "lines: found 0 bytes"),
        (lines[:first] * 20, f"lines: found other contents in its first {len(lines)} bytes"),  # cut in a line before
        (lines[:-9] + b"x" + lines[-8:], "put the file back, or use another folder for -o"),
    ):
        (kept / LINES).write_bytes(damaged_lines)
        refused = invoke(process, night, *ONCE, "-o", kept).exception
        assert isinstance(refused, InputFileError)
        assert said in str(refused)
        assert (kept / LINES).read_bytes() == damaged_lines  # nothing is cut off
    (kept / LINES).write_bytes(lines + lines[:-7])  # lines that do not count yet
    assert invoke(process, night, *ONCE, "-o", kept).exception is None
    assert (kept / LINES).read_bytes() == lines
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")
    assert isinstance(invoke(process, night, *ONCE, "-o", tmp_path / "full").exception, InputFileError)


def test_one_writer_at_a_time(tmp_path: Path) -> None:
    with FollowJournal(tmp_path, {}), pytest.raises(InputFileError, match="another process"):
        FollowJournal(tmp_path, {})


@pytest.mark.parametrize(
    "arguments",
    [
        ("-",),
        ("-", "--follow", "--assistance", "x"),
        ("night", "--follow", "--calibrate"),
        ("night", "--follow", "--format", "int8"),
        ("night", "--observations", "x"),
        ("night", "--follow", "--real-time"),
        ("night", "--follow", "--poll-s", "nan"),
    ],
)
def test_usage(arguments: tuple[str, ...]) -> None:
    assert CliRunner().invoke(process, arguments).exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--assistance", "none"), "readable folder"),
        (("--observations", "{night}/README.txt"), "expected RINEX observations"),
        (("--level", "2", "--time-uncertainty", math.inf), "range"),
    ],
)
def test_what_is_wrong_is_one_line(night: Path, arguments: tuple[str, ...], said: str) -> None:
    chosen = [str(one).replace("{night}", str(night)) for one in arguments]
    error = invoke(process, night, *ONCE, *chosen).exception
    assert isinstance(error, (VestigeError, click.UsageError))
    assert said in str(error)


def test_a_clock_that_may_be_wrong_by_much_needs_a_larger_buffer(night: Path, tmp_path: Path) -> None:
    error = invoke(
        process, "-", *ONCE, "--observations", night / "observations.csv", "--assistance", night / "assistance",
        "--format", "int8", "--layout", "iq", "--sample-rate-hz", FS, "--center-frequency-hz", 1278.75e6,
        "--start", "2026-11-21T12:00:00 GST", "--time-uncertainty", "60", "--level", "2",
    ).exception  # fmt: skip
    assert isinstance(error, VestigeError)
    assert "--buffer-mb: found 512, expected at least" in str(error)


def _changed(night: Path, folder: Path, **files: bytes) -> Path:
    """Return a copy of the recording with other contents of files, `observations` meaning observations.csv."""
    shutil.copytree(night, folder, ignore=shutil.ignore_patterns("rinex"))
    names = {"observations": "observations.csv", "e6": "e6.sigmf-data"}
    for name, content in files.items():
        (folder / names[name]).write_bytes(content)
    return folder


def _finished(folder: Path, *options: object) -> dict:
    return json.loads(invoke(process, folder, *options, "--json").stdout)


def test_a_satellite_that_vanishes_from_e1_is_said_to_be_gone(night: Path, tmp_path: Path) -> None:
    """Observations around the first RECS alone: from the next on there is a verdict, and AUTHENTIC is not shown."""
    first = b"".join((night / "observations.csv").read_bytes().splitlines(keepends=True)[:2])
    folder = _changed(night, tmp_path / "night", observations=first)
    followed = invoke(process, folder, *ONCE)
    verdicts = _objects(followed.stdout)
    assert [one["status"] for one in verdicts] == ["AUTHENTIC"] + ["NOT_AVAILABLE"] * (N_EPOCHS - 1)
    assert {one["reason"] for one in verdicts[1:]} == {"not seen on E1"}
    assert verdicts == _finished(folder)["verdicts"]
    changes = [(one["snapshot"], one["after"], one["alarm"]) for one in _objects(followed.stdout, "state")]
    assert changes == [(0, "AUTHENTIC", False), (1, "NOT_AVAILABLE", False)]
    assert "AUTHENTIC -> NOT_AVAILABLE: not seen on E1" in invoke(process, folder, *ONCE[:-1]).stdout


def test_a_satellite_that_e1_never_shows_is_named_once_at_the_end(night: Path, tmp_path: Path) -> None:
    other = (night / "observations.csv").read_bytes().replace(b",11,", b",12,")
    folder = _changed(night, tmp_path / "night", observations=other)
    followed = invoke(process, folder, *ONCE)
    assert _objects(followed.stdout) == _finished(folder)["verdicts"] == []
    assert _objects(followed.stdout, "end") == [{"snapshots": N_EPOCHS, "dropped": 0, "not_seen_on_e1": [11]}]
    assert _finished(folder)["not_seen_on_e1"] == [11]
    assert followed.stderr.count("satellites with RECS that were not seen on E1: E11") == 1
    assert "no verdict: no satellite of the RECS is seen on E1" in followed.stderr


@pytest.mark.parametrize(
    "content", [b"", pytest.param(b"gst_week,gst_second,sv,pseudorange_m\n", marks=pytest.mark.slow)]
)
def test_a_file_without_observations_is_one_line_and_replaced_by_e1_samples_as_in_a_finished_recording(
    night: Path, tmp_path: Path, content: bytes
) -> None:
    folder = _changed(night, tmp_path / "night", observations=content)
    said = "observations.csv: line 1: found"
    expected = "CSV with gst_week, gst_second, svid, pseudorange_m"
    refused = invoke(process, folder, *ONCE, "--no-track")  # nothing says that the clock is right to 40 ms
    assert isinstance(refused.exception, InputFileError)
    assert said in str(refused.exception)
    assert expected in str(refused.exception)
    sure = ("--time-uncertainty", "0.04")
    followed = invoke(process, folder, *ONCE, *sure)
    finished = invoke(process, folder, *sure, "--json")
    assert _objects(followed.stdout) == json.loads(finished.stdout)["verdicts"]
    assert {one["status"] for one in _objects(followed.stdout)} == {"AUTHENTIC"}
    for stderr in (followed.stderr, finished.stderr):
        assert stderr.count(said) == 1
        assert expected in stderr


def test_an_observation_file_that_was_named_and_stays_empty_is_an_error(night: Path, tmp_path: Path) -> None:
    empty = tmp_path / "mine.csv"
    arguments = (night, *ONCE, "--observations", empty, "--time-uncertainty", "0.04")
    assert "mine.csv: line 1: found no file" in str(invoke(process, *arguments).exception)
    empty.write_bytes(b"")
    assert "mine.csv: line 1: found an empty file" in str(invoke(process, *arguments).exception)


def test_without_a_snapshot_it_says_why(night: Path, tmp_path: Path) -> None:
    folder = _changed(night, tmp_path / "night", e6=(night / "e6.sigmf-data").read_bytes()[:1001])
    stderr = invoke(process, folder, *ONCE).stderr
    assert "no verdict: no RECS was transmitted during this recording" in stderr
    assert "e6.sigmf-data: 8.06452e-05 s of E6 samples from 2026-11-21T12:00:00.000 GST on" in stderr
    with (tmp_path / "nothing").open("wb+") as nothing:
        pipe = _run(
            "-", *ONCE, "--observations", night / "observations.csv", "--assistance", night / "assistance",
            "--format", "int8", "--layout", "iq", "--sample-rate-hz", FS, "--center-frequency-hz", 1278.75e6,
            "--start", "2026-11-21T12:00:00 GST", "--time-uncertainty", "1", stdin=nothing,
        )  # fmt: skip
        error = pipe.communicate()[1].decode()
    assert "standard input: no E6 sample" in error
