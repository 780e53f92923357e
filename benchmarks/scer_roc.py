"""SCER on E6-C and E1-B: what decisions on chips are worth, and the ROC of the test of replayed E1-B symbols.

python benchmarks/scer_roc.py [--figure docs/scer_roc.png] [--samples 20]

Printed are three tables in Markdown. The first: E6-C at 45 dBHz, per antenna gain of the attacker, the share of the
spoofing signal's power that matches, and its noise, repeated, with hard and with soft decisions. The second: P_d of the
test on E1-B at P_fa 1e-3, by theory, over antenna gain, symbols and delay of the spoofing signal. The third: the
same from samples, tracked, with 95 % intervals. The figure has P_d over P_fa.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from vestige.campaign.statistics import proportion
from vestige.receiver.samples.front_end import FrontEnd
from vestige.receiver.samples.recorder import ReceivedSatellite, record_band, straight
from vestige.records import Band
from vestige.sample_processor.acquisition import acquire
from vestige.sample_processor.e1_snapshot import measure_e1
from vestige.sample_processor.tracking.channel import Channel
from vestige.sample_processor.tracking.partial_correlation import (
    FIRST_CHIPS,
    PartialPrompts,
    partial_prompts,
    replay_detection_probability,
    symbol_replay_test,
)
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.waveform import open_component
from vestige.signals.definitions import E1B, E1C
from vestige.spoofer.scer import Scer
from vestige.theory.scer.code_estimation import (
    chip_energy_over_n0,
    estimation_noise,
    matching_share,
    sign_error_probability,
)
from vestige.time import GalileoTime

CN0_DBHZ = 42.0  # of E1-B
GAINS_DB = (0.0, 5.0, 10.0, 15.0, 20.0)
SYMBOLS = (48, 480, 3840)  # a tenth of a subframe, a subframe, a subframe of eight satellites
DELAYS_US = (0.0, 1.0, 3.0)
SAMPLED = ((None, 0.0), (0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (10.0, 3.0))  # gain, delay in µs
RATE_HZ, SVID, START = 4.1e6, 11, GalileoTime(1400, 0)


def chips_table() -> None:
    names = "repeated, hard, soft, in dB"
    print(f"| gain in dB | Ec/N0 in dB | wrong chips | matching power: {names} | N/N0: {names} |")
    print("|---|---|---|---|---|")
    for gain_db in (0.0, 10.0, 15.0, 20.0, 21.2, 25.0, 30.0):
        gamma = float(chip_energy_over_n0(45.0 + gain_db))
        share = [10 * np.log10(float(matching_share(gamma, one))) for one in ("repeated", "hard", "soft")]
        noise = [10 * np.log10(estimation_noise(45.0, gain_db, one)) for one in ("repeated", "hard", "soft")]
        print(
            f"| {gain_db:g} | {10 * np.log10(gamma):.1f} | {float(sign_error_probability(gamma)):.2g} | "
            f"{', '.join(f'{one:.2f}' for one in share)} | {', '.join(f'{one:.1f}' for one in noise)} |"
        )


def theory_table() -> None:
    heads = [f"{n} symbols, {delay:g} µs late" for delay in DELAYS_US for n in SYMBOLS]
    print(f"\n| gain in dB | {' | '.join(heads)} |\n|{'---|' * (len(heads) + 1)}")
    for gain_db in GAINS_DB:
        found = [
            replay_detection_probability(CN0_DBHZ, gain_db, n, 1e-3, head_start_s=delay * 1e-6)
            for delay in DELAYS_US
            for n in SYMBOLS
        ]
        print(f"| {gain_db:g} | {' | '.join(f'{one:.3f}' for one in found)} |")


def sampled_prompts(gain_db: float | None, delay_us: float, seed: int) -> PartialPrompts:
    """Return two seconds of a channel that follows the spoofing signal; without a gain the authentic signal."""
    components = (open_component(E1B, SVID, seed=seed), open_component(E1C, SVID))
    if gain_db is not None:
        # the delay is the attacker's head start; where the spoofing signal stands in the samples does not matter
        attack = Scer(
            delay_m=delay_us * 299.792458,
            power_db=0.0,
            symbols="hard",
            reception_gain_db=gain_db,
            victim_cn0_dbhz=CN0_DBHZ,
        )
        components = tuple(attack.replayed(one, SVID, seed) for one in components)  # type: ignore[assignment]
    satellite = ReceivedSatellite(
        svid=SVID,
        components=components,
        cn0_dbhz=CN0_DBHZ,
        pseudorange=RangeModel(s0_m=2.41e7, v_mps=-350.0),
        propagation=lambda _: straight(),
    )
    (*batches,) = record_band(
        Band.E1,
        (satellite,),
        reference=START,
        front_end=FrontEnd(sample_rate_hz=RATE_HZ),
        n_samples=int(2.5 * RATE_HZ),
        noise_key=noise_key(seed, 0, 1),
    )
    batch = replace(batches[0], samples=np.concatenate([one.samples for one in batches]))
    window = replace(batch, samples=batch.samples[: int(0.1 * RATE_HZ)])
    (found,) = acquire(window, (SVID,))
    measured = measure_e1(window, found)
    assert measured is not None
    return partial_prompts(batch, Channel(measured, window).run(batch.samples, 0), SVID)


def sampled_table(runs: int) -> None:
    print("\n| gain in dB | late by µs | symbols | P_fa | theory | from samples |\n|---|---|---|---|---|---|")
    for gain_db, delay_us in SAMPLED:
        prompts = [sampled_prompts(gain_db, delay_us, seed) for seed in range(runs)]
        n = 48  # consecutive symbols of a test
        for p_fa in (0.1, 0.01):
            tests = [
                symbol_replay_test(one.first[a : a + n], one.later[a : a + n], p_fa=p_fa).failed
                for one in prompts
                for a in range(0, one.first.size - n + 1, n)
            ]
            theory = (
                p_fa
                if gain_db is None
                else replay_detection_probability(CN0_DBHZ, gain_db, n, p_fa, head_start_s=delay_us * 1e-6)
            )
            share = proportion(sum(tests), len(tests))
            gain = "authentic" if gain_db is None else f"{gain_db:g}"
            counted = f"{share.value:.3f} ({share.low:.3f}–{share.high:.3f})"
            print(f"| {gain} | {delay_us:g} | {n} | {p_fa:g} | {theory:.3f} | {counted} |")


def draw(path: Path) -> None:
    p_fa = np.logspace(-8, 0, 60)[:-1]
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), sharey=True, layout="constrained")
    for gain_db in GAINS_DB:
        found = [replay_detection_probability(CN0_DBHZ, gain_db, 480, one) for one in p_fa]
        axes[0].semilogx(p_fa, found, label=f"{gain_db:g} dB")
    for delay_us in (0.0, 0.5, 1.0, 3.0, 10.0):
        found = [replay_detection_probability(CN0_DBHZ, 10.0, 480, one, head_start_s=delay_us * 1e-6) for one in p_fa]
        axes[1].semilogx(p_fa, found, label=f"{delay_us:g} µs")
    axes[0].set(title="on time, over the attacker's antenna gain", ylabel="probability of detection")
    axes[1].set(title="10 dB, over the delay of the spoofing signal")
    for ax in axes:
        ax.semilogx(p_fa, p_fa, color="0.6", linestyle=":")
        ax.set(xlabel="probability of a false alarm", ylim=(0, 1.02))
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8)
    figure.suptitle(
        f"Replayed E1-B symbols: 480 symbols, {CN0_DBHZ:g} dBHz, first part of {FIRST_CHIPS} chips", fontsize=10
    )
    figure.savefig(path, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--samples", type=int, default=20, help="runs of two seconds of samples in each case")
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    chips_table()
    theory_table()
    if options.samples:
        sampled_table(options.samples)
    if options.figure:
        draw(options.figure)


if __name__ == "__main__":
    main()
