"""Our observation and navigation files in `rnx2rtkp` of RTKLIB: out comes the true position, a faulty satellite or not.

Debian has it in the package `rtklib`. Ranges have noise of 1 m and neither ionosphere nor troposphere.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import local_axes_at
from vestige.navigation.position_fix import position_fix, transmission
from vestige.receiver.constellation import Sky, sky, walker_ephemerides
from vestige.receiver.trajectory import StaticTrajectory
from vestige.recording.observation_epoch import ObservationEpoch
from vestige.recording.rinex_navigation import write_rinex_navigation
from vestige.recording.rinex_writer import write_rinex_observations
from vestige.records import E1Observation
from vestige.streams import stream
from vestige.time import GalileoTime

START = GalileoTime(1372, 604_770)  # one minute, half of it in the next week
TIMES = np.arange(60.0)
CLOCK_M = 1234.5 + 2.0 * TIMES
PLACE = StaticTrajectory(latitude_deg=52.2, longitude_deg=4.4, height_m=30.0)
ALL = walker_ephemerides(GalileoTime(1372, 604_200))
OPTIONS = """pos1-posmode=single
pos1-frequency=l1
pos1-elmask=5
pos1-ionoopt=off
pos1-tropopt=off
pos1-sateph=brdc
pos1-navsys=8
pos1-posopt5=on
out-solformat=xyz
out-timesys=gpst
"""


@pytest.fixture(scope="module")
def rnx2rtkp() -> str:
    program = shutil.which("rnx2rtkp")
    if program is None:
        pytest.skip("needs rnx2rtkp of RTKLIB")
    return program


def _observed() -> tuple[Sky, np.ndarray]:
    true_s = TIMES - CLOCK_M / SPEED_OF_LIGHT_MPS
    view = sky(ALL, START, true_s, PLACE.motion(true_s), mask_deg=10.0)
    noise = stream(31, "rtklib").standard_normal(view.range_m.shape)
    pseudorange = view.range_m + CLOCK_M[:, None] - view.satellite_clock_m + noise
    return view, np.where(view.in_view, pseudorange, np.nan)


def _solve(rnx2rtkp: str, folder: Path, view: Sky, pseudorange: np.ndarray) -> np.ndarray:
    """Return RTKLIB's positions."""
    epochs = []
    for k, elapsed in enumerate(TIMES):
        seen = {
            svid: E1Observation(
                svid=svid,
                pseudorange_m=float(pseudorange[k, column]),
                carrier_phase_cycles=float("nan"),
                doppler_hz=float(-view.rate_mps[k, column] * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS),
                doppler_rate_hz_per_s=float("nan"),
                cn0_dbhz=45.0,
            )
            for column, svid in enumerate(view.svids)
            if np.isfinite(pseudorange[k, column])
        }
        epochs.append(ObservationEpoch(time=START + float(elapsed), observations=seen))
    write_rinex_observations(folder / "test.obs", epochs)
    write_rinex_navigation(folder / "test.nav", ALL)
    (folder / "test.conf").write_text(OPTIONS)
    command = [rnx2rtkp, "-k", "test.conf", "-o", "test.pos", "test.obs", "test.nav"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)  # noqa: S603
    rows = [line.split() for line in (folder / "test.pos").read_text().splitlines() if not line.startswith("%")]
    return np.array([[float(value) for value in row[2:5]] for row in rows])


@pytest.mark.parametrize("fault_m", [0.0, 300.0])
def test_rtklib_finds_the_true_position(rnx2rtkp: str, tmp_path: Path, fault_m: float) -> None:
    """The mean of 60 epochs within 4 σ an axis; RTKLIB weighs by elevation, hence a third more σ than ours."""
    view, pseudorange = _observed()
    faulty = pseudorange + fault_m * (np.arange(len(view.svids)) == 2)
    found = _solve(rnx2rtkp, tmp_path, view, faulty)
    assert len(found) == TIMES.size
    sent = transmission([ALL[svid - 1] for svid in view.svids], START, TIMES, pseudorange)
    used = np.ones_like(pseudorange)
    if fault_m:
        used[:, 2] = np.nan  # RAIM of RTKLIB leaves it out
    fix = position_fix(sent, pseudorange, used)
    truth = PLACE.motion(TIMES[:1]).position_m
    axes = local_axes_at(truth)[0]
    sigma = np.sqrt(np.diagonal(axes @ fix.covariance_m2[0, :3, :3] @ axes.T)) * 4 / 3
    error = (found - truth) @ axes.T
    assert np.all(np.abs(error.mean(axis=0)) < 4 * sigma / np.sqrt(TIMES.size))
    assert np.all(np.abs(error) < 5 * sigma)
    np.testing.assert_allclose(found, fix.position_m, atol=5 * float(sigma.max()))
