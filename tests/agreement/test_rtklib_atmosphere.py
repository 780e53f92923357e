"""`rnx2rtkp` of RTKLIB takes the troposphere of a recording out of our observations with a model of its own.

RTKLIB's model has the same zenith delay and maps it with 1/sin E, which is 3 % more at 10°, the elevation of the lowest
satellite. So its corrected positions are wrong by decimetres. Without the correction they are ten metres too high.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from vestige.navigation.earth import ecef_from_geodetic, local_axes_at
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import write_companions

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
SETTINGS = (
    "receiver.e1_tracking=none",
    'atmosphere={troposphere={kind="saastamoinen", relative_humidity=0.7}}',  # RTKLIB takes 0.7
)
OPTIONS = """\
pos1-posmode       =single
pos1-frequency     =l1
pos1-navsys        =8
pos1-elmask        =0
pos1-ionoopt       =off
pos1-sateph        =brdc
out-solformat      =xyz
pos1-tropopt       ="""


def error_m(folder: Path, model: str) -> np.ndarray:
    """Mean error east, north, up of RTKLIB's positions."""
    program = shutil.which("rnx2rtkp")
    if program is None:
        pytest.skip("needs rnx2rtkp of RTKLIB")
    (folder / "rtklib.conf").write_text(OPTIONS + model + "\n", encoding="ascii")
    command = [program, "-k", "rtklib.conf", "-o", "position.pos", "observations.rnx", "navigation.rnx"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)  # noqa: S603
    text = (folder / "position.pos").read_text().splitlines()
    rows = np.array([[float(value) for value in line.split()[2:5]] for line in text if not line.startswith("%")])
    truth = ecef_from_geodetic(*np.radians([[48.1], [11.6]]), np.array([500.0]))
    error: np.ndarray = ((rows - truth) @ local_axes_at(truth)[0].T).mean(axis=0)
    return error


@pytest.mark.judged(
    by="RTKLIB",
    what="troposphere of a simulated recording",
    figure="position within 1.0 m with its correction, more than 8.0 m too high without",
)
def test_rtklib_corrects_the_troposphere(tmp_path: Path) -> None:
    scenario = load_scenario(NIGHT, SETTINGS)
    assert isinstance(scenario, CampaignScenario)
    write_companions(AcasTestCase(scenario=scenario, first=28, end=34), tmp_path)
    left, whole = (error_m(tmp_path / "rinex", model) for model in ("saas", "off"))
    assert np.all(np.abs(left) < 1.0)
    assert whole[2] > 8.0
