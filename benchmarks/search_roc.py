"""Measure the receiver operating characteristic of both searches on samples, beside theory with the losses of the grid.

python benchmarks/search_roc.py -o roc.png [--trials 300]
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vestige.constants import E6_CARRIER_HZ
from vestige.plots import roc_curves, write
from vestige.records import Band, ChipSequence, SampleBatch
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.handover_search import CandidateEpochs, search_handover
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.theory.search_budget import roc
from vestige.theory.thresholds import single_event_pfa, threshold
from vestige.time import GalileoTime

START = GalileoTime(1372, 480_600)
RATE_HZ, CHIP_S, PERIOD_S = 12.5e6, 1 / 5.115e6, 4e-3
MEASURED = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
THEORY = np.logspace(-6, 0, 60)[:-1]


def samples(chips: ChipSequence, start_s: float, cn0_dbhz: float, doppler_hz: float, seed: int) -> BatchSource:
    """Return noise that contains a signal of 4 ms of chips, with a margin."""
    signal = ReceivedSignal(
        chips=chips,
        start_s=start_s,
        doppler_hz=doppler_hz,
        doppler_rate_hz_per_s=0.0,
        delay_m=np.zeros(1),
        amplitude=np.array([amplitude(cn0_dbhz, RATE_HZ) + 0j]),
        ray_doppler_hz=np.zeros(1),
    )
    x = synthesize((signal,), sample_rate_hz=RATE_HZ, n_samples=50_500, noise_key=noise_key(seed, 0, 6))
    return BatchSource(
        SampleBatch(
            band=Band.E6,
            samples=x,
            sample_rate_hz=RATE_HZ,
            center_frequency_hz=E6_CARRIER_HZ,
            first_sample=0,
            start=START,
        )
    )


def measured(limits: list[float], cn0_dbhz: float, trials: int, search: Callable[..., int]) -> np.ndarray:
    """Return the number of signals found at each threshold; each signal lies at random between the grid points."""
    rng = np.random.default_rng(5)
    chips = encrypted_chips(encryption_key(1), 11, START, 20_460)
    found = np.zeros(len(limits), np.int64)
    for trial in range(trials):
        start_s, doppler_hz = 18e-6 + rng.uniform(0, 4) * CHIP_S, rng.uniform(-4900, 4900)
        source = samples(chips, start_s, cn0_dbhz, doppler_hz, 3000 + trial)
        off_s = rng.uniform(-0.25, 0.25) * CHIP_S
        found += [search(source, chips, start_s + off_s, doppler_hz, limit) > 0 for limit in limits]
    return found


def exhaustive(source: BatchSource, chips: ChipSequence, start_s: float, _doppler_hz: float, limit: float) -> int:
    """Return the number of peaks within some chips of the signal."""
    first = START + (start_s - 3 * CHIP_S)
    *_, state = ExhaustiveSearch(workers=1).run(source, [chips], first, first + 6 * CHIP_S, limit)
    return len(state.peaks)


def handover(source: BatchSource, chips: ChipSequence, start_s: float, doppler_hz: float, limit: float) -> int:
    """Return the number of peaks at the time of the signal."""
    line = CandidateEpochs(svid=11, chips=chips, anchor=START + start_s, period_s=PERIOD_S, doppler_hz=doppler_hz)
    return len(search_handover(source, line, START, START + 1, limit))


def main() -> None:
    """Draw the figure and print its points."""
    parser = argparse.ArgumentParser(description="ROC of the vestigial searches.")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--trials", type=int, default=300)
    arguments = parser.parse_args()
    curves = []
    for name, cn0_dbhz, n, search, bins in (
        ("exhaustive, 4 ms", 40.12, 2.4e10, exhaustive, True),
        ("hand-over, 4 ms, 7500 places", 37.65, 7500.0, handover, False),
    ):
        theory = roc(cn0_dbhz, PERIOD_S, n, list(THEORY), bins=bins)
        limits = [float(threshold(single_event_pfa(pfa, n))) for pfa in MEASURED]
        found = measured(limits, cn0_dbhz, arguments.trials, search)
        curves.append(
            (
                f"{name}, {cn0_dbhz:g} dBHz",
                THEORY,
                np.array([one.probability_of_detection for one in theory]),
                np.array(MEASURED),
                found,
                arguments.trials,
            )
        )
        points = roc(cn0_dbhz, PERIOD_S, n, MEASURED, bins=bins)
        for point, count in zip(points, found, strict=True):
            print(
                f"{name}: P_FA {point.overall_pfa:g}: theory {point.probability_of_detection:.3f}, "
                f"measured {count / arguments.trials:.3f}"
            )
    write(roc_curves(curves, title="Vestigial searches: the strongest cell, measured"), arguments.output)


if __name__ == "__main__":
    main()
