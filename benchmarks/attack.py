"""Compare the time of an epoch with and without an attack, from chips to correlators, at the `samples` fidelity.

The epochs are made as in `vestige run`: new chips, encryption with the key of the epoch, samples with multipath and
noise, and the real processor. The attacks are the lift-off of `scenarios/liftoff.toml` while it is on, and each
jamming waveform. Times are CPU times of a single thread. Each round measures all cases and forms the ratios; the
result is the median over the rounds.

    python benchmarks/attack.py [--json FILE] [--rounds 9]

The exit status is 1 if the limit is exceeded: an epoch under attack may take 40 % more time.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import platform
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from vestige.acas_processor.processor import AcasProcessor
from vestige.receiver.simulation import Simulation
from vestige.receiver.snapshots.simulated_receiver import SimulatedReceiver
from vestige.receiver.truth import TruthBlock
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.spoofer.interference import Jam
from vestige.spoofer.jammers import ALL_JAMMERS
from vestige.spoofer.spoofer import NO_SPOOFER, Spoofer

LIFTOFF = Path(__file__).resolve().parents[1] / "scenarios" / "liftoff.toml"
FIRST, EPOCHS = 1000, 40  # while the spoofing signal is there
BAR = 1.4


def simulations() -> dict[str, Simulation]:
    """Return the receiver without an attacker, and with each attacker."""
    scenario = load_scenario(LIFTOFF)
    assert isinstance(scenario, CampaignScenario)
    liftoff = scenario.simulation()
    jammed = {
        f"{waveform().kind} jamming": replace(
            liftoff, spoofer=Spoofer(attacks=(Jam(j_over_n_db=3.0, waveform=waveform()),))
        )
        for waveform in ALL_JAMMERS
    }
    return {"harsh": replace(liftoff, spoofer=NO_SPOOFER), "lift-off": liftoff} | jammed


def truth_of(simulation: Simulation) -> TruthBlock:
    """Return the truth of the epochs that are timed."""
    process = simulation.truth()
    process.advance(0, FIRST)
    return process.advance(FIRST, EPOCHS)


def receiver_of(simulation: Simulation) -> SimulatedReceiver:
    """Return the receiver of samples on one line of sight."""
    return SimulatedReceiver(
        simulations=(simulation,), fidelity="samples", interval_s=simulation.interval_s, with_taps=False
    )


def measure(rounds: int) -> dict[str, list[float]]:
    """Return CPU seconds of one epoch for each round."""
    cases = {name: (receiver_of(one), truth_of(one)) for name, one in simulations().items()}
    processor = AcasProcessor()
    times: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(rounds + 1):  # the first round compiles
        for name, (receiver, truth) in cases.items():
            begin = time.thread_time()
            processor.measure(receiver.snapshots(FIRST, (truth,)), receiver.assistance)
            if number:
                times[name].append((time.thread_time() - begin) / EPOCHS)
    return times


def main() -> int:
    """Print the table; return 1 if the limit is exceeded."""
    parser = argparse.ArgumentParser(description="One epoch under attack against one without.")
    parser.add_argument("--json", type=Path, help="write the result to this file")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    times = measure(arguments.rounds)
    ratios = {name: float(np.median(np.divide(values, times["harsh"]))) for name, values in times.items()}
    for name, values in times.items():
        verdict = "" if name == "harsh" else "held" if ratios[name] <= BAR else "MISSED"
        print(f"{name:20s}{1e3 * float(np.median(values)):8.3f} ms{ratios[name]:8.2f} x  {verdict}")
    print(f"bar: {BAR} x")
    if arguments.json:
        machine = {"processor": platform.processor() or platform.machine(), "python": platform.python_version()}
        seconds = {name: float(np.median(values)) for name, values in times.items()}
        result = {"seconds": seconds, "ratios": ratios, "bar": BAR, "rounds": arguments.rounds, "machine": machine}
        arguments.json.write_text(json.dumps(result, indent=2) + "\n")
    return int(any(ratio > BAR for ratio in ratios.values()))


if __name__ == "__main__":
    sys.exit(main())
