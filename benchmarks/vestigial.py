"""Measure detections and false alarms of both vestigial searches on many seeds of scenarios/vestigial.toml.

With the spoofer, the script runs the E1 search with hand-over (candidate times 4 ms apart, 5 taps) and the exhaustive
search of 16 ms. Both search windows of E6 around the two signals, at the thresholds of the whole ±15 s. A search is
right if it finds exactly both signals, declares spoofing and takes the earlier signal, at its half chip, as true.

Without the spoofer (`attack=none`) the script counts the searches that declare spoofing, at P_FA 1e-3 of the searched
window; the exhaustive search then has 4 ms. An alarm is a second peak.

    python benchmarks/vestigial.py [--spoofed 100] [--clear 1000] [-j 2] [--json FILE]

The exit status is 1 if fewer than 99 % are right, or if the number of alarms is outside the two-sided binomial interval
(1e-3) of P_FA.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from scipy.special import bdtr

from vestige.acas_processor.searches.vestigial import CandidateInterval, decide_vestigial, handover_line, handover_peaks
from vestige.receiver.simulation import SVID
from vestige.records import Band, ChipSequence
from vestige.sample_processor.e1_snapshot import measure_e1
from vestige.sample_processor.search.e1_search import search_e1
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.handover_search import search_handover
from vestige.sample_processor.search.peak import Peak, separated
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated
from vestige.simulated.simulated_recording import SimulatedRecording
from vestige.theory.search_budget import search_budget

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "vestigial.toml"
UNCERTAINTY_S = 30.0  # ±15 s
CHIP_S = 1 / 5.115e6
E1_PERIODS = 12
SPOOFED_S, CLEAR_S = 0.06, 0.004  # length of the searched window around each signal
HANDOVER_CLEAR_S = 0.05
ERROR = 1e-3  # error probability of the binomial interval


def chips_of(case: AcasTestCase) -> ChipSequence:
    """Return the decrypted RECS."""
    simulation = case.simulation
    return encrypted_chips(encryption_key(simulation.seed), SVID, simulation.start, simulation.n_chips)


def e1_lines(recording: SimulatedRecording, chips: ChipSequence, *, secondary: bool) -> list[CandidateInterval]:
    """Return the lines of all signals on E1 in 100 ms."""
    batch = recording.window(Band.E1, 0.05, 0.15)
    lines = []
    for one in search_e1(batch, [SVID], periods=E1_PERIODS):
        snapshot = measure_e1(batch, one)
        if snapshot is not None:
            line = handover_line(snapshot, chips, secondary=secondary)
            lines.append(CandidateInterval(line=line, first_start=batch.start + -60.0, last_start=batch.start + 60.0))
    return lines


def spoofed(seed: int) -> dict[str, bool]:
    """Return whether each search is right in a case with the spoofer."""
    case = _case(f"seed={seed}")
    recording, chips, start = simulated(case), chips_of(case), case.simulation.start
    delay_s = case.scenario.attack[0].delay_s  # type: ignore[union-attr]
    true_s = float(case.satellites[0].received_s[0])
    lines = e1_lines(recording, chips, secondary=False)
    search = ExhaustiveSearch(integration_s=16e-3, workers=1)
    limits = (
        search_budget(2 * 5 * UNCERTAINTY_S / 4e-3, 16e-3, doppler_step_hz=0.0).threshold,
        search_budget(search.hypotheses(UNCERTAINTY_S), 16e-3).threshold,
    )
    peaks: tuple[list[Peak], list[Peak]] = ([], [])
    for late_s in (0.0, delay_s):
        begin_s = late_s + true_s - SPOOFED_S * (0.2 + 0.6 * np.random.default_rng(seed).random())
        e6 = BatchSource(recording.window(Band.E6, begin_s, begin_s + SPOOFED_S + 0.017))
        for one in lines:
            peaks[0].extend(search_handover(e6, one.line, start, start + 60.0, limits[0]))
        *_, state = search.run(e6, [chips], start, start + 60.0, limits[1])
        peaks[1].extend(state.peaks)
    found = {}
    for name, own in zip(("handover", "exhaustive"), peaks, strict=True):
        decision = decide_vestigial(SVID, separated(own))
        arrivals_s = [one.start_time - start - true_s for one in decision.peaks]
        found[name] = len(arrivals_s) == 2 and bool(np.allclose(arrivals_s, [0.0, delay_s], rtol=0, atol=CHIP_S / 2))
    return found


def clear(seed: int) -> dict[str, bool]:
    """Return whether each search declares spoofing without a spoofer."""
    case = _case(f"seed={seed}", "attack=none")
    recording, chips, start = simulated(case), chips_of(case), case.simulation.start
    true_s = float(case.satellites[0].received_s[0])
    lines = e1_lines(recording, chips, secondary=False)
    e6 = BatchSource(recording.window(Band.E6, true_s - HANDOVER_CLEAR_S / 2, true_s + HANDOVER_CLEAR_S / 2 + 0.016))
    handed, _ = handover_peaks(e6, lines)
    search = ExhaustiveSearch(integration_s=4e-3, workers=1)
    limit = search_budget(search.hypotheses(CLEAR_S), 4e-3).threshold
    first = start + (true_s - CLEAR_S / 2)
    *_, state = search.run(e6, [chips], first, first + CLEAR_S, limit)
    return {
        "e1": len(lines) > 1,
        "handover": decide_vestigial(SVID, handed).spoofed,
        "exhaustive": decide_vestigial(SVID, state.peaks).spoofed,
    }


def within(count: int, trials: int, probability: float, error: float = ERROR) -> bool:
    """Return whether a count lies in the two-sided binomial interval."""
    below, above = bdtr(count, trials, probability), 1 - bdtr(count - 1, trials, probability) if count else 1.0
    return bool(min(below, above) > error / 2)


def _case(*settings: str) -> AcasTestCase:
    scenario = load_scenario(SCENARIO, settings)
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=scenario, first=0, end=1)


def main() -> int:
    """Print the counts; return 1 if a limit is not met."""
    parser = argparse.ArgumentParser(description="Both vestigial searches on many seeds.")
    parser.add_argument("--spoofed", type=int, default=100, help="seeds with the spoofer")
    parser.add_argument("--clear", type=int, default=1000, help="seeds without")
    parser.add_argument("-j", "--workers", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path, help="write the result to this file")
    arguments = parser.parse_args()
    begin, held, report = time.perf_counter(), True, {}
    with ProcessPoolExecutor(arguments.workers) as pool:
        right = list(pool.map(spoofed, range(1, arguments.spoofed + 1)))
        alarms = list(pool.map(clear, range(1, arguments.clear + 1)))
    for name in right[0] if right else ():
        count = sum(one[name] for one in right)
        good = count >= 0.99 * len(right)
        print(f"spoofed, {name:12}{count} of {len(right)} right, bar 99 %: {'held' if good else 'MISSED'}")
        held, report[f"right {name}"] = held and good, count
    for name in alarms[0] if alarms else ():
        count = sum(one[name] for one in alarms)
        good = within(count, len(alarms), 1e-3)
        print(f"clear,   {name:12}{count} of {len(alarms)} alarms, P_FA 1e-3: {'held' if good else 'MISSED'}")
        held, report[f"alarms {name}"] = held and good, count
    print(f"{time.perf_counter() - begin:.0f} s")
    if arguments.json:
        arguments.json.write_text(json.dumps(report | {"spoofed": len(right), "clear": len(alarms)}, indent=2) + "\n")
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
