"""Compare tracking of E1 of eight satellites with straightforward numpy and gnss-sdr in the same run.

The script makes a short recording of `scenarios/night.toml` with E1 only, int8. `vestige` tracks the recording on a
single thread. The time includes reading and decoding the file, without the first stretch, which searches for all
satellites. The straightforward version computes a code period with an `np.exp`, a floor and a look-up for each
correlator. If gnss-sdr is installed, it gets the same file and the list of satellites. The CPU time of gnss-sdr
includes start and acquisition, so the ratio to gnss-sdr is for the whole file.

`benchmarks/live.py` measures the whole receiver, both bands and all checks included.

    python benchmarks/tracking.py [--seconds 30] [--json FILE]

The exit status is 1 if a limit is not met, or if the ratio to gnss-sdr was not measured.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from vestige.recording.recording import Recording, open_recording
from vestige.recording.samples.exports import export
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sigmf_writer import SigmfWriter
from vestige.recording.tracked.track_recording import tracked_batches
from vestige.records import Band
from vestige.sample_processor.tracking.channel import correlator_lags
from vestige.sample_processor.tracking.settings import TrackingSettings
from vestige.sample_processor.tracking.tracking_receiver import TrackingReceiver
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated

NIGHT = Path(__file__).parents[1] / "scenarios" / "night.toml"
AT_LEAST = {"times_real_time": 5.0, "ratio_to_gnss_sdr": 2.0}


def _case(epochs: int) -> AcasTestCase:
    scenario = load_scenario(NIGHT, ())
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=scenario, first=0, end=epochs)


def made(folder: Path, seconds: int) -> Recording:
    """Write E1 of `scenarios/night.toml` and return it as a recording."""
    case = _case(seconds + 1)
    form = SampleFormat(component="int8", layout="iq")
    with ThreadPoolExecutor(2) as pool, SigmfWriter(folder / "e1", form=form, scale=20.0) as writer:
        for batch in simulated(case).record(Band.E1, pool=pool):
            writer.append(batch)
    recording = open_recording(folder / "e1.sigmf-meta")
    export("gnss-sdr", recording, folder, simulated(case).exported_sky)
    return recording


def vestige_s(recording: Recording) -> tuple[float, float, int]:
    """Return the CPU time of tracking, its part after the first stretch, and the number of tracked satellites."""
    assert recording.e1 is not None
    receiver = TrackingReceiver()
    begun = time.process_time()
    stretches = receiver.run(tracked_batches(recording.e1))
    next(stretches)
    started = time.process_time()
    for _ in stretches:
        pass
    end = time.process_time()
    alive = sum(not track.channel.lost for track in receiver.tracks.values())
    return end - begun, end - started, alive


def straightforward_s(rate_hz: float) -> float:
    """Return the CPU time in s of a second of a satellite by the straightforward version, from a few code periods."""
    lags = correlator_lags(TrackingSettings(), rate_hz)
    n, periods = round(0.004 * rate_hz), 5
    samples = (np.random.default_rng(1).normal(size=2 * n) * 20).view(complex)
    begun = time.process_time()
    for _ in range(periods):
        t = np.arange(n) / rate_hz
        wiped = samples * np.exp(-2j * np.pi * 1234.5 * t)
        for signal, late in [(E1C, lag) for lag in lags] + [(E1B, 0)]:
            half_chips = np.floor(2 * signal.chip_rate_hz * (t - late / rate_hz)).astype(int) % 8184
            np.sum(wiped * primary_code(signal, 11)[half_chips // 2] * (1 - 2 * (half_chips % 2)))
    return (time.process_time() - begun) / (periods * 0.004)


def gnss_sdr_s(folder: Path) -> float:
    """Return the CPU time in s of gnss-sdr on the file; NaN if gnss-sdr is not installed."""
    if shutil.which("gnss-sdr") is None:
        return float("nan")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        ["gnss-sdr", "-c", "e1.conf", "-keyboard=false", "-log_dir=."],  # noqa: S607
        cwd=folder / "gnss-sdr",
        capture_output=True,
        check=False,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Measure and print; exit with status 1 if a limit is not met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=30)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "short").mkdir()
        vestige_s(made(folder / "short", 2))  # a first run, which compiles
        recording = made(folder, options.seconds)
        assert recording.e1 is not None
        whole_s, steady_s, satellites = vestige_s(recording)
        peer_s = gnss_sdr_s(folder)
        duration_s = recording.e1.duration_s
        plain_s = satellites * straightforward_s(recording.e1.file.sample_rate_hz)
    found = {
        "satellites": satellites,
        "duration_s": duration_s,
        "first_search_s": whole_s - steady_s,
        "work_s": steady_s / duration_s,
        "times_real_time": duration_s / steady_s,
        "ratio_to_numpy": plain_s * duration_s / steady_s,
        "ratio_to_gnss_sdr": peer_s / whole_s,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    for key, value in found.items():
        print(f"{key:18} {value:12.4g}")
    if options.json:
        options.json.write_text(json.dumps(found))
    if np.isnan(peer_s):
        print("not measured: ratio_to_gnss_sdr, because gnss-sdr is not installed", file=sys.stderr)
    missed = any(not found[key] >= bar for key, bar in AT_LEAST.items())  # a NaN misses its limit
    sys.exit(missed)


if __name__ == "__main__":
    main()
