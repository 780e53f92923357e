"""Measure the threat table: wall time of the short table with two workers, and CPU time of the full one.

The script takes the wall time of `vestige threats --quick -j 2`, and the CPU time of `vestige threats --seeds N -j 1`
for two numbers of seeds. A single worker makes all runs in the process itself, so the CPU time of the process is that
of the table. The difference between the two runs is the CPU time of a seed, and the CPU time of 40 seeds follows from
it. Every run of the command is a fresh process; the first one compiles the kernels and does not count.

    python benchmarks/threats.py [--seeds 3] [--json FILE]

The exit status is 1 if a limit is not met: 80 s of wall time for the short table, on two idle cores, and 15 minutes of
CPU time for 40 seeds.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

QUICK_BAR_S = 80.0
FULL_SEEDS, FULL_BAR_S = 40, 900.0


def threats_s(*options: str) -> tuple[float, float]:
    """Run `vestige threats` and return its wall time and its CPU time in s."""
    before, begun = os.times(), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "vestige", "threats", *options, "-o", folder]
        subprocess.run(command, check=True, capture_output=True)  # noqa: S603
    after = os.times()
    cpu_s = after.children_user - before.children_user + after.children_system - before.children_system
    return time.monotonic() - begun, cpu_s


def main() -> int:
    """Print the times; return 1 if a limit is not met."""
    parser = argparse.ArgumentParser(description="Times of the threat table.")
    parser.add_argument("--seeds", type=int, default=3, help="seeds of the longer run, at least 2; the shorter has one")
    parser.add_argument("--json", type=Path, help="write the result to this file")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error("--seeds must be at least 2")
    threats_s("--seeds", "1", "-j", "1")  # compiles the kernels
    _, one_s = threats_s("--seeds", "1", "-j", "1")
    _, more_s = threats_s("--seeds", str(arguments.seeds), "-j", "1")
    quick_s, _ = threats_s("--quick", "-j", "2")
    seed_s = (more_s - one_s) / (arguments.seeds - 1)
    full_s = one_s + (FULL_SEEDS - 1) * seed_s
    print(f"short table, two workers: {quick_s:.1f} s of wall time, bar {QUICK_BAR_S:g} s")
    print(f"{FULL_SEEDS} seeds: {full_s / 60:.1f} min of CPU time, {seed_s:.1f} s a seed, bar {FULL_BAR_S / 60:g} min")
    if arguments.json:
        result = {"quick_wall_s": quick_s, "seed_cpu_s": seed_s, "full_cpu_s": full_s, "seeds": arguments.seeds}
        arguments.json.write_text(json.dumps(result, indent=2) + "\n")
    return int(quick_s > QUICK_BAR_S or full_s > FULL_BAR_S)


if __name__ == "__main__":
    sys.exit(main())
