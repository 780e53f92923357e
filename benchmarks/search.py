"""Compare the vestigial searches with straightforward scipy versions in the same run.

* The exhaustive search covers 4 ms and ±5 kHz; the result is the number of hypotheses a second on a core. The
  straightforward version follows textbooks: complex128, 10.24 MHz, blocks of two code lengths. For each of 80 bins it
  rolls a spectrum and computes an inverse FFT.
* The hand-over search has 7500 candidate times in 30 s, each with 16 ms. The straightforward version correlates them in
  a loop with a carrier from `np.exp`; 20 of them are timed. The search runs with one and with five code offsets, on two
  seconds of samples that are repeated.
* The E1 search covers a period of 4 ms.

Times are CPU times of a single thread. Each round measures all versions and forms the ratios; the result is the median
over the rounds. With --full FOLDER the script makes a recording of 30 s at 10 MHz (600 MB, int8) in the folder and
searches it on all cores.

With --engine cuda the script also measures the GPU in wall time, transfers between processor and GPU included. The full
search runs twice, because the first run imports CuPy and compiles; the limit is for the second run. --satellites is the
number of RECS that are searched together; the samples contain one of them. --seconds searches only the last part of the
30 s, at the threshold of the whole, and scales the times up.

    python benchmarks/search.py [--json FILE] [--rounds 7] [--engine cuda]
                                [--full FOLDER [--integration-ms 4] [--satellites 1] [--seconds 30]]

The exit status is 1 if a limit is not met.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import platform
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import fft

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ
from vestige.recording.recording import open_recording
from vestige.records import Band, ChipSequence, SampleBatch
from vestige.sample_processor.search.e1_search import search_e1
from vestige.sample_processor.search.engines.choice import EngineName, choose_engine, make_engine
from vestige.sample_processor.search.engines.engine import CHIP_SIGMA, GRIDS, EngineUnavailableError
from vestige.sample_processor.search.engines.fft_engine import FftEngine
from vestige.sample_processor.search.engines.segment.segment_engine import SegmentEngine
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.handover_search import CandidateEpochs, handover_positions, search_handover
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.signals.definitions import E1C
from vestige.theory.search_budget import search_budget
from vestige.time import GalileoTime

START = GalileoTime(1372, 480_600)
RATE_HZ = 10e6
CHIP_RATE = 5.115e6
SEARCHED_S, KEPT_S = 30.0, 2.0  # E6 samples of the hand-over search, and the part of them that is in memory
PLACES = 7500
THRESHOLD = 7.85  # threshold for 30 s and 4 ms; an engine may leave out cells below it
NEVER = 1e3  # a threshold above all peaks, because the repeated samples would repeat the signal
BARS = {
    "fft": 2.0,
    "segment": 10.0,
    "cuda": 100.0,
    "handover_s": 0.6,
    "e1_s": 0.06,
    "full_4_s": 15.0,  # limit for each satellite, 120 s for eight
    "full_16_s": 150.0,
    "full_cuda_s": 5.0,
}
# start in s, C/N0 in dBHz, Doppler; cells lose up to 2.5 dB, and the threshold of eight satellites must find both
FULL_SIGNALS = ((19.3087654321, 44.0, -3312.5), (23.456789, 48.0, -3310.0))


@dataclass(frozen=True)
class Repeated:
    """Repeat the samples of a batch for `SEARCHED_S` and the length of a segment."""

    batch: SampleBatch

    @property
    def first_sample(self) -> int:
        return 0

    @property
    def end_sample(self) -> int:
        return round((SEARCHED_S + 16e-3) * RATE_HZ)

    def read(self, first: int, count: int) -> SampleBatch:
        samples = self.batch.samples
        at = min(first % samples.size, samples.size - count)  # no piece crosses the end: no copy
        return replace(self.batch, samples=samples[at : at + count], first_sample=first, start=START + first / RATE_HZ)


def arrival(chips: ChipSequence, start_s: float, cn0_dbhz: float, doppler_hz: float) -> ReceivedSignal:
    return ReceivedSignal(
        chips=chips,
        start_s=start_s,
        doppler_hz=doppler_hz,
        doppler_rate_hz_per_s=0.0,
        delay_m=np.zeros(1),
        amplitude=np.array([amplitude(cn0_dbhz, RATE_HZ) + 0j]),
        ray_doppler_hz=np.zeros(1),
    )


def straightforward_block(samples: np.ndarray, code: np.ndarray) -> float:
    """Search one block of two code lengths at 10.24 MHz; return the largest power."""
    n = code.size
    spectrum = fft.fft(samples)
    replica = np.conj(fft.fft(code, 2 * n))
    best = 0.0
    for shift in range(-40, 40):
        y = fft.ifft(np.roll(spectrum, -shift) * replica)[: n + 1]
        best = max(best, float(np.max(np.abs(y) ** 2)))
    return best


def straightforward_place(x: np.ndarray, chips: np.ndarray, start: int, doppler_hz: float) -> float:
    """Correlate 16 ms from a given sample on; return the power."""
    t = np.arange(int(chips.size / CHIP_RATE * RATE_HZ)) / RATE_HZ
    replica = chips[np.floor(CHIP_RATE * (1 + doppler_hz / E6_CARRIER_HZ) * t).astype(int) % chips.size]
    return float(np.abs(np.sum(x[start : start + t.size] * replica * np.exp(-2j * np.pi * doppler_hz * t))) ** 2)


def seconds(work: Callable[[], object]) -> float:
    begin = time.thread_time()
    work()
    return time.thread_time() - begin


def wall_seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def measure(rounds: int, engine: EngineName) -> dict[str, list[float]]:
    """Return hypotheses per second, or seconds, for each round; the engine cuda is measured only on request."""
    rng = np.random.default_rng(1)
    chips = encrypted_chips(encryption_key(1), 11, START, 81_840)
    n = 20_460
    code = chips.chips[None, :n]
    fast, plain = SegmentEngine(code), FftEngine(code)
    noise = np.rint(CHIP_SIGMA * rng.standard_normal((2, 2, n + fast.block))).clip(-100, 100).astype(np.int16)
    text_code = chips.chips[np.arange(40_960) * n // 40_960].astype(complex)
    text_samples = rng.standard_normal((81_920, 2)) @ [1, 1j]
    bins = GRIDS[n].bins_hz.size

    e6 = synthesize(
        (arrival(chips, 0.1, 40.0, 800.0),), sample_rate_hz=RATE_HZ, n_samples=int(KEPT_S * RATE_HZ),
        noise_key=noise_key(1, 0, 6),
    )  # fmt: skip
    once = BatchSource(_batch(Band.E6, e6, RATE_HZ, E6_CARRIER_HZ))
    line = CandidateEpochs(svid=11, chips=chips, anchor=START + 0.1, period_s=4e-3, doppler_hz=800.0)
    assert len(search_handover(once, line, START, START + KEPT_S, 6.0, taps=1)) == 1
    source = Repeated(once.batch)
    assert abs(handover_positions(source, line, START, START + SEARCHED_S).size - PLACES) <= 1

    def handed_over(taps: int) -> float:
        return seconds(lambda: search_handover(source, line, START, START + SEARCHED_S, NEVER, taps=taps))

    e1 = _batch(Band.E1, (rng.standard_normal((32_800, 2)) @ [1, 1j]).astype(np.complex64), 4.096e6, E1_CARRIER_HZ)

    jobs: dict[str, Callable[[], float]] = {
        "straightforward": lambda: 80 * 40_961 / seconds(lambda: straightforward_block(text_samples, text_code)),
        "fft": lambda: bins * plain.block / seconds(lambda: plain.powers(noise[:1], plain.block)),
        "segment": lambda: 2 * bins * fast.block / seconds(lambda: fast.powers(noise, fast.block, THRESHOLD)),
        "straightforward place": lambda: (
            seconds(lambda: [straightforward_place(e6, chips.chips, k * 40_000, 800.0) for k in range(20)])
            / 20
            * PLACES
        ),
        "handover": lambda: handed_over(1),
        "handover, 5 taps": lambda: handed_over(5),
        "e1": lambda: _process_seconds(lambda: search_e1(e1, [11], signals=(E1C,), periods=1)),
    }
    if engine == "cuda":
        gpu = make_engine("cuda", code)
        more = np.rint(CHIP_SIGMA * rng.standard_normal((2, 2, n + gpu.block))).clip(-100, 100).astype(np.int16)
        jobs["cuda"] = lambda: 2 * bins * gpu.block / wall_seconds(lambda: gpu.powers(more, gpu.block))
    for job in jobs.values():
        job()
    results: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, job in jobs.items():
            results[name].append(job())
    return results


def _process_seconds(work: Callable[[], object]) -> float:
    """Return CPU time over all threads."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def _batch(band: Band, samples: np.ndarray, rate_hz: float, center_hz: float) -> SampleBatch:
    return SampleBatch(
        band=band, samples=samples, sample_rate_hz=rate_hz, center_frequency_hz=center_hz, first_sample=0, start=START
    )


def make_recording(folder: Path, chips: ChipSequence) -> None:
    """Write 30.1 s of noise at 10 MHz, σ 16 LSB, with a signal and a later, stronger one."""
    folder.mkdir(parents=True, exist_ok=True)
    signals = [arrival(chips, *one) for one in FULL_SIGNALS]
    n = 1_000_000
    with (folder / "e6.bin").open("wb") as file:
        for first in range(0, 301_000_000, n):
            near = tuple(one for one in signals if first - n < one.start_s * RATE_HZ < first + 2 * n)
            x = synthesize(
                near, sample_rate_hz=RATE_HZ, n_samples=n, noise_key=noise_key(5, 0, 6), first_sample=first
            ).view(np.float32)
            np.clip(np.rint(x * np.float32(16 * np.sqrt(2))), -127, 127).astype(np.int8).tofile(file)
    (folder / "recording.toml").write_text(
        f'start = "{START}"\nsample_rate_hz = 10e6\n[e6]\nfile = "e6.bin"\nformat = "int8"\nlayout = "iq"\n'
        "center_frequency_hz = 1278.75e6\n"
    )


def full_search(
    folder: Path, integration_ms: float, engine: EngineName, satellites: int, searched_s: float
) -> dict[str, float]:
    """Search 30 s from end to end, print the signals that are found, and return times and memory."""
    chips = [encrypted_chips(encryption_key(1), 11 + k, START, 81_840) for k in range(satellites)]
    if not (folder / "e6.bin").exists():
        make_recording(folder, chips[0])
    reader = open_recording(folder).e6
    assert reader is not None
    search = ExhaustiveSearch(integration_s=integration_ms * 1e-3, engine=engine)
    hypotheses = search.hypotheses(searched_s, satellites)
    budget = search_budget(search.hypotheses(SEARCHED_S, satellites), search.integration_s)
    begin = reader.start + (SEARCHED_S - searched_s)
    for _ in search.run(reader, chips, begin, begin + 1e-3, budget.threshold):  # a first run, which compiles
        pass
    wall, cpu = time.perf_counter(), time.process_time()
    *_, state = search.run(reader, chips, begin, begin + searched_s, budget.threshold)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    assert [round((one.start_time - START) * CHIP_RATE) for one in state.peaks] == [
        round(start_s * CHIP_RATE) for start_s, _, _ in FULL_SIGNALS if start_s > SEARCHED_S - searched_s
    ]
    for one in state.peaks:
        print(f"found at {one.start_time - START:.9f} s, {one.doppler_hz:.1f} Hz, {one.magnitude:.2f} σ")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(
        f"{choose_engine(engine)}: {hypotheses:.4g} hypotheses of {integration_ms:g} ms: {wall:.2f} s, "
        f"CPU {cpu:.1f} s, {memory:.2f} GB"
    )
    whole = SEARCHED_S / searched_s
    return {"wall_s": whole * wall, "cpu_per_core_s": whole * cpu / (os.cpu_count() or 1), "memory_gb": memory}


def report_full(arguments: argparse.Namespace) -> bool:
    """Run the full search, print its limit, and return whether the limit is met."""
    of = (arguments.full, arguments.integration_ms, arguments.engine, arguments.satellites, arguments.seconds)
    if arguments.engine == "cuda":
        full_search(*of)
        found, bar = full_search(*of)["wall_s"], BARS["full_cuda_s"] * arguments.satellites
        held = found <= bar
        print(f"wall time {found:.2f} s, bar {bar:.0f} s: {'held' if held else 'MISSED'}")
        return held
    result = full_search(*of)
    bar = BARS["full_16_s" if arguments.integration_ms > 4 else "full_4_s"] * arguments.satellites
    found = result["cpu_per_core_s"]
    held = found <= bar and result["memory_gb"] <= 1.5
    print(f"CPU time a core for {SEARCHED_S:g} s {found:.1f} s, bar {bar:.0f} s: {'held' if held else 'MISSED'}")
    return held


def main() -> int:
    """Print the table; return 1 if a limit is not met."""
    parser = argparse.ArgumentParser(description="The vestigial searches against scipy.")
    parser.add_argument("--json", type=Path, help="write the result to this file")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--full", type=Path, help="folder for a recording of 30 s that is searched end to end")
    parser.add_argument("--integration-ms", type=float, default=4.0)
    parser.add_argument("--engine", choices=("segment", "fft", "cuda"), default="segment")
    parser.add_argument("--satellites", type=int, default=1)
    parser.add_argument(
        "--seconds",
        type=float,
        default=SEARCHED_S,
        help="with --full: search the last of the 30 s; times are scaled up",
    )
    arguments = parser.parse_args()
    try:
        choose_engine(arguments.engine)
    except EngineUnavailableError as error:
        parser.error(str(error))
    if arguments.full:
        return int(not report_full(arguments))

    results = measure(arguments.rounds, arguments.engine)
    medians = {name: float(np.median(values)) for name, values in results.items()}
    held = True
    engines = ["fft", "segment", *(["cuda"] if "cuda" in results else [])]
    for name in ("straightforward", *engines):
        print(f"{name:24s}{medians[name] / 1e6:10.1f} million hypotheses/s")
    for name in ("straightforward place", "handover", "handover, 5 taps", "e1"):
        print(f"{name:24s}{medians[name]:10.3f} s")
    ratios = {name: float(np.median(np.divide(results[name], results["straightforward"]))) for name in engines}
    for name, ratio in ratios.items():
        held &= ratio >= BARS[name]
        print(f"{name}: {ratio:.1f} x, bar {BARS[name]:.0f} x: {'held' if ratio >= BARS[name] else 'MISSED'}")
    for name, bar in (("handover", "handover_s"), ("handover, 5 taps", "handover_s"), ("e1", "e1_s")):
        held &= medians[name] <= BARS[bar]
        print(f"{name}: bar {BARS[bar]:g} s: {'held' if medians[name] <= BARS[bar] else 'MISSED'}")
    whole_s = 2.4e10 / medians["segment"]
    print(
        f"exhaustive (4 ms) over hand-over (7500 places and E1): {whole_s / (medians['handover'] + medians['e1']):.0f}"
    )
    if arguments.json:
        machine = {"processor": platform.processor() or platform.machine(), "python": platform.python_version()}
        report = {"medians": medians, "ratios": ratios, "bars": BARS, "rounds": arguments.rounds, "machine": machine}
        arguments.json.write_text(json.dumps(report, indent=2) + "\n")
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
