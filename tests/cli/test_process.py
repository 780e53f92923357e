"""The whole chain from files, as a user would run it, on a small recording that is made here."""

from __future__ import annotations

import csv
import errno
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import click
import numpy as np
import pytest
from click.testing import CliRunner
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from night import TWO_SATELLITES, invoke
from vestige.acas_processor.detectors import DETECTORS
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.searches.sampled_snapshot import block_of
from vestige.cli.live.live import command as live
from vestige.cli.main import main
from vestige.cli.options import DETECTOR_NAMES
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.recordings.verdicts import VERDICT_COLUMNS, Tally, csv_writer
from vestige.cli.services.recs_make import command as recs_make
from vestige.constants import MEDIAN_TRAVEL_TIME_S, SPEED_OF_LIGHT_MPS
from vestige.errors import InputFileError, VestigeError
from vestige.recording.assistance.folder import read_assistance
from vestige.recording.assistance.made_recs import OPEN_CODE
from vestige.recording.assistance.receiver_corrections import read_hardware_bias
from vestige.recording.observations.e1_observation import observe
from vestige.recording.recording import open_recording
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import write_collection, write_sigmf
from vestige.recording.snapshots import MARGIN_S, RecordingSource
from vestige.records import Band, SampleBatch, Snapshot, Status
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.sample_processor.tracking.settings import TrackingSettings

SCENARIO = (
    TWO_SATELLITES
    + """[[satellite]]
svid = 34
range_m = 27_900_000.0
range_rate_mps = 640.0
cn0_e1_dbhz = 42.0
cn0_e6_dbhz = 44.0
"""
)


def _json(command: object, *arguments: object) -> dict:
    result = invoke(command, *arguments, "--json")
    if result.exception is not None:
        raise result.exception
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    room = tmp_path_factory.mktemp("process")
    (room / "scenario.toml").write_text(SCENARIO)
    result = invoke(simulate, room / "scenario.toml", "-o", room / "night")
    assert result.exception is None
    made = _json(
        recs_make, "--from-recording", room / "night", "--keys", room / "night" / "osnma" / "keys.csv",
        "--public-key", room / "night" / "osnma" / "public_key.pem", "-o", room / "night" / "assistance",
        "--svids", "3,8,12,34",
    )  # fmt: skip
    assert made["svids"] == [3, 8, 12, 34]
    return room / "night"


@pytest.fixture(scope="module")
def calibrated(folder: Path) -> dict:
    return _json(process, folder, "--calibrate")


def test_verdicts(calibrated: dict) -> None:
    assert [(one["svid"], one["status"]) for one in calibrated["verdicts"]] == [
        (3, "AUTHENTIC"),
        (8, "AUTHENTIC"),
        (34, "AUTHENTIC"),
    ]
    assert calibrated["not_seen_on_e1"] == [12]
    assert calibrated["hardware_bias_m"] == pytest.approx(-18.0, abs=6.0)


@pytest.mark.parametrize("command", [process, pytest.param(live, marks=pytest.mark.slow)])
def test_recs_of_the_open_code_are_told_once(folder: Path, command: object) -> None:
    words = (
        "--hardware-bias-m",
        -18.0,
        *(("--idle-s", "0.1", "--time-uncertainty", "0.02") if command is live else ()),
    )
    result = invoke(command, folder, *words)
    assert result.exception is None
    assert result.stderr.count(OPEN_CODE) == 1
    assert "AUTHENTIC" in result.output
    wrong_mode = invoke(command, folder, *words, "--cipher-mode", "ctr")
    assert wrong_mode.exception is None
    assert OPEN_CODE not in wrong_mode.stderr, "what it decrypts to does not repeat"


def test_recs_that_were_made_in_counter_mode(folder: Path, tmp_path: Path) -> None:
    made = ("--from-recording", folder, "--keys", folder / "osnma" / "keys.csv", "--svids", "3")
    public = ("--public-key", folder / "osnma" / "public_key.pem")
    _json(recs_make, *made, *public, "-o", tmp_path / "ctr", "--cipher-mode", "ctr")
    bias = ("--assistance", tmp_path / "ctr", "--hardware-bias-m", -18.0)
    for mode, status in (("ctr", "AUTHENTIC"), ("cbc", "NOT_DETECTED")):
        found = _json(process, folder, *bias, "--cipher-mode", mode)["verdicts"]
        assert [(one["svid"], one["status"]) for one in found] == [(3, status)]


@pytest.mark.parametrize(
    ("limit", "of_authentic", "of_missed"),
    [("spoofed", 0, 0), ("alarm", 0, 3), pytest.param("unauthenticated", 0, 3, marks=pytest.mark.slow)],
)
def test_the_exit_status_that_a_script_asks_for(
    folder: Path, capsys: pytest.CaptureFixture[str], limit: str, of_authentic: int, of_missed: int
) -> None:
    """E6 of all satellites is searched 18 m and 2 km from where it is; where nothing is found the user is advised."""
    for bias_m, status in ((-18.0, of_authentic), (-2000.0, of_missed)):
        with pytest.raises(SystemExit) as stop:  # as the shell sees it
            main(["process", str(folder), "--hardware-bias-m", str(bias_m), "--fail-on", limit])
        assert (stop.value.code or 0) == status
        assert ("likely causes" in capsys.readouterr().out) is (bias_m == -2000.0)


def test_the_table_and_the_csv_say_the_same(folder: Path, calibrated: dict, tmp_path: Path) -> None:
    bias = ("--hardware-bias-m", calibrated["hardware_bias_m"])
    result = invoke(process, folder, *bias, "-o", tmp_path / "verdicts.csv")
    assert result.exception is None
    assert result.stdout.count("AUTHENTIC") == 4  # three rows and the result
    assert "E12" in result.stdout
    with (tmp_path / "verdicts.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    for row, one in zip(rows, calibrated["verdicts"], strict=True):
        assert int(row["svid"]) == one["svid"]
        assert float(row["range_offset_m"]) == one["range_offset_m"]


@pytest.mark.parametrize(
    "name",
    [
        "e6.sigmf-data",
        "e1.sigmf-meta",
        "observations.csv",
        "verdicts.csv",
        "recording.sigmf-collection",
        "osnma/keys.csv",
    ],
)
def test_verdicts_are_not_written_over_the_recording_or_into_it(folder: Path, name: str) -> None:
    before = {path: path.stat().st_size for path in folder.rglob("*")}
    result = invoke(process, folder, "-o", folder / name)
    assert isinstance(result.exception, InputFileError)
    assert f"{name}: output: found a path in the input folder night" in str(result.exception)
    if name != "osnma/keys.csv" and (folder / name).exists():  # the recording named as a file: what it consists of
        named = invoke(process, folder / "recording.sigmf-collection", "-o", folder / name)
        assert isinstance(named.exception, InputFileError)
        assert f"{name}: output: found an input" in str(named.exception)
    assert {path: path.stat().st_size for path in folder.rglob("*")} == before


def test_the_bias_is_written_through_no_link(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years")
    (tmp_path / "receiver.toml").symlink_to(tmp_path / "thesis.tex")
    result = invoke(process, folder, "--write-bias", tmp_path)
    assert isinstance(result.exception, InputFileError)
    assert (tmp_path / "thesis.tex").read_text() == "years"


def test_ctrl_c_keeps_the_verdicts_until_then(tmp_path: Path) -> None:
    path, step = tmp_path / "verdicts.csv", SimpleNamespace(verdicts=(), measurement=None)
    path.write_text("an earlier run")
    with pytest.raises(KeyboardInterrupt), csv_writer(path):
        raise KeyboardInterrupt
    assert path.read_text() == "an earlier run"
    with pytest.raises(KeyboardInterrupt) as stop, csv_writer(path) as write:  # noqa: PT012
        write(step)  # type: ignore[arg-type]
        raise KeyboardInterrupt
    assert stop.value.__notes__ == [f"{path} has the verdicts until then"]
    assert path.read_text() == ",".join(VERDICT_COLUMNS) + "\n"
    with pytest.raises(OSError, match="No space"), csv_writer(path) as write:  # noqa: PT012
        write(step)  # type: ignore[arg-type]
        raise OSError(errno.ENOSPC, "No space left on device")
    assert [one.name for one in tmp_path.iterdir()] == ["verdicts.csv"]


def test_the_maximum_detector_agrees_without_a_spoofer(folder: Path, calibrated: dict) -> None:
    bias = ("--hardware-bias-m", calibrated["hardware_bias_m"])
    result = _json(process, folder, *bias, "--detector", "maximum", "--budget", "corrected")
    assert {one["status"] for one in result["verdicts"]} == {"AUTHENTIC"}


@pytest.mark.slow
def test_file_and_memory_give_the_same_bits(folder: Path, tmp_path: Path) -> None:
    """Samples kept as float32 in files, and the same samples never written: equal taps, bit for bit."""
    original = open_recording(folder)
    assert original.e1 is not None
    assert original.e6 is not None
    batches = {Band.E1: original.e1.read(0, original.e1.n_samples), Band.E6: original.e6.read(0, original.e6.n_samples)}
    scaled = {band: replace(batch, samples=(batch.samples / np.float32(14.1))) for band, batch in batches.items()}
    form = SampleFormat(component="float32", layout="iq")
    metas = [
        write_sigmf(tmp_path / band.value, [batch], form=form, time_uncertainty_s=1.0) for band, batch in scaled.items()
    ]
    write_collection(tmp_path / "recording", metas)

    assistance = read_assistance(folder / "assistance").assistance
    processor = AcasProcessor()
    (from_file,) = RecordingSource(recording=open_recording(tmp_path), assistance=assistance).snapshots()
    in_memory = _snapshot_in_memory(scaled[Band.E1], scaled[Band.E6], from_file)
    one, other = (processor.step(None, block_of(snapshot), assistance) for snapshot in (from_file, in_memory))
    a, b = one.block.measured, other.block.measured
    assert a.snapshots.svids == b.snapshots.svids
    assert np.isfinite(a.banks.taps[a.snapshots.e1.seen]).all()
    for block, name in (
        ("banks", "taps"), ("banks", "noise_power"), ("detected", "tap"), ("detected", "magnitude_sigma"),
        ("detected", "phase_rad"), ("detected", "range_offset_m"),
    ):  # fmt: skip
        assert getattr(getattr(a, block), name).tobytes() == getattr(getattr(b, block), name).tobytes(), name
    assert len(one.verdicts) > 2
    assert [repr(verdict) for verdict in one.verdicts] == [repr(verdict) for verdict in other.verdicts]


def _snapshot_in_memory(e1: SampleBatch, e6: SampleBatch, like: Snapshot) -> Snapshot:
    """Cut the windows out of the arrays, without any file."""
    rate = e1.sample_rate_hz
    transmit_time = like.time + -(like.time - e1.start)  # the RECS leave with the first sample's label: 12:00:16
    count = round(0.1 * rate)
    wish = round((transmit_time + MEDIAN_TRAVEL_TIME_S - e1.start) * rate) - count // 2
    first = min(max(wish, 0), e1.samples.size - count)
    window = replace(e1, samples=e1.samples[first : first + count], first_sample=first, start=e1.start + first / rate)
    time, observations = observe(window, [3, 8, 12, 34])
    travel_s = [one.pseudorange_m / SPEED_OF_LIGHT_MPS for one in observations.values()]
    low = int(np.ceil((min(travel_s) - MARGIN_S) * rate))
    size = int(np.ceil((max(travel_s) - min(travel_s) + 0.016 + 2 * MARGIN_S) * rate))
    samples = e6.samples[low : low + size]
    cut = replace(e6, samples=samples, first_sample=low, start=e6.start + low / rate)
    return replace(like, time=time, observations=observations, e6=CorrelatableSamples(cut))


def test_the_cn0_comes_from_the_estimator_that_is_asked_for(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, list[float]] = {}

    def noted(batch: SampleBatch, svids: list[int], *, cn0_estimator: str, **more: object) -> object:
        found = observe(batch, svids, cn0_estimator=cn0_estimator, **more)  # type: ignore[arg-type]
        seen[cn0_estimator] = [one.cn0_dbhz for one in found[1].values()]
        return found

    monkeypatch.setattr("vestige.recording.snapshots.observe", noted)
    _json(process, folder)
    _json(process, folder, "--cn0-estimator", "narrow-to-wide")
    assert list(seen) == ["noise-floor", "narrow-to-wide"]
    assert len(seen["noise-floor"]) == len(seen["narrow-to-wide"]) > 2
    assert seen["noise-floor"] != seen["narrow-to-wide"]
    assert seen["narrow-to-wide"] == pytest.approx(seen["noise-floor"], abs=5.0)  # five standard deviations


def test_disclosed_key(folder: Path) -> None:
    result = _json(process, folder, "--time-uncertainty", "6")
    assert {one["status"] for one in result["verdicts"]} == {"NOT_AVAILABLE"}
    assert all("disclosure" in one["reason"] for one in result["verdicts"])


def test_redated_recording_has_no_recs(folder: Path) -> None:
    result = _json(process, folder, "--start", "2026-11-21T13:00:16 GST")
    assert result["verdicts"] == []


def test_utc_that_was_taken_as_gst_is_named(folder: Path) -> None:
    shown = invoke(process, folder, "--start", "2026-11-21T11:59:58")
    assert shown.stderr.count("no RECS for this time: the assistance folder has 4, sent ") == 1
    assert "the start is UTC and was taken as GST (UTC is 18 s behind GST)" in shown.stderr
    assert "no verdict: no RECS for this time" in shown.stdout
    assert "RECS: none" not in shown.stderr
    assert "no RECS was found within" not in shown.stderr


def test_every_warning_before_the_verdicts_is_in_the_json(folder: Path) -> None:
    shown = invoke(process, folder, "--json")
    said = [line.removeprefix("warning: ") for line in shown.stderr.splitlines() if line.startswith("warning: ")]
    assert len(said) > 2
    assert json.loads(shown.stdout)["warnings"] == said


def test_no_position_has_its_reason(folder: Path, tmp_path: Path) -> None:
    shown = invoke(process, folder, "--calibrate", "--positions", tmp_path / "a.csv")
    assert "no position was computed, because there are no orbits; give --navigation FILE" in shown.stderr
    shown = invoke(process, folder, "--time-uncertainty", "6", "--positions", tmp_path / "a.csv")
    assert "no position was computed, because no satellite is AUTHENTIC" in shown.stderr


def test_a_wrong_cipher_mode_gives_the_causes(folder: Path) -> None:
    shown = invoke(process, folder, "--cipher-mode", "ctr")
    assert "no satellite was found on E6, likely causes:" in shown.stdout
    for cause in ("spectral_inversion, sample_rate_hz", "than the key that they name", "--cipher-mode", "--taps 63"):
        assert cause in shown.stdout


@pytest.mark.parametrize(
    ("reason", "seen", "advice"),
    [
        ("E1 predicts a detection probability of 0.6 only, below 0.9", True, "sample_rate_hz is wrong by some ppm"),
        ("no validated OSNMA key", True, ""),
        ("", False, "sample_rate_hz, format, layout, center_frequency_hz"),
    ],
)
def test_each_case_without_a_verdict_names_its_causes(reason: str, seen: bool, advice: str) -> None:
    tally = Tally()
    verdicts = [SimpleNamespace(status=Status.NOT_AVAILABLE, reason=reason)] if seen else []
    state = SimpleNamespace(on_e1={8: None} if seen else {})
    step = SimpleNamespace(verdicts=verdicts, changes=(), positions=(), unseen=frozenset({3}), state=state)
    tally.add(step)  # type: ignore[arg-type]
    assert (advice in " ".join(tally.advice)) if advice else tally.advice == ()


def test_calibration_needs_satellites(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(VestigeError, match="calibrate"):
        _json(process, folder, "--start", "2026-11-21T13:00:16 GST", "--calibrate")


def test_no_assistance_folder(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputFileError):
        _json(process, folder, "--assistance", tmp_path / "none")


@pytest.mark.slow
def test_a_damaged_recs_file_costs_only_itself(folder: Path, tmp_path: Path) -> None:
    for path in (folder / "assistance").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    damaged = next(path for path in sorted(tmp_path.iterdir()) if "_08_" in path.name)
    damaged.write_bytes(damaged.read_bytes()[:-7])
    result = invoke(process, folder, "--assistance", tmp_path, "--hardware-bias-m", "-18")
    assert result.exception is None
    assert damaged.name in result.stderr
    assert "E03" in result.stdout
    assert "E08" not in result.stdout
    strict = invoke(process, folder, "--assistance", tmp_path, "--strict")
    assert isinstance(strict.exception, VestigeError)


def test_a_certificate_means_that_unsigned_files_are_not_used(folder: Path, tmp_path: Path) -> None:
    """Neither unsigned RECS nor corrections, which nobody can sign: a planted receiver.toml must not move the range."""
    key = ec.generate_private_key(ec.SECP256R1()).public_key()
    certificate = tmp_path / "server.pem"
    certificate.write_bytes(key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    for path in (folder / "assistance").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "receiver.toml").write_text("hardware_bias_e1_e6_m = 29.2\n")
    result = invoke(process, folder, "--assistance", tmp_path, "--certificate", certificate)
    assert result.exception is None
    assert "no verdict" in result.stdout
    assert "hardware bias E6-E1 used: +0.0 m" in result.stdout
    assert "receiver.toml" in result.stderr


def test_keys_of_another_chain_are_refused(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.pem"
    key = ec.generate_private_key(ec.SECP256R1()).public_key()
    other.write_bytes(key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    result = _json(process, folder, "--public-key", other)
    assert {one["status"] for one in result["verdicts"]} == {"NOT_AVAILABLE"}


def test_what_was_taken_on_the_folders_word_is_said(folder: Path) -> None:
    own = _json(process, folder)
    assert any("own public key" in line for line in own["warnings"])
    named = _json(process, folder, "--public-key", folder / "osnma" / "public_key.pem")
    assert f"{folder / 'assistance'}: {OPEN_CODE}" in named["warnings"]
    assert not any("own public key" in line for line in named["warnings"])
    assert {one["status"] for one in named["verdicts"]} == {"AUTHENTIC"}


def test_calibration_says_that_it_is_blind_and_can_be_kept(folder: Path, tmp_path: Path) -> None:
    result = _json(process, folder, "--calibrate", "--write-bias", tmp_path)
    assert result["calibrated_on_itself"] is True
    written = read_hardware_bias(tmp_path / "receiver.toml")
    assert written * SPEED_OF_LIGHT_MPS == pytest.approx(result["hardware_bias_m"], abs=1e-6)


@pytest.mark.slow
def test_four_milliseconds_have_half_the_amplitude(folder: Path, tmp_path: Path) -> None:
    keys = ("--keys", folder / "osnma" / "keys.csv", "--public-key", folder / "osnma" / "public_key.pem")
    made = ("--svids", "3,8,34", "--length-ms", "4", "--kdi", "1", "-o", tmp_path / "short")
    _json(recs_make, "--from-recording", folder, *keys, *made)
    settings = ("--hardware-bias-m", "-18", "--p-fa", "1e-6", "--taps", "9", "--kappa", "2")
    paths = (tmp_path / "short", folder / "assistance")
    short, long = (_json(process, folder, "--assistance", path, *settings) for path in paths)
    for a, b in zip(short["verdicts"], long["verdicts"], strict=True):
        assert a["magnitude_sigma"] == pytest.approx(b["magnitude_sigma"] / 2, abs=3.0)
        assert a["threshold_sigma"] == pytest.approx(np.sqrt(-2 * np.log(1e-6)))
        assert a["range_limit_m"] == pytest.approx(2 * 8.85, abs=0.01)
        assert a["available_at"] > b["available_at"]


@pytest.mark.parametrize(
    "option", ["--hardware-bias-m", "--kappa", "--min-pd", "--p-fa", "--tap-spacing-m", "--time-uncertainty"]
)
@pytest.mark.parametrize("value", ["nan", "inf"])
def test_no_number_is_a_usage_error(folder: Path, option: str, value: str) -> None:
    assert CliRunner().invoke(process, [str(folder), option, value]).exit_code == 2


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--usual-e1-cn0-dbhz", "45"), "belong together"),
        (("--usual-e6-cn0-dbhz", "45"), "belong together"),
        (("--cn0-fall-db", "9"), "--usual-e1-cn0-dbhz"),
        (("--floor-sigma-m", "0"), "more than 0"),
        (("--near", "48.1,11.6,50"), "--near needs orbits: add --navigation"),
        (("--track", "--near", "48.1,11.6"), "--near 48.1,11.6: expected latitude and longitude in degrees and a"),
        (("--track", "--near", "98.1,11.6,50"), "--near 98.1,11.6,50: expected latitude"),
        (("--track", "--near", "48.1,11.6,0"), "--near 48.1,11.6,0: expected latitude"),
        (("--track", "--near", "48.1,nan,5"), "--near 48.1,nan,5: expected latitude"),
    ],
)
def test_usual_levels_that_say_half(folder: Path, options: tuple[str, ...], expected: str) -> None:
    result = CliRunner().invoke(process, [str(folder), *options])
    assert result.exit_code == 2
    assert expected in result.stderr


@pytest.mark.slow
def test_usual_levels_need_not_be_learned(folder: Path) -> None:
    """The first RECS is compared with what is stated, and fails where it is 20 dB away."""

    def failed(power_db: str) -> dict[str, str]:
        levels = ("--usual-e1-power-db", power_db, "--usual-e1-cn0-dbhz", "44", "--usual-e6-cn0-dbhz", "46")
        first = _json(process, folder, "--level", "2", "--time-uncertainty", "0.01", *levels)["verdicts"][0]
        return {check["name"]: check["outcome"] for check in first["checks"]}

    right, wrong = failed("26"), failed("6")
    assert (right["E1 received power"], wrong["E1 received power"]) == ("PASS", "FAIL")
    assert right["C/N0"] == "PASS"
    assert right["E6 received power"] == "NOT_RUN"


@pytest.mark.slow
def test_what_is_expected_of_e6_over_e1_says_whether_a_missing_signal_means_anything(folder: Path) -> None:
    """The bank lies 3 km beside the signal, so nothing is detected: an alarm, unless E6 is expected to be that weak."""

    def said(*options: str) -> tuple[str, str]:
        away = ("--time-uncertainty", "0.01", "--hardware-bias-m", "3000")
        first = _json(process, folder, *away, *options)["verdicts"][0]
        return first["status"], first["reason"]

    assert said()[0] == "NOT_DETECTED"
    for weak in (("--e6-over-e1-db", "-25"), ("--usual-e1-cn0-dbhz", "44", "--usual-e6-cn0-dbhz", "19")):
        status, reason = said(*weak)
        assert status == "NOT_AVAILABLE"
        assert "E1 predicts a detection probability of" in reason


def test_make_refuses_to_overwrite_and_leaves_nothing_half(folder: Path, tmp_path: Path) -> None:
    keys = ("--keys", folder / "osnma" / "keys.csv", "--public-key", folder / "osnma" / "public_key.pem")
    with pytest.raises(InputFileError, match="an existing file or folder"):
        _json(recs_make, "--from-recording", folder, *keys, "-o", folder / "assistance")
    late = ("--start", "2026-11-22T12:00:16 GST")
    with pytest.raises(VestigeError, match="key"):
        _json(recs_make, "--from-recording", folder, *keys, *late, "--svids", "3", "-o", tmp_path / "assistance")
    assert list(tmp_path.iterdir()) == []


def test_make_without_a_trust_anchor(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(VestigeError):
        _json(
            recs_make, "--from-recording", folder, "--keys", folder / "osnma" / "keys.csv", "--svids", "3",
            "-o", tmp_path / "assistance",
        )  # fmt: skip
    assert list(tmp_path.iterdir()) == []


def test_simulate_refuses_to_overwrite(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(SCENARIO)
    result = invoke(simulate, tmp_path / "scenario.toml", "-o", folder)
    assert isinstance(result.exception, InputFileError)


@pytest.mark.parametrize("svids", ["x", "0", "37", "5-", "1--3", "0-99999999999"])
def test_bad_satellite_lists(folder: Path, tmp_path: Path, svids: str) -> None:
    result = CliRunner().invoke(
        recs_make, ["--from-recording", str(folder), "--keys", "k", "-o", str(tmp_path / "a"), "--svids", svids]
    )
    assert result.exit_code == 2


def test_the_detectors_of_the_command_line_are_those_that_there_are() -> None:
    assert tuple(DETECTORS) == DETECTOR_NAMES


def test_alarms_a_day_set_the_range_limit(folder: Path) -> None:
    """One a day of ten satellites: κ = 4.35 or so in place of 3; κ beside it is a contradiction."""
    wide = _json(process, folder, "--hardware-bias-m", "-18", "--alarms-per-day", "1")
    assert wide["verdicts"][0]["range_limit_m"] == pytest.approx(4.34 * 8.85, abs=0.3)
    result = CliRunner().invoke(process, [str(folder), "--alarms-per-day", "1", "--kappa", "3"])
    assert result.exit_code == 2
    assert "--kappa: follows from --alarms-per-day" in result.stderr


def test_fewer_alarms_a_day_than_noise_brings_are_one_line(folder: Path) -> None:
    result = CliRunner().invoke(process, [str(folder), "--alarms-per-day", "0.01"])
    assert "alarms_per_day: found 0.01, expected more than 0.13" in str(result.exception)


class _LoopSettings(Exception):  # noqa: N818  (carries what a test looks at)
    """Ends a command where it would begin to track."""


@pytest.mark.parametrize(
    ("where", "follow"),
    [("tracked.track_recording.track_recording", ()), ("live.live_tracking.LiveTracking", ("--follow",))],
    ids=["process", "follow"],
)
def test_the_options_of_the_loops_reach_the_tracking(
    folder: Path, monkeypatch: pytest.MonkeyPatch, where: str, follow: tuple[str, ...]
) -> None:
    def end(*arguments: object, settings: object = None, **_options: object) -> None:
        raise _LoopSettings(settings or arguments[1])

    monkeypatch.setattr(f"vestige.recording.{where}", end)
    loops = ("--pll-bandwidth-hz", 8, "--integration-ms", 20, "--dll-discriminator", "dot product", "--correlators", 7)
    with pytest.raises(_LoopSettings) as found:
        raise invoke(process, folder, "--track", *follow, *loops).exception or AssertionError
    assert found.value.args[0] == TrackingSettings(
        pll_bandwidth_hz=8.0, integration_periods=5, dll_discriminator="dot product", n_correlators=7
    )
    refused = invoke(process, folder, "--no-track", *follow, "--pll-order", 3).exception
    assert isinstance(refused, click.UsageError)
    assert "--pll-order: only where E1 is tracked" in str(refused)
