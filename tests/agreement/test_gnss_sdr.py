"""An independent receiver, gnss-sdr, on a test case: it finds E6-B and E1 and measures what the truth says."""

from __future__ import annotations

import csv
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from gnss_sdr_dump import TRACK_RECORD
from vestige.cli.recordings.simulate import command as simulate

pytestmark = pytest.mark.skipif(
    shutil.which("gnss-sdr") is None, reason="gnss-sdr is not installed (Debian: apt-get install gnss-sdr)"
)

FS = 12_000_000
CN0_DBHZ = 45.0  # of each component
PULL_IN_S = 4.0
SCENARIO = f"""
kind = "campaign"
seed = 7
start = "2026-11-21T12:00:00 GST"
epochs = 10
[line_of_sight]
s0_m = 24_000_000.0
v_mps = -280.0
a_mps2 = 0.2
[receiver]
cn0_dbhz = {CN0_DBHZ}
cn0_e1_dbhz = {CN0_DBHZ}
sample_rate_hz = {FS}.0
[receiver.clock]
kind = "two-state"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    room = tmp_path_factory.mktemp("agreement")
    (room / "scenario.toml").write_text(SCENARIO)
    arguments = [room / "scenario.toml", "--epochs", "0:10", "-o", room / "case", "--export", "gnss-sdr"]
    result = CliRunner().invoke(simulate, [str(one) for one in arguments], standalone_mode=False)
    assert result.exception is None
    return room / "case"


@pytest.mark.judged(
    by="gnss-sdr",
    what="samples of one satellite on E1 and E6-B",
    figure="Doppler within 0.5 Hz, C/N0 within 1.0 dB",
)
@pytest.mark.parametrize(
    ("band", "carrier_hz", "chip_rate_hz", "replica_db"),
    [("e6", 1278.75e6, 5.115e6, 0.0), ("e1", 1575.42e6, 1.023e6, 10 * np.log10(10 / 11))],
)
def test_doppler_and_strength(
    folder: Path, band: str, carrier_hz: float, chip_rate_hz: float, replica_db: float
) -> None:
    """Doppler within 0.5 Hz, C/N0 within 1 dB; the code moves with the carrier.

    On E1 gnss-sdr correlates with BOC(1,1), which holds 10/11 of the power of CBOC(6,1,1/11).
    """
    run = subprocess.run(  # noqa: S603  (ours)
        ["gnss-sdr", "-c", f"{band}.conf", "-keyboard=false", "-log_dir=."],  # noqa: S607
        cwd=folder / "gnss-sdr",
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    dump = folder / "gnss-sdr" / f"{band}_track0.dat"
    assert dump.exists(), run.stdout[-2000:]
    track = np.fromfile(dump, TRACK_RECORD)
    track = track[track["sample"] > PULL_IN_S * FS]
    assert track.size > 1000, "gnss-sdr lost the signal"
    assert set(track["svid"]) == {11}

    with (folder / "truth.csv").open() as stream:
        truth = list(csv.DictReader(stream))
    at_s = [float(row["epoch"]) + float(row["received_s"]) for row in truth]
    true_hz = np.interp(track["sample"] / FS, at_s, [float(row[f"doppler_{band}_hz"]) for row in truth])
    assert np.mean(track["doppler_hz"] - true_hz) == pytest.approx(0, abs=0.5)
    assert np.mean(track["cn0_dbhz"]) == pytest.approx(CN0_DBHZ + replica_db, abs=1.0)
    code_hz = np.mean(track["code_rate_hz"].astype(float)) - chip_rate_hz
    assert code_hz == pytest.approx(np.mean(true_hz) * chip_rate_hz / carrier_hz, abs=0.3)
