"""Compare vestige with straightforward numpy: a recorded second of a whole sky in both bands.

The samples are those of `vestige simulate` without writing to disk: E1-B, E1-C, E6-B and encrypted E6-C of each
satellite with noise, quantised to int8. The straightforward version follows the definition
(`waveform.Component.received`) over 10 ms: complex128, with a floor, a look-up and an `np.exp` for each component. Its
pseudoranges are interpolated, so the ratio compares the computation of samples and not of orbits. The script checks
that both versions give the same samples without noise.

`work_s` is the CPU time of a recorded second on a single thread, and `ratio` divides CPU times. `wall_s` is measured
with two threads; its limit is valid only on an idle machine.

    python benchmarks/sky.py [--satellites 8] [--rate 12.5e6] [--seconds 4] [--json FILE]

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
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.recorder import ReceivedSatellite, record_band
from vestige.recording.samples.sample_format import SampleFormat, encode
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.range_model import RangeHistory
from vestige.signal_generator.synthesis import amplitude
from vestige.signals.definitions import CARRIER_HZ
from vestige.simulated.exported_case import AcasTestCase

NIGHT = Path(__file__).parents[1] / "scenarios" / "night.toml"
BARS = {"ratio": 25.0, "wall_s": 1.0, "memory_mb": 400.0}
FORM = SampleFormat(component="int8", layout="iq")
_PLAIN_S = 0.01  # length of the straightforward version, in s; its CPU time is scaled to a second


def interpolated_range_m(path: RangeHistory, t_s: np.ndarray) -> np.ndarray:
    """Return the pseudorange at the sample times, from the cubic through its values at four of them.

    Over 10 ms the error is below 1e-6 m. Without interpolation the orbits take four fifths of the straightforward
    version, and the ratio would say little about how samples are made.
    """
    known_s = t_s[[0, t_s.size // 3, 2 * t_s.size // 3, -1]]
    known_m = path.range_m(known_s)
    return known_m[0] + Polynomial.fit(known_s, known_m - known_m[0], 3)(t_s)


def plain(sky: tuple[ReceivedSatellite, ...], band: Band, rate_hz: float, n: int) -> np.ndarray:
    """Return n samples about 0.5 s after the start, by the straightforward version."""
    t = (round(rate_hz / 2) + np.arange(n)) / rate_hz
    x = np.zeros(n, complex)
    for one in sky:
        held, p = one.propagation(0.5), interpolated_range_m(one.pseudorange, t)
        p_code = p + held.delay_m
        turn = np.exp(2j * np.pi * CARRIER_HZ[band] / 299_792_458.0 * (p_code - p))
        for component in one.components:
            x += (
                held.amplitude
                * amplitude(one.cn0_dbhz, rate_hz)
                * turn
                * component.received(t, p_code, CARRIER_HZ[band])
            )
    return x


def made(sky: tuple[ReceivedSatellite, ...], band: Band, rate_hz: float, **how: Any) -> Iterator[np.ndarray]:
    """Yield samples of a band; `how` are the other arguments of `record_band`."""
    front_end = FrontEnd(sample_rate_hz=rate_hz)
    return (batch.samples for batch in record_band(band, sky, reference=START, front_end=front_end, **how))


def recorded(
    sky: tuple[ReceivedSatellite, ...], band: Band, rate_hz: float, n: int, pool: ThreadPoolExecutor | None
) -> int:
    """Make n samples in the stored format and return the number of bytes."""
    batches = made(sky, band, rate_hz, n_samples=n, noise_key=noise_key(1, 0, 61), pool=pool)
    return sum(encode(samples, FORM, scale=20.0).nbytes for samples in batches)


START = load_scenario(NIGHT, ()).start_time


def main() -> None:
    """Measure and print; exit with status 1 if a limit is not met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--satellites", type=int, default=8)
    parser.add_argument("--rate", type=float, default=12.5e6)
    parser.add_argument("--seconds", type=int, default=4)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    every = ["constellation.mask_deg=0.0"] if options.satellites > 8 else []
    scenario = load_scenario(NIGHT, (f"receiver.sample_rate_hz={options.rate}", *every))
    assert isinstance(scenario, CampaignScenario)
    case = AcasTestCase(scenario=scenario, first=0, end=options.seconds + 1)
    skies = {band: case.sky(band) for band in Band}
    while len(skies[Band.E1]) < options.satellites:  # if too few satellites are above the horizon, some are used twice
        skies = {band: sky + sky[: options.satellites - len(sky)] for band, sky in skies.items()}
    skies = {band: sky[: options.satellites] for band, sky in skies.items()}

    n, at = round(_PLAIN_S * options.rate), round(options.rate / 2)
    fast = {  # a first run, which also compiles before any timing
        band: np.concatenate([*made(sky, band, options.rate, first_sample=at, n_samples=n, noise_key=None)])
        for band, sky in skies.items()
    }
    samples = round(options.seconds * options.rate)
    before = time.process_time()
    for band, sky in skies.items():
        recorded(sky, band, options.rate, samples, None)
    work_s = (time.process_time() - before) / options.seconds
    started = time.perf_counter()
    with ThreadPoolExecutor(2) as pool, ThreadPoolExecutor(2) as bands:
        sizes = [bands.submit(recorded, sky, band, options.rate, samples, pool) for band, sky in skies.items()]
        assert sum(one.result() for one in sizes) == 4 * samples
    wall_s = (time.perf_counter() - started) / options.seconds
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # peak before the straightforward version
    straightforward_s = 0.0
    for band, sky in skies.items():
        before = time.process_time()
        slow = plain(sky, band, options.rate, n)
        noise = np.random.default_rng(1).normal(size=(2, n)) * np.sqrt(0.5)
        np.clip(np.rint(20 * (slow + noise[0] + 1j * noise[1]).view(float)), -128, 127).astype(np.int8)
        straightforward_s += (time.process_time() - before) * options.rate / n
        t = (at + np.arange(0, n, n // 100)) / options.rate
        for one in sky:
            np.testing.assert_allclose(interpolated_range_m(one.pseudorange, t), one.pseudorange.range_m(t), 0, 1e-6)
        error = np.abs(fast[band] - slow) / amplitude(sky[0].cn0_dbhz, options.rate)
        assert np.quantile(error, 0.999) < 5e-3, error.max()
    found = {
        "satellites": options.satellites,
        "rate_hz": options.rate,
        "work_s": work_s,
        "wall_s": wall_s,
        "straightforward_s": straightforward_s,
        "ratio": straightforward_s / work_s,
        "memory_mb": memory_mb,
    }
    for name, value in found.items():
        print(f"{name:18} {value:12.4g}")
    if options.json:
        options.json.write_text(json.dumps(found | {"machine": platform.processor()}))
    standard = options.satellites == 8 and options.rate == 12.5e6
    missed = standard and (found["ratio"] < BARS["ratio"] or wall_s > BARS["wall_s"] or memory_mb > BARS["memory_mb"])
    sys.exit(int(missed))


if __name__ == "__main__":
    main()
