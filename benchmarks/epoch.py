"""Compare vestige with straightforward numpy: an epoch of a satellite from chips to correlators, and normal numbers.

An epoch has a new code of 16 ms, the line of sight and three reflections, each with its own Doppler, noise, and eleven
correlators 15 m apart, at 12.5 MHz. The straightforward version is simple code: complex128, an `np.exp` per path, chips
looked up by `np.floor`, and a sum per correlator. The straightforward version does not measure the noise floor;
vestige's correlator does. Before any timing, the script checks that both give the same correlators without noise.

Times are CPU times of a single thread. Each round measures both versions and forms the ratio; the result is the median
over the rounds. Run the script in a fresh process, because a warm heap makes the straightforward version up to 1.4
times as fast.

    python benchmarks/epoch.py [--json FILE] [--rounds 9]

The exit status is 1 if a ratio is below its limit.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.records import Band, ChipSequence, CorrelatorBank, Handover, SampleBatch
from vestige.records.packed_chips import bits_of_packed, packed_bits
from vestige.sample_processor.correlator import correlate
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.signal_generator.noise_kernel import fill_normals, noise_key
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.time import GalileoTime

FS = 12.5e6
CHIP_RATE = 5.115e6
N_CHIPS = 81_840
PAD = 32  # twice this many chips are made before and after the segment
START = GalileoTime(1372, 480_136)
START_S = 10e-6  # start of the segment after the first sample
N_SAMPLES = int((N_CHIPS / CHIP_RATE + 2 * START_S) * FS)
DOPPLER_HZ, RATE_HZ_PER_S = 1234.5, -0.7
DELAY_M = np.array([0.0, 12.0, 55.0, 160.0])
AMPLITUDE = amplitude(45.0, FS) * np.array([1.0, 0.2 + 0.1j, -0.15j, 0.1])
RAY_HZ = np.array([0.0, 0.7, -1.1, 2.3])
OFFSETS_M = 15.0 * np.arange(-5, 6)
BARS = {"epoch": 60.0, "normals": 9.0}


def straightforward(code: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
    """Return the taps; `code` has 2 PAD chips before and after the segment."""
    t = np.arange(N_SAMPLES) / FS - START_S
    u = CHIP_RATE * ((1 + DOPPLER_HZ / E6_CARRIER_HZ) * t + 0.5 * RATE_HZ_PER_S / E6_CARRIER_HZ * t**2)
    x = np.zeros(N_SAMPLES, complex)
    if rng is not None:
        x = (rng.standard_normal(N_SAMPLES) + 1j * rng.standard_normal(N_SAMPLES)) * np.sqrt(0.5)
    for delay_m, a, own_hz in zip(DELAY_M, AMPLITUDE, RAY_HZ, strict=True):
        carrier = np.exp(2j * np.pi * ((DOPPLER_HZ + own_hz) * t + 0.5 * RATE_HZ_PER_S * t**2))
        chip = code[np.floor(u - delay_m / SPEED_OF_LIGHT_MPS * CHIP_RATE).astype(int) + 2 * PAD]
        x += a * chip * carrier
    y = x * np.exp(-2j * np.pi * (DOPPLER_HZ * t + 0.5 * RATE_HZ_PER_S * t**2))
    replica = np.concatenate([np.zeros(3 * PAD), code[2 * PAD : -2 * PAD], np.zeros(3 * PAD)])
    taps = [
        np.sum(y * replica[np.floor(u - offset_m / SPEED_OF_LIGHT_MPS * CHIP_RATE).astype(int) + 3 * PAD])
        for offset_m in OFFSETS_M
    ]
    return np.array(taps) / (N_CHIPS / (CHIP_RATE * (1 + DOPPLER_HZ / E6_CARRIER_HZ)) * FS)


def vestige_samples(chips: ChipSequence, key: np.uint64 | None) -> SampleBatch:
    """Return the epoch's samples."""
    signal = ReceivedSignal(
        chips=chips,
        start_s=START_S,
        doppler_hz=DOPPLER_HZ,
        doppler_rate_hz_per_s=RATE_HZ_PER_S,
        delay_m=DELAY_M,
        amplitude=AMPLITUDE,
        ray_doppler_hz=RAY_HZ,
        lead_chips=2 * PAD,
    )
    samples = synthesize((signal,), sample_rate_hz=FS, n_samples=N_SAMPLES, noise_key=key)
    return SampleBatch(
        band=Band.E6,
        samples=samples,
        sample_rate_hz=FS,
        center_frequency_hz=E6_CARRIER_HZ,
        first_sample=0,
        start=START,
    )


def vestige_bank(batch: SampleBatch, chips: ChipSequence) -> CorrelatorBank:
    """Return the correlators of the segment, which lies 2 PAD chips within `chips`."""
    segment = ChipSequence(
        svid=chips.svid,
        transmit_time=chips.transmit_time + 2 * PAD / CHIP_RATE,
        chip_rate_hz=CHIP_RATE,
        n_chips=N_CHIPS,
        packed=packed_bits(bits_of_packed(chips.packed, (N_CHIPS + 4 * PAD) // 8), N_CHIPS, skip=2 * PAD),
    )
    handover = Handover(
        svid=11,
        chips=segment,
        start_time=START + START_S,
        doppler_hz=DOPPLER_HZ,
        doppler_rate_hz_per_s=RATE_HZ_PER_S,
    )
    bank = correlate(batch, handover, OFFSETS_M)
    assert bank is not None
    return bank


def new_chips(epoch: int) -> ChipSequence:
    """Return the code of an epoch."""
    return encrypted_chips(encryption_key(1), 11, START + epoch, N_CHIPS + 4 * PAD)


def vestige_epoch(epoch: int) -> CorrelatorBank:
    """Return the correlators of an epoch; code, samples and correlators are new."""
    chips = new_chips(epoch)
    return vestige_bank(vestige_samples(chips, noise_key(1, epoch, 6)), chips)


def straightforward_epoch(rng: np.random.Generator) -> np.ndarray:
    """Return the taps of an epoch; code, samples and taps are new."""
    return straightforward(1 - 2 * rng.integers(0, 2, N_CHIPS + 4 * PAD), rng)


def seconds(work: Callable[[int], object], repeats: int) -> float:
    """Return the CPU time of one call, mean of `repeats`."""
    begin = time.thread_time()
    for i in range(repeats):
        work(i)
    return (time.thread_time() - begin) / repeats


def check() -> None:
    """Check that both versions give the same correlators; this also compiles all kernels before any timing."""
    chips = new_chips(0)
    clean = vestige_bank(vestige_samples(chips, None), chips)
    error = np.max(np.abs(clean.taps - straightforward(chips.chips, None))) / np.abs(AMPLITUDE[0])
    assert error < 1e-5, f"correlators differ by {error:.1e}"
    noisy = vestige_epoch(0)
    assert np.max(np.abs(noisy.taps - clean.taps)) < 6 * np.sqrt(noisy.noise_power)


def measure(rounds: int) -> dict[str, list[float]]:
    """Return CPU seconds of one epoch, or of one normal, for each round."""
    rng = np.random.default_rng(1)
    chips, key = new_chips(0), noise_key(1, 0, 6)
    batch = vestige_samples(chips, key)
    buffer = np.empty(2 * N_SAMPLES, np.float32)
    jobs: dict[str, tuple[Callable[[int], object], int]] = {
        "straightforward epoch": (lambda _: straightforward_epoch(rng), 5),
        "vestige epoch": (vestige_epoch, 150),
        "  chips": (new_chips, 500),
        "  synthesis": (lambda _: vestige_samples(chips, key), 200),
        "  correlation": (lambda _: vestige_bank(batch, chips), 200),
        "numpy normal": (lambda _: rng.standard_normal(2 * N_SAMPLES), 50),
        "vestige normal": (lambda i: fill_normals(key, np.int64(i), np.float32(1), buffer), 500),
    }
    for work, _ in jobs.values():
        work(0)
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, (work, repeats) in jobs.items():
            per = 2 * N_SAMPLES if name.endswith("normal") else 1
            times[name].append(seconds(work, repeats) / per)
    return times


def main() -> int:
    """Print the table; return 1 if a ratio is below its limit."""
    parser = argparse.ArgumentParser(description="One epoch and the normals against numpy.")
    parser.add_argument("--json", type=Path, help="write the result to this file")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    check()
    times = measure(arguments.rounds)
    medians = {name.strip(): float(np.median(values)) for name, values in times.items()}
    ratios = {
        what: float(np.median(np.divide(times[slow], times[fast])))
        for what, slow, fast in (
            ("epoch", "straightforward epoch", "vestige epoch"),
            ("normals", "numpy normal", "vestige normal"),
        )
    }
    print(f"16 ms at {FS / 1e6} MHz, {DELAY_M.size} rays, {OFFSETS_M.size} correlators; CPU time of one thread")
    for name in times:
        scale, unit = (1e9, "ns") if name.endswith("normal") else (1e3, "ms")
        print(f"{name:24s}{medians[name.strip()] * scale:10.3f} {unit}")
    for what, ratio in ratios.items():
        verdict = "held" if ratio >= BARS[what] else "MISSED"
        print(f"{what:10s}{ratio:8.1f} x faster, bar {BARS[what]:.0f} x: {verdict}")
    if arguments.json:
        machine = {"processor": platform.processor() or platform.machine(), "python": platform.python_version()}
        result = {"seconds": medians, "ratios": ratios, "bars": BARS, "rounds": arguments.rounds, "machine": machine}
        arguments.json.write_text(json.dumps(result, indent=2) + "\n")
    return int(any(ratios[what] < bar for what, bar in BARS.items()))


if __name__ == "__main__":
    sys.exit(main())
