"""An independent receiver, gnss-sdr, on a whole sky: it decodes E1, finds the receiver by it, and locks E6-B.

The recordings are what `vestige simulate` writes, a band each. A fix is compared with the truth in local axes; bars are
those of a single-frequency receiver at 45 dBHz without smoothing.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from gnss_sdr_dump import TRACK_RECORD
from vestige.navigation.earth import ecef_from_geodetic, local_axes_at
from vestige.recording.recording import open_recording
from vestige.recording.samples.exports import export
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import SigmfWriter
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated

pytestmark = pytest.mark.skipif(
    shutil.which("gnss-sdr") is None, reason="gnss-sdr is not installed (Debian: apt-get install gnss-sdr)"
)

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M = 48.1, 11.6, 500.0
_LINE = re.compile(
    r"Position at (\d{4}-\w{3}-\d\d) (\d\d):(\d\d):(\d\d\.\d+) UTC using (\d+) observations is "
    r"Lat = (\S+) \[deg\], Long = (\S+) \[deg\], Height = (\S+) \[m\]"
)
GST_MINUS_UTC_S = 18
E6_SVIDS, E6_RATE_HZ, PULL_IN_S = (6, 8, 12, 13), 10_300_000.0, 5.0


@dataclass(frozen=True, kw_only=True)
class Fixes:
    """What gnss-sdr printed: time on its clock after the start, satellites used, ECEF position."""

    at_s: np.ndarray
    used: np.ndarray
    position_m: np.ndarray

    def east_north_up_m(self, latitude_deg: float, longitude_deg: float, height_m: float) -> np.ndarray:
        """Its way from a place."""
        place = ecef(latitude_deg, longitude_deg, height_m)
        return (self.position_m - place) @ local_axes_at(place)[0].T


def ecef(latitude_deg: float, longitude_deg: float, height_m: float) -> np.ndarray:
    return ecef_from_geodetic(np.radians([latitude_deg]), np.radians([longitude_deg]), np.array([height_m]))


def case_of(seconds: int, *settings: str) -> AcasTestCase:
    scenario = load_scenario(NIGHT, settings)
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=scenario, first=0, end=seconds)


def gnss_sdr(folder: Path, case: AcasTestCase, band: Band, timeout_s: float) -> str:
    """Record one band, let gnss-sdr run over it, and return what it printed."""
    recording = simulated(case)
    form = SampleFormat(component="int8", layout="iq")
    name = band.value.lower()
    with ThreadPoolExecutor(2) as pool, SigmfWriter(folder / name, form=form, scale=20.0) as writer:
        for batch in recording.record(band, pool=pool):
            writer.append(batch)
    export("gnss-sdr", open_recording(folder / f"{name}.sigmf-meta"), folder, [one.svid for one in case.satellites])
    run = subprocess.run(  # noqa: S603  (ours)
        ["gnss-sdr", "-c", f"{name}.conf", "-keyboard=false", "-log_dir=."],  # noqa: S607
        cwd=folder / "gnss-sdr",
        capture_output=True,
        text=True,
        errors="replace",
        timeout=timeout_s,
        check=False,
    )
    (folder / f"{name}.sigmf-data").unlink()
    return run.stdout


def fixes_of(printed: str) -> Fixes:
    rows = []
    for _day, hour, minute, second, used, *place in _LINE.findall(printed):
        after_s = (int(hour) - 22) * 3600 + int(minute) * 60 + float(second) + GST_MINUS_UTC_S
        rows.append((after_s, int(used), *(float(value) for value in place)))
    assert rows, printed[-2000:]
    table = np.array(rows)
    position_m = ecef_from_geodetic(np.radians(table[:, 2]), np.radians(table[:, 3]), table[:, 4])
    return Fixes(at_s=table[:, 0], used=table[:, 1], position_m=position_m)


def test_the_fix_of_a_receiver_that_stands(tmp_path: Path) -> None:
    """Six satellites or more, a first fix within a minute of signal, mean and every epoch near the truth."""
    found = fixes_of(gnss_sdr(tmp_path, case_of(100), Band.E1, 500))
    error_m = found.east_north_up_m(LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M)
    mean_m = error_m.mean(axis=0)
    assert found.at_s[0] < 60
    assert found.at_s.size > 40
    assert np.median(found.used) >= 6
    assert np.hypot(*mean_m[:2]) < 2.0
    assert abs(mean_m[2]) < 4.0
    assert np.linalg.norm(error_m, axis=1).max() < 15.0


def test_the_fix_of_a_receiver_on_a_circle(tmp_path: Path) -> None:
    """20 m/s round a radius of 400 m: within 10 m in 95 % of the epochs."""
    place = "latitude_deg=48.1, longitude_deg=11.6, height_m=500.0"
    case = case_of(60, f'trajectory={{kind="circle", {place}, radius_m=400.0, speed_mps=20.0}}')
    found = fixes_of(gnss_sdr(tmp_path, case, Band.E1, 300))
    path = case.satellites[0].simulation.elevation.path.trajectory
    there_m = path.motion(found.at_s).position_m
    error_m = np.linalg.norm(found.position_m - there_m, axis=1)
    assert found.at_s.size > 15
    assert np.quantile(error_m, 0.95) < 10.0


def test_a_meaconer_moves_the_fix_to_its_antenna(tmp_path: Path) -> None:
    """An antenna 1.8 km away, received 20 dB over the true signals from the start. At 5 MHz, for the sake of time."""
    antenna = (48.11, 11.62, 520.0)
    attack = (
        'attack=[{kind="meaconing", start_s=0, power_db=20, delay_s=1e-6, reception_gain_db=30, antenna='
        "{latitude_deg=48.11, longitude_deg=11.62, height_m=520.0}}]"
    )
    found = fixes_of(gnss_sdr(tmp_path, case_of(60, attack, "receiver.sample_rate_hz=5e6"), Band.E1, 300))
    error_m = found.east_north_up_m(*antenna).mean(axis=0)
    assert np.linalg.norm(found.east_north_up_m(LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M).mean(axis=0)) > 1500
    assert np.hypot(*error_m[:2]) < 5.0
    assert abs(error_m[2]) < 10.0


def test_it_locks_e6_b_of_every_satellite(tmp_path: Path) -> None:
    """Doppler within 0.5 Hz, C/N0 within 1 dB, with the encrypted E6-C and three other satellites beside each."""
    case = case_of(10, f"constellation.svids={list(E6_SVIDS)}", f"receiver.sample_rate_hz={E6_RATE_HZ}")
    assert tuple(one.svid for one in case.satellites) == E6_SVIDS
    printed = gnss_sdr(tmp_path, case, Band.E6, 300)
    for channel, satellite in enumerate(case.satellites):
        dump = tmp_path / "gnss-sdr" / f"e6_track{channel}.dat"
        assert dump.exists(), printed[-2000:]
        track = np.fromfile(dump, TRACK_RECORD)
        track = track[track["sample"] > PULL_IN_S * E6_RATE_HZ]
        assert track.size > 3000, f"gnss-sdr lost E6-B of E{satellite.svid:02}"
        assert set(track["svid"]) == {satellite.svid}
        truth = satellite.truth_table()
        at_s = satellite.truth.time_s + np.array(truth["received_s"], float)
        true_hz = np.interp(track["sample"] / E6_RATE_HZ, at_s, np.array(truth["doppler_e6_hz"], float))
        assert np.mean(track["doppler_hz"] - true_hz) == pytest.approx(0, abs=0.5)
        assert np.mean(track["cn0_dbhz"]) == pytest.approx(satellite.simulation.cn0_dbhz, abs=1.0)
