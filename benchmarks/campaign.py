"""Measure rate, CPU time and memory of a campaign in the paper's harsh conditions, start of Python and store included.

The script runs `vestige run scenarios/harsh.toml` in a fresh process for each fidelity, with three multipath components
in place of one, and observes the process and its workers. CPU time is the sum over all these processes. Two runs of
different length separate the cost of an epoch from the cost of the start.

    python benchmarks/campaign.py [--epochs 10000] [--workers 2] [--rays 3] [--json FILE]

The limits for 100,000 epochs are 100 s of CPU time at `samples` and 5 s at `correlators`, on a core with AVX-512. In
the same run, `benchmarks/epoch.py` measures an epoch of the straightforward numpy version. An epoch at `samples` must
be at least 40 times as fast. The limits of 100 s and 40 times are the same where the numpy epoch takes 40 ms. The ratio
depends less on the speed of the machine than the time does, but load that comes and goes still changes the ratio (41 to
62 in six runs). Memory may reach 400 MB, workers included. Memory is read from /proc, so
the script needs Linux. The exit status is 1 if a limit is exceeded.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BARS_CPU_S = {"samples": 100.0, "correlators": 5.0}
BAR_RATIO = 40.0  # CPU time of the numpy epoch, divided by the CPU time of an epoch at `samples`
BAR_MB = 400.0
PAPER_EPOCHS = 100_000
LONGER = {"samples": 1, "correlators": 10}  # factor on the number of epochs in the longer run
SAMPLE_S = 0.02


def tree(root: int) -> list[int]:
    """Return a process and its descendants."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        children.setdefault(parent, []).append(int(stat.parent.name))
    found = [root]
    for pid in found:
        found += children.get(pid, [])
    return found


def resident_mb(pid: int) -> float:
    """Return the resident memory of a process; 0 if it has ended."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def watched(fidelity: str, epochs: int, workers: int, rays: int) -> dict[str, float]:
    """Return CPU time, wall time and peak memory of one run."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            *(sys.executable, "-m", "vestige.cli.main", "run", ROOT / "scenarios" / "harsh.toml"),
            *("-o", Path(folder) / "a.zarr", "-j", str(workers), "--fidelity", fidelity, "--json"),
            *("--set", f"epochs={epochs}", "--set", f"receiver.multipath.n_rays={rays}"),
        ]
        before, begin, peak_mb = os.times(), time.monotonic(), 0.0
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:  # noqa: S603
            while process.poll() is None:
                peak_mb = max(peak_mb, sum(map(resident_mb, tree(process.pid))))
                time.sleep(SAMPLE_S)
        assert process.returncode == 0
        after = os.times()
    cpu_s = after.children_user - before.children_user + after.children_system - before.children_system
    return {"epochs": epochs, "cpu_s": cpu_s, "wall_s": time.monotonic() - begin, "peak_mb": peak_mb}


def straightforward_epoch_s() -> float:
    """Return the CPU time of an epoch of the straightforward numpy version, which a fresh process measures."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "epoch.json"
        command = [sys.executable, ROOT / "benchmarks" / "epoch.py", "--rounds", "5", "--json", table]
        subprocess.run(command, stdout=subprocess.DEVNULL, check=False)  # noqa: S603  (exit status 1: a bar of epochs)
        return json.loads(table.read_text())["seconds"]["straightforward epoch"]


def main() -> int:
    """Print the table; return 1 if a limit is exceeded."""
    parser = argparse.ArgumentParser(description="The harsh conditions as a campaign.")
    parser.add_argument("--epochs", type=int, default=10_000, help="of samples; ten times as many correlator banks")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rays", type=int, default=3)
    parser.add_argument("--json", type=Path, help="write the result to this file")
    arguments = parser.parse_args()
    watched("samples", 10, arguments.workers, arguments.rays)  # a first run, which compiles the kernels
    missed, result = False, {}
    print("              epochs   wall s  epochs/s  start, CPU s  100,000 epochs, CPU s  peak MB")
    for fidelity, longer in LONGER.items():
        epochs = longer * arguments.epochs
        short = watched(fidelity, epochs // 10, arguments.workers, arguments.rays)
        full = watched(fidelity, epochs, arguments.workers, arguments.rays)
        each_s = (full["cpu_s"] - short["cpu_s"]) / (full["epochs"] - short["epochs"])
        start_s = full["cpu_s"] - each_s * full["epochs"]
        paper_s = start_s + each_s * PAPER_EPOCHS
        result[fidelity] = full | {"start_cpu_s": start_s, "paper_cpu_s": paper_s}
        print(
            f"{fidelity:12s}{epochs:8d} {full['wall_s']:8.1f} {epochs / full['wall_s']:9.0f} {start_s:13.1f} "
            f"{paper_s:22.1f} {full['peak_mb']:8.0f}"
        )
        missed |= paper_s > BARS_CPU_S[fidelity] or full["peak_mb"] > BAR_MB
    straightforward_s = straightforward_epoch_s()
    ratio = straightforward_s / (result["samples"]["paper_cpu_s"] / PAPER_EPOCHS)
    missed |= ratio < BAR_RATIO
    print(
        f"straightforward numpy, one epoch: {straightforward_s * 1e3:.1f} ms of CPU time, {ratio:.1f} times as long as "
        f"an epoch at samples (bar {BAR_RATIO:.0f})"
    )
    if arguments.json:
        machine = {"processor": platform.processor() or platform.machine(), "python": platform.python_version()}
        settings = {"workers": arguments.workers, "rays": arguments.rays}
        arguments.json.write_text(
            json.dumps({"runs": result, "ratio": ratio, **settings, "machine": machine}, indent=2) + "\n"
        )
    print("bars missed" if missed else "all bars met")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
