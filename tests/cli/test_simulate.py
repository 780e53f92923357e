"""A test case of a campaign: written, looked into, authenticated, attacked, exported."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result

import vestige as vs
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.cli.recordings.inspect import command as inspect
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.searches.search import command as search
from vestige.cli.recordings.simulate import command as simulate
from vestige.crypto.keys.key_file import read_key_file
from vestige.crypto.keys.public_key_file import load_public_keys
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.errors import InputFileError, UnsupportedError, VestigeError
from vestige.recording.doctor import e1_signals
from vestige.recording.observations.observation_file import open_observations
from vestige.recording.recording import open_recording
from vestige.recording.samples.sigmf_writer import write_collection, write_sigmf
from vestige.records import Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated import simulated_recording
from vestige.time import GalileoTime

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
QUICK = SCENARIOS / "quick.toml"
FS = 6.2e6
SETTINGS = (
    "--set", f"receiver.sample_rate_hz={FS}", "--set", "interval_s=0.1",
    "--set", "receiver.cn0_dbhz=45.0", "--set", "receiver.cn0_e1_dbhz=43.0",
)  # fmt: skip


def _invoke(command: click.Command, *arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments], standalone_mode=False)


def _written(command: click.Command, *arguments: object) -> Result:
    result = _invoke(command, *arguments)
    if result.exception is not None:
        raise result.exception
    return result


def _verdicts(folder: Path, *arguments: object) -> list[dict]:
    return json.loads(_written(process, folder, *arguments, "--json").stdout)["verdicts"]


def _truth(folder: Path) -> list[dict[str, str]]:
    with (folder / "truth.csv").open() as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("simulate") / "case"
    exports = ("--export", "gnss-sdr", "--export", "pocketsdr")
    result = _written(simulate, QUICK, "--epochs", "5:8", "-o", output, *SETTINGS, *exports)
    assert "0.5 s of E1 and E6: 0.0248 GB" in result.stderr  # 0.5 s · 6.2 Msps · 2 bands · 2 copies · 2 bytes
    assert sorted(result.stdout.split()) == sorted(str(path) for path in output.rglob("*") if path.is_file())
    return output


@pytest.fixture(scope="module")
def verdicts(folder: Path) -> list[dict]:
    return _verdicts(folder)


def test_it_is_authenticated_where_the_truth_says(folder: Path, verdicts: list[dict]) -> None:
    """1σ of the offset at 45 dBHz, 16 ms and taps of 15 m: 2 m, and up to 2 m more by a ray of −16 dB."""
    truth = _truth(folder)
    assert [one["status"] for one in verdicts] == ["AUTHENTIC"] * 3
    found = np.array([one["range_offset_m"] for one in verdicts])
    assert found == pytest.approx([float(row["range_offset_m"]) for row in truth], abs=8.0)
    assert [row["epoch"] for row in truth] == ["5", "6", "7"]


def test_the_campaign_says_the_same_of_the_same_epochs(verdicts: list[dict]) -> None:
    """Its samples have other noise, so the verdicts are equal, and range offsets differ by that noise: 1σ 2 m each."""
    settings = [one for one in SETTINGS if one != "--set"]
    scenario = load_scenario(QUICK, (*settings, "epochs=8", 'fidelity="samples"'))
    assert isinstance(scenario, CampaignScenario)
    results = direct_results(ScenarioPlan(scenario=scenario))
    said = [list(Status)[status].name for status in results["status"].values[5:8, 0]]
    assert [one["status"] for one in verdicts] == said
    offsets_m = results["range_offset_m"].sel(detector="early").values[5:8, 0]
    assert [one["range_offset_m"] for one in verdicts] == pytest.approx(offsets_m.tolist(), abs=12.0)


def test_recs_in_counter_mode_are_authenticated_in_counter_mode(tmp_path: Path) -> None:
    """At level 3 the search decrypts them too; in the other mode they are noise."""
    _written(simulate, QUICK, "-o", tmp_path / "case", "--epochs", "5:6", *SETTINGS, "--set", "recs.cipher_mode=ctr")
    assert "vestige process FOLDER --cipher-mode ctr" in (tmp_path / "case" / "README.txt").read_text()
    level_3 = ("--level", 3, "--search-window", 1e-4, "--search-ms", 16)
    (right,) = _verdicts(tmp_path / "case", *level_3, "--cipher-mode", "ctr")
    (wrong,) = _verdicts(tmp_path / "case", "--cipher-mode", "cbc")
    assert (right["status"], wrong["status"]) == ("AUTHENTIC", "NOT_DETECTED")
    outcomes = {check["name"]: check["outcome"] for check in right["checks"]}
    assert outcomes["E1 vestigial search"] == outcomes["E6 exhaustive search"] == "PASS"


def test_the_mode_changes_no_result_of_a_campaign() -> None:
    """The chips are those of the satellites; a processor of another mode than the service's finds nothing."""
    scenarios = [
        load_scenario(
            QUICK, ("epochs=3", "fidelity=samples", f"recs.cipher_mode={mode}", "receiver.sample_rate_hz=6.2e6")
        )
        for mode in ("cbc", "ctr")
    ]
    in_cbc, in_ctr = (direct_results(ScenarioPlan(scenario=one)) for one in scenarios)  # type: ignore[arg-type]
    assert all(in_cbc[name].values.tobytes() == in_ctr[name].values.tobytes() for name in in_cbc.data_vars)
    processor, source = vs.processor_of(scenarios[1]), vs.simulate(scenarios[1])  # type: ignore[arg-type]
    assert processor.cipher_mode is CipherMode.CTR
    assert {one.status for one in processor.run(source)} == {Status.AUTHENTIC}
    wrong = replace(processor, cipher_mode=CipherMode.CBC)
    assert {one.status for one in wrong.run(source)} == {Status.NOT_DETECTED}


def test_the_group_delay_is_in_the_signal(tmp_path: Path) -> None:
    """Whoever drops it is wrong by (γ − 1) c · BGD, whoever has its sign wrong by twice that.

    Without rays, which bend the flanks, and with little noise; E6-B leaves a tenth of a metre.
    """
    alone = ("--set", "receiver.multipath=none", "--set", "receiver.cn0_dbhz=70.0")
    _written(simulate, QUICK, "-o", tmp_path / "case", "--epochs", "5:8", *SETTINGS, *alone)
    (bgd,) = (tmp_path / "case" / "assistance").glob("*.BGD")
    data = bytearray(bgd.read_bytes())
    lsb = int.from_bytes(data[92:94], "little", signed=True)  # of E11
    delay_m = ((154 / 125) ** 2 - 1) * 299_792_458 * lsb / 2**32
    assert 0.2 < abs(delay_m) < 0.8
    assert [float(row["group_delay_m"]) for row in _truth(tmp_path / "case")] == pytest.approx([delay_m] * 3)
    right = [one["range_offset_m"] for one in _verdicts(tmp_path / "case")]
    for value, wrong in ((0, 1), (-lsb, 2)):
        data[92:94] = value.to_bytes(2, "little", signed=True)
        bgd.write_bytes(data)
        moved = np.subtract([one["range_offset_m"] for one in _verdicts(tmp_path / "case")], right)
        assert moved == pytest.approx([wrong * delay_m] * 3, rel=0.2)


def test_with_e1_out_of_the_samples(folder: Path, tmp_path: Path) -> None:
    for path in folder.glob("*.sigmf-*"):
        (tmp_path / path.name).symlink_to(path)
    verdicts = _verdicts(tmp_path, "--assistance", folder / "assistance")
    assert [one["status"] for one in verdicts] == ["AUTHENTIC"] * 3
    # E6 − E1 without the errors of the observations; the E1 snapshot has 2 m (1σ) of its own
    expected = [float(row["iono_diff_m"]) + float(row["bias_m"]) for row in _truth(folder)]
    assert [one["range_offset_m"] for one in verdicts] == pytest.approx(expected, abs=12.0)


def test_e6_that_comes_late_is_refused(folder: Path, tmp_path: Path) -> None:
    recording = open_recording(folder)
    metas = []
    for reader, delay in ((recording.e1, 0), (recording.e6, 2)):  # two samples, 97 m
        assert reader is not None
        batch = reader.read(reader.first_sample, reader.n_samples)
        late = replace(batch, first_sample=batch.first_sample + delay, start=batch.start + delay / FS)
        metas.append(
            write_sigmf(tmp_path / batch.band.value.lower(), [late], form=reader.file.form, time_uncertainty_s=1.0)
        )
    write_collection(tmp_path / "recording", metas)
    shutil.copy(folder / "observations.csv", tmp_path)
    verdicts = _verdicts(tmp_path, "--assistance", folder / "assistance", "--taps", 21)
    assert {one["status"] for one in verdicts} == {"SPOOFED"}
    assert np.mean([one["range_offset_m"] for one in verdicts]) == pytest.approx(96.7, abs=8.0)


def test_the_recs_of_another_seed_do_not_correlate(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    _written(simulate, QUICK, "--epochs", "5:8", "-o", other, *SETTINGS, "--set", "seed=2")
    verdicts = _verdicts(folder, "--assistance", other / "assistance")
    assert not {one["status"] for one in verdicts} & {"AUTHENTIC", "NOT_AVAILABLE"}
    assert all(one["range_offset_m"] is None for one in verdicts)


def test_the_folder_makes_itself_again(folder: Path, tmp_path: Path) -> None:
    _written(simulate, folder / "scenario.toml", "--epochs", "5:8", "-o", tmp_path / "again")
    for path in (tmp_path / "again").rglob("*"):
        if path.is_file():
            assert path.read_bytes() == (folder / path.relative_to(tmp_path / "again")).read_bytes(), path.name


def test_rinex_says_what_csv_says(folder: Path) -> None:
    rinex, table = (open_observations(folder / name) for name in ("rinex/observations.rnx", "observations.csv"))
    for a, b in zip(rinex, table, strict=True):
        assert a.time - b.time == pytest.approx(0, abs=1e-9)
        assert a.observations[11].pseudorange_m == pytest.approx(b.observations[11].pseudorange_m, abs=5e-4)
        cycles = b.observations[11].carrier_phase_cycles
        assert a.observations[11].carrier_phase_cycles == pytest.approx(cycles, abs=5e-4)
        assert a.observations[11].doppler_hz == pytest.approx(b.observations[11].doppler_hz, abs=5e-4)


def test_inspect_finds_it_whole(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(e1_signals, "SVIDS", (9, 11))
    text = _written(inspect, folder).stdout
    assert "3 RECS can be in the E6 samples" in text
    assert "observations.csv: CSV, 3 epochs" in text
    assert "validated keys" in text


def test_inspect_looks_for_all_satellites(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    searched: set[int] = set()
    monkeypatch.setattr(e1_signals, "acquire", lambda _, svids, **__: searched.update(svids) or ())
    _written(inspect, folder)
    assert searched == set(range(1, 37))


def test_ion_metadata_open_the_same_samples(
    folder: Path, verdicts: list[dict], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The standard has no bound on the clock's error, so a person states it."""
    monkeypatch.setattr(e1_signals, "SVIDS", (9, 11))
    own, ion = open_recording(folder), open_recording(folder / "recording.sdrx")
    for a, b in ((own.e1, ion.e1), (own.e6, ion.e6)):
        assert a is not None
        assert b is not None
        assert (a.file.path, a.file.form, a.start, a.n_samples) == (b.file.path, b.file.form, b.start, b.n_samples)
        assert a.file.center_frequency_hz == b.file.center_frequency_hz
    stated = _verdicts(folder / "recording.sdrx", "--time-uncertainty", 1.0)
    assert stated == verdicts
    assert {one["status"] for one in _verdicts(folder / "recording.sdrx")} == {"NOT_AVAILABLE"}
    assert "3 RECS can be in the E6 samples" in _written(inspect, folder / "recording.sdrx").stdout
    (tmp_path / "a.xml").write_text((folder / "recording.sdrx").read_text().replace("<url>", f"<url>{folder}/"))
    assert "a.xml" in _written(inspect, tmp_path / "a.xml", "--assistance", folder / "assistance").stdout
    result = json.loads(_written(search, "e1", folder / "recording.sdrx", "--svids", 11, "--json").stdout)
    assert [one["svid"] for one in result["signals"]] == [11]


def test_levels_of_int8_leave_room(folder: Path) -> None:
    for band in ("e1", "e6"):
        counts = np.fromfile(folder / f"{band}.sigmf-data", np.int8).astype(float)
        # noise of 14.1 counts; both components add 2 C/N0 / f_s of its power, 1 %
        assert np.std(counts) == pytest.approx(20 / np.sqrt(2), rel=0.01)
        assert np.abs(counts).max() < 127


def test_gnss_sdr_gets_a_configuration(folder: Path) -> None:
    for band, signal in (("e1", "1B"), ("e6", "E6")):
        lines = (folder / "gnss-sdr" / f"{band}.conf").read_text().splitlines()
        settings = dict(line.split("=", 1) for line in lines if "=" in line)
        assert (folder / "gnss-sdr" / settings["SignalSource.filename"]).resolve().stat().st_size == 2 * 0.5 * FS
        assert settings["SignalSource.sampling_frequency"] == "6200000"
        assert settings["SignalSource.item_type"] == "ibyte"
        assert (settings["Channel0.signal"], settings["Channel0.satellite"]) == (signal, "11")
    assert settings["Tracking_E6.track_pilot"] == "false"


def test_pocketsdr_gets_few_levels_and_the_conjugate(folder: Path) -> None:
    for band in ("e1", "e6"):
        own = np.fromfile(folder / f"{band}.sigmf-data", np.int8).astype(float).reshape(-1, 2)
        theirs = np.fromfile(folder / "pocketsdr" / f"{band}.bin", np.int8).reshape(-1, 2)
        assert np.abs(theirs).max() <= 7
        assert np.sqrt(np.mean(theirs.astype(float) ** 2)) == pytest.approx(2.0, abs=0.05)  # rounding adds 1/12
        assert np.corrcoef(own[:, 0], theirs[:, 0])[0, 1] > 0.98
        assert np.corrcoef(own[:, 1], theirs[:, 1])[0, 1] < -0.98
        tag = dict(line.split(" = ") for line in (folder / "pocketsdr" / f"{band}.bin.tag").read_text().splitlines())
        assert (tag["F_S "], tag["IQ  "], tag["FMT "]) == ("6.2", "2", "INT8X2")
    commands = (folder / "pocketsdr" / "README.txt").read_text()
    assert "-sig E6B -prn 11 -opt pocket_trk.conf -fmt INT8X2 -f 6.2 -fo 1278.75 -IQ 2" in commands
    options = (folder / "pocketsdr" / "pocket_trk.conf").read_text().splitlines()
    assert [line.partition("#")[0].split() for line in options if line.partition("#")[0]] == [["b_pll", "=", "10.0"]]


@pytest.mark.parametrize(("component", "scale"), [("int16", 1000.0), ("float32", 1.0)])
def test_other_formats(tmp_path: Path, component: str, scale: float) -> None:
    _written(simulate, QUICK, "--epochs", "0:1", "-o", tmp_path / "case", *SETTINGS, "--format", component)
    values = np.fromfile(tmp_path / "case" / "e6.sigmf-data", {"int16": "<i2", "float32": "<f4"}[component])
    assert np.std(values.astype(float)) == pytest.approx(scale / np.sqrt(2), rel=0.02)
    assert [one["status"] for one in _verdicts(tmp_path / "case")] == ["AUTHENTIC"]


def test_open_recordings_are_exported_too(tmp_path: Path) -> None:
    settings = ("--set", "duration_s=0.06", "--set", "receiver.sample_rate_hz=6.2e6")
    result = _written(simulate, SCENARIOS / "first_light.toml", "-o", tmp_path / "a", *settings, "--export", "gnss-sdr")
    assert str(tmp_path / "a" / "osnma" / "keys.csv") in result.stdout
    assert "Channels_1B.count=5" in (tmp_path / "a" / "gnss-sdr" / "e1.conf").read_text()


def test_keys_of_an_open_recording_are_proven_by_each_of_its_files(tmp_path: Path) -> None:
    settings = ("--set", "duration_s=0.06", "--set", "receiver.sample_rate_hz=6.2e6")
    _written(simulate, SCENARIOS / "first_light.toml", "-o", tmp_path / "a", *settings)
    osnma, start = tmp_path / "a" / "osnma", GalileoTime.parse("2026-11-21T12:00:00 GST")
    key, tree = osnma / "public_key.pem", osnma / "merkle_tree.xml"
    for trust in ((key, None), (key.with_suffix(".xml"), None), (key, tree), (None, tree)):
        keys = read_key_file(osnma / "keys.csv", load_public_keys(*trust))
        assert {start, start + 30} <= {one.time for one in keys}


@pytest.mark.parametrize("epochs", [("--epochs", "3"), ("--epochs", "1:x"), ("--epochs", "-1:4")])
def test_epochs_are_a_range(tmp_path: Path, epochs: tuple[str, ...]) -> None:
    assert isinstance(_invoke(simulate, QUICK, "-o", tmp_path / "a", *epochs).exception, click.UsageError)


def test_a_recording_has_none(tmp_path: Path) -> None:
    result = _invoke(simulate, SCENARIOS / "first_light.toml", "-o", tmp_path / "a", "--epochs", "0:1")
    assert isinstance(result.exception, click.UsageError)


def test_absurd_sizes_are_refused_unless_asked_for(tmp_path: Path) -> None:
    result = _invoke(simulate, QUICK, "-o", tmp_path / "a", "--epochs", "0:20000")
    assert isinstance(result.exception, VestigeError)
    assert str(result.exception) == "19999.3 s of E1 and E6: 1e+03 GB, which is more than --max-gb 10"
    result = _invoke(simulate, QUICK, "-o", tmp_path / "a", "--epochs", "0:20000", "--max-gb", 1e6)
    assert isinstance(result.exception, VestigeError)  # no disk has it
    assert list(tmp_path.iterdir()) == []


def test_gnss_sdr_takes_whole_hertz(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(simulated_recording, "record_band")  # it is refused before a sample is made
    settings = (*SETTINGS, "--set", "receiver.sample_rate_hz=6200000.5")
    result = _invoke(simulate, QUICK, "--epochs", "0:1", "-o", tmp_path / "a", *settings, "--export", "gnss-sdr")
    assert isinstance(result.exception, UnsupportedError)
    assert str(result.exception) == (
        "--export gnss-sdr: found 6200000.5 Hz, expected a whole number of Hz; change receiver.sample_rate_hz"
    )
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_written_over(folder: Path) -> None:
    result = _invoke(simulate, QUICK, "--epochs", "5:8", "-o", folder, *SETTINGS)
    assert isinstance(result.exception, InputFileError)


def test_nothing_is_left_of_a_run_that_was_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(_base: Path, _metas: list[Path]) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(simulated_recording, "write_collection", stopped)
    result = _invoke(simulate, QUICK, "--epochs", "0:1", "-o", tmp_path / "a", *SETTINGS)
    assert isinstance(result.exception, (KeyboardInterrupt, click.Abort))
    assert list(tmp_path.iterdir()) == []
