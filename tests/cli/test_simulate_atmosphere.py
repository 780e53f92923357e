"""A recording with an atmosphere: what is in its files, and what the processor makes of it."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner

from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.constants import E1_CARRIER_HZ, GAMMA_E1_E6, SPEED_OF_LIGHT_MPS
from vestige.errors import VestigeError
from vestige.navigation.inav.ionosphere import NO_IONOSPHERE, BroadcastIonosphere
from vestige.navigation.inav.words import word_type
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
from vestige.recording.observations.observation_file import open_observations
from vestige.recording.recording import open_recording
from vestige.recording.samples.exports import export
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import SigmfWriter
from vestige.records import Band, SampleBatch
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated, write_companions

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
ON = 'atmosphere={troposphere={kind="saastamoinen"}, ionosphere={kind="ntcm-g", ai0_sfu=400.1, ai1_sfu_per_deg=0.5}}'
SETTINGS = ("constellation.svids=[7, 8]", "receiver.e1_tracking=none")


def case(*settings: str) -> AcasTestCase:
    scenario = load_scenario(NIGHT, (*SETTINGS, *settings))
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=scenario, first=28, end=32)


def truth(folder: Path) -> dict[tuple[str, str], dict[str, str]]:
    with (folder / "truth.csv").open() as stream:
        return {(row["epoch"], row["svid"]): row for row in csv.DictReader(stream)}


def test_the_files_hold_the_delays(tmp_path: Path) -> None:
    """E1 code is later by T + I, the carrier phase by T − I; word 5 has the coefficients, ionosphere.csv the delays."""
    folders = []
    for name, settings in (("with", (ON,)), ("without", ())):
        one = case(*settings)
        folders.append(tmp_path / name)
        folders[-1].mkdir()
        write_companions(one, folders[-1])
        assert one.message is not None
        words = [page.word for pages in one.message.pages.values() for page in pages if word_type(page.word) == 5]
        sent = BroadcastIonosphere(ai0_sfu=400.0, ai1_sfu_per_deg=0.5) if settings else NO_IONOSPHERE
        assert {BroadcastIonosphere.from_word(word) for word in words} == {sent}
    there, plain = (truth(folder) for folder in folders)
    assert set(next(iter(there.values()))) - set(next(iter(plain.values()))) == {"troposphere_m", "ionosphere_e1_m"}
    predicted = (folders[0] / "assistance" / "ionosphere.csv").read_text().splitlines()[1:]
    assert not (folders[1] / "assistance" / "ionosphere.csv").exists()
    for line in predicted:
        svid, delay_m = line.split(",")
        assert float(delay_m) == pytest.approx(float(there["30", svid]["ionosphere_e1_m"]), abs=1e-3)
    header = ["GAL    4.0000E+02  5.0000E-01  0.0000E+00  0.0000E+00       IONOSPHERIC CORR"]
    for folder, expected in zip(folders, (header, []), strict=True):
        lines = (folder / "rinex" / "navigation.rnx").read_text().splitlines()
        assert [line for line in lines if "IONOSPHERIC CORR" in line] == expected
        assert read_rinex_navigation(folder / "rinex" / "navigation.rnx")
    wavelength_m = SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
    for name, digits_m in (("observations.csv", 1e-6), ("rinex/observations.rnx", 1.1e-3)):
        with_it, without = (list(open_observations(folder / name)) for folder in folders)
        for epoch, (after, before) in enumerate(zip(with_it, without, strict=True), 28):
            for svid, one in after.observations.items():
                row, other = there[str(epoch), str(svid)], before.observations[svid]
                assert float(row["range_m"]) == pytest.approx(float(plain[str(epoch), str(svid)]["range_m"]), abs=1e-3)
                t_m, i_m = float(row["troposphere_m"]), float(row["ionosphere_e1_m"])
                assert one.pseudorange_m - other.pseudorange_m == pytest.approx(t_m + i_m, abs=digits_m + 1e-4)
                assert one.carrier_phase_cycles is not None
                assert other.carrier_phase_cycles is not None
                phase_m = (one.carrier_phase_cycles - other.carrier_phase_cycles) * wavelength_m
                assert phase_m == pytest.approx(t_m - i_m, abs=digits_m + 1e-4)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('{troposphere={kind="niell"}}', "atmosphere.troposphere.kind: found niell, expected 'saastamoinen'"),
        (
            '{troposphere={kind="saastamoinen", relative_humidity=2}}',
            "relative_humidity = 2, expected relative_humidity from 0 to 1",
        ),
        ('{ionosphere={kind="ntcm-g"}}', "atmosphere.ionosphere.ai0_sfu: found nothing, expected a value"),
        (
            '{ionosphere={kind="ntcm-g", ai0_sfu=600}}',
            "atmosphere.ionosphere.ai0_sfu: found 600, expected at most 511.75",
        ),
        ('{ionosphere={kind="nequick"}}', "atmosphere.ionosphere.kind: found nequick, expected 'ntcm-g'"),
    ],
)
def test_an_atmosphere_that_does_not_fit_is_one_line(table: str, said: str) -> None:
    with pytest.raises(VestigeError) as caught:
        case(f"atmosphere={table}")
    assert said in str(caught.value)


def test_an_atmosphere_belongs_to_a_sky() -> None:
    with pytest.raises(VestigeError, match=r"atmosphere: found no \[constellation\]"):
        load_scenario(NIGHT.with_name("quick.toml"), ('atmosphere={troposphere={kind="saastamoinen"}}',))


def written(command: click.Command, *arguments: object) -> str:
    result = CliRunner().invoke(command, [str(one) for one in arguments], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout


@pytest.mark.parametrize(
    ("tables", "troposphere", "ionosphere"),
    [
        ('{troposphere={kind="saastamoinen"}}', "Saastamoinen", "OFF"),
        ('{ionosphere={kind="ntcm-g", ai0_sfu=100}}', "OFF", "Broadcast"),
        ("{}", "OFF", "OFF"),
    ],
)
def test_gnss_sdr_corrects_what_the_signals_have(
    tmp_path: Path, tables: str, troposphere: str, ionosphere: str
) -> None:
    recording = simulated(case(f"atmosphere={tables}"))
    form = SampleFormat(component="int8", layout="iq")
    with SigmfWriter(tmp_path / "e1", form=form, scale=20.0) as writer:
        writer.append(
            SampleBatch(
                band=Band.E1,
                samples=np.zeros(10, np.complex64),
                sample_rate_hz=12.5e6,
                center_frequency_hz=E1_CARRIER_HZ,
                first_sample=0,
                start=recording.reference,
            )
        )
    (path,) = export("gnss-sdr", open_recording(writer.meta), tmp_path, recording.exported_sky)
    lines = path.read_text().splitlines()
    assert [line for line in lines if "_model=" in line] == [
        f"PVT.trop_model={troposphere}",
        f"PVT.iono_model={ionosphere}",
    ]
    assert ("; the signals have no troposphere" in lines) == (troposphere == "OFF")
    assert ("; the signals have no ionosphere except the errors of the scenario" in lines) == (ionosphere == "OFF")


@pytest.mark.slow
def test_the_processor_predicts_the_ionosphere_with_the_file_and_not_without(tmp_path: Path) -> None:
    """Without ionosphere.csv the range of E6 is (γ − 1) I longer than the prediction. At 70 dBHz noise is small."""
    settings = (*SETTINGS, ON, "receiver.sample_rate_hz=6.2e6", "receiver.cn0_dbhz=70.0", "receiver.cn0_e1_dbhz=60.0")
    options = [item for one in settings for item in ("--set", one)]
    written(simulate, NIGHT, "-o", tmp_path / "sky", "--epochs", "28:32", *options)

    def offsets_m() -> dict[int, float]:
        verdicts: list[dict[str, Any]] = json.loads(written(process, tmp_path / "sky", "--json"))["verdicts"]
        return {one["svid"]: one["range_offset_m"] for one in verdicts}

    right = offsets_m()
    (tmp_path / "sky" / "assistance" / "ionosphere.csv").unlink()
    wrong = offsets_m()
    rows = {int(svid): row for (epoch, svid), row in truth(tmp_path / "sky").items() if epoch == "30"}
    expected = {svid: (GAMMA_E1_E6 - 1) * float(row["ionosphere_e1_m"]) for svid, row in rows.items()}
    assert min(expected.values()) > 1.0
    for svid, moved_m in expected.items():
        assert wrong[svid] - right[svid] == pytest.approx(moved_m, rel=0.2)
        assert abs(right[svid]) < np.maximum(0.5, moved_m / 2)
