"""The independent receiver gnss-sdr: recordings of a sky for it, a run over one, and the fixes that it prints."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

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

needs_gnss_sdr = pytest.mark.skipif(
    shutil.which("gnss-sdr") is None, reason="gnss-sdr is not installed (Debian: apt-get install gnss-sdr)"
)

NIGHT = Path(__file__).resolve().parents[1] / "scenarios" / "night.toml"
LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M = 48.1, 11.6, 500.0
_LINE = re.compile(
    r"Position at (\d{4}-\w{3}-\d\d) (\d\d):(\d\d):(\d\d\.\d+) UTC using (\d+) observations is "
    r"Lat = (\S+) \[deg\], Long = (\S+) \[deg\], Height = (\S+) \[m\]"
)
GST_MINUS_UTC_S = 18


@dataclass(frozen=True, kw_only=True)
class Fixes:
    """What gnss-sdr printed: time on its clock after the start of the night, satellites used, ECEF position."""

    at_s: np.ndarray
    used: np.ndarray
    position_m: np.ndarray

    def east_north_up_m(self, latitude_deg: float, longitude_deg: float, height_m: float) -> np.ndarray:
        """Its way from a place."""
        place = ecef(latitude_deg, longitude_deg, height_m)
        return (self.position_m - place) @ local_axes_at(place)[0].T


def ecef(latitude_deg: float, longitude_deg: float, height_m: float) -> np.ndarray:
    """Return the position in m on the Earth's axes."""
    return ecef_from_geodetic(np.radians([latitude_deg]), np.radians([longitude_deg]), np.array([height_m]))


def case_of(first: int, end: int, *settings: str) -> AcasTestCase:
    """Return the seconds `first` to `end` of the night.

    A subframe takes 30 s; the ephemeris is in the pages of seconds 1 to 5 and 21 to 27.
    """
    scenario = load_scenario(NIGHT, settings)
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=scenario, first=first, end=end)


def record(folder: Path, case: AcasTestCase, band: Band) -> None:
    """Write the samples of one band into a folder, and the options of gnss-sdr into the folder `gnss-sdr` in it."""
    recording = simulated(case)
    form = SampleFormat(component="int8", layout="iq")
    name = band.value.lower()
    with SigmfWriter(folder / name, form=form, scale=20.0) as writer:
        for batch in recording.record(band):  # one thread: two take turns and use more time of the processor
            writer.append(batch)
    export("gnss-sdr", open_recording(folder / f"{name}.sigmf-meta"), folder, recording.exported_sky)
    options = folder / "gnss-sdr" / f"{name}.conf"  # almanac and UTC model are in no other file of gnss-sdr
    options.write_text(options.read_text().replace("xml_output_enabled=false", "xml_output_enabled=true"))


def run_gnss_sdr(folder: Path, name: str, timeout_s: float) -> str:
    """Run gnss-sdr in a folder on the samples of a band, and return what it printed."""
    run = subprocess.run(  # noqa: S603  (ours)
        ["gnss-sdr", "-c", f"{name}.conf", "-keyboard=false", "-log_dir=."],  # noqa: S607
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=timeout_s,
        check=False,
    )
    return run.stdout


def fix_count(printed: str) -> int:
    """Return how many fixes gnss-sdr printed."""
    return len(_LINE.findall(printed))


def fixes_of(printed: str) -> Fixes:
    """Return the fixes that gnss-sdr printed, at least one."""
    rows = []
    for _day, hour, minute, second, used, *place in _LINE.findall(printed):
        after_s = (int(hour) - 22) * 3600 + int(minute) * 60 + float(second) + GST_MINUS_UTC_S
        rows.append((after_s, int(used), *(float(value) for value in place)))
    assert rows, printed[-2000:]
    table = np.array(rows)
    position_m = ecef_from_geodetic(np.radians(table[:, 2]), np.radians(table[:, 3]), table[:, 4])
    return Fixes(at_s=table[:, 0], used=table[:, 1], position_m=position_m)


def run_until(
    folder: Path, name: str, timeout_s: float, enough: Callable[[str], bool], *, at_most: int
) -> tuple[str, int]:
    """Run gnss-sdr until what it printed, or wrote, is enough; return what it printed last, and the number of runs.

    The scheduler of gnss-sdr decides at which sample a channel begins. Now and then a channel is not pulled in, and is
    found again half a minute later. So gnss-sdr is started again on the same samples.
    """
    runs = 0
    while True:
        printed, runs = run_gnss_sdr(folder, name, timeout_s), runs + 1
        if enough(printed) or runs == at_most:
            return printed, runs


def fixes_by_gnss_sdr(folder: Path, case: AcasTestCase, timeout_s: float, *, least: int) -> Fixes:
    """Return what gnss-sdr makes of E1, from the first of three runs with at least `least` fixes; the samples stay."""
    record(folder, case, Band.E1)
    printed, _ = run_until(folder / "gnss-sdr", "e1", timeout_s, lambda said: fix_count(said) >= least, at_most=3)
    return fixes_of(printed)
