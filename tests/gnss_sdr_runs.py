"""gnss-sdr for tests: it runs over a recording of a sky, and its tracking dumps are read."""

from __future__ import annotations

import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from vestige.recording.recording import open_recording
from vestige.recording.samples.exports import export
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import SigmfWriter
from vestige.records import Band
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated

# one record of the tracking dump of gnss-sdr 0.0.17
TRACK_RECORD = np.dtype(
    [
        ("correlators", "<f4", 5), ("prompt", "<f4", 2), ("sample", "<u8"), ("carrier_phase_rad", "<f4"),
        ("doppler_hz", "<f4"), ("doppler_rate", "<f4"), ("code_rate_hz", "<f4"), ("code_rate_rate", "<f4"),
        ("errors", "<f4", 4), ("cn0_dbhz", "<f4"), ("lock", "<f4"), ("aux1", "<f4"), ("aux2", "<f8"), ("svid", "<u4"),
    ]
)  # fmt: skip


def run_gnss_sdr(folder: Path, band: Band, timeout_s: float) -> str:
    """Run gnss-sdr in the folder of its configurations and return what it printed."""
    run = subprocess.run(  # noqa: S603  (ours)
        ["gnss-sdr", "-c", f"{band.value.lower()}.conf", "-keyboard=false", "-log_dir=."],  # noqa: S607
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=timeout_s,
        check=False,
    )
    return run.stdout


def gnss_sdr_on_sky(folder: Path, case: AcasTestCase, band: Band, timeout_s: float) -> str:
    """Record one band of a case, let gnss-sdr run over it, and return what it printed."""
    recording = simulated(case)
    form = SampleFormat(component="int8", layout="iq")
    name = band.value.lower()
    with ThreadPoolExecutor(2) as pool, SigmfWriter(folder / name, form=form, scale=20.0) as writer:
        for batch in recording.record(band, pool=pool):
            writer.append(batch)
    export("gnss-sdr", open_recording(folder / f"{name}.sigmf-meta"), folder, [one.svid for one in case.satellites])
    printed = run_gnss_sdr(folder / "gnss-sdr", band, timeout_s)
    (folder / f"{name}.sigmf-data").unlink()
    return printed
