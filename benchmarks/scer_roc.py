"""Measure SCER on E6-C and E1-B: the gain from decisions on chips, and the ROC of the tests of replayed E1-B symbols.

python benchmarks/scer_roc.py [--figure docs/scer_roc.png] [--samples 20]

The script prints five tables in Markdown:

1. E6-C at 45 dBHz, by antenna gain of the attacker: the share of the spoofing signal's power that matches, and its
   noise, for repeated samples, hard decisions and soft decisions.
2. P_d of the paired test on E1-B at P_fa 1e-3, from theory, over antenna gain, number of symbols, and delay of the
   spoofing signal.
3. P_d of all metrics for hard and soft decisions.
4. P_d of all metrics from tracked samples, with 95 % intervals.
5. The effect of a narrow filter of the front end on an authentic signal.

The figure shows P_d over P_fa.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Bool, Float32, Int64
from scipy.optimize import brentq
from scipy.special import nctdtr, stdtrit

from vestige.campaign.statistics import proportion
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.recorder import ReceivedSatellite, record_band, straight
from vestige.records import Band
from vestige.sample_processor.acquisition import acquire
from vestige.sample_processor.e1_snapshot import measure_e1
from vestige.sample_processor.tracking.channel import Channel
from vestige.sample_processor.tracking.partial_correlation import (
    PartialPrompts,
    SymbolReplayTest,
    partial_prompts,
    predictable_reference_test,
    symbol_replay_test,
)
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.waveform import Component, open_component
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C
from vestige.spoofer.scer import Scer
from vestige.theory.scer.code_estimation import (
    Decision,
    chip_energy_over_n0,
    estimation_noise,
    matching_share,
    sign_error_probability,
)
from vestige.theory.scer.partial_correlations import (
    FIRST_CHIPS,
    Metric,
    ReferenceMetric,
    replay_detection_probability,
)
from vestige.time import GalileoTime

CN0_DBHZ = 42.0  # C/N0 of E1-B
GAINS_DB = (0.0, 5.0, 10.0, 15.0, 20.0)
SYMBOLS = (48, 480, 3840)  # a tenth of a subframe, a subframe, a subframe of eight satellites
DELAYS_US = (0.0, 1.0, 3.0)
METRICS: tuple[Metric, ...] = ("paired", *get_args(ReferenceMetric))
NAMES = {
    "paired": "paired: first against later part",
    "real": "real: Re($B_p − B_u$)",
    "distance": "distance: |$B_p − B_u$|²",
    "magnitudes": "magnitudes: |$B_p$| − |$B_u$|",
    "ratio": "ratio: |$B_p$| / |$B_u$|",
}
# gain, delay in µs, decision
SAMPLED: tuple[tuple[float | None, float, Decision], ...] = (
    (None, 0.0, "hard"),
    (0.0, 0.0, "hard"),
    (0.0, 0.0, "soft"),
    (10.0, 0.0, "hard"),
    (10.0, 0.0, "soft"),
    (20.0, 0.0, "hard"),
    (20.0, 0.0, "soft"),
    (10.0, 3.0, "hard"),
)
SAMPLED_SYMBOLS, SAMPLED_P_FA = 48, 0.05  # unpredictable symbols, and as many predictable symbols
BANDWIDTHS_HZ = (4.0e6, 3.0e6, 2.2e6)
SVIDS = range(1, 37)
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


def metrics_table() -> None:
    print(f"\n| gain in dB | decisions | {' | '.join(METRICS)} |\n|{'---|' * (len(METRICS) + 2)}")
    for gain_db in GAINS_DB:
        for decision in get_args(Decision):
            found = [
                replay_detection_probability(CN0_DBHZ, gain_db, 480, 1e-3, metric=one, decision=decision)
                for one in METRICS
            ]
            print(f"| {gain_db:g} | {decision} | {' | '.join(f'{one:.3f}' for one in found)} |")


def half_predictable(true: Component, replayed: Component) -> Component:
    """Return a spoofing signal on E1-B whose every second symbol is known to the attacker from its beginning on."""

    def chip(index: Int64[np.ndarray, " n"]) -> Float32[np.ndarray, " n"]:
        period = index // E1B.code_length
        known = true.chip(index) * true.symbol(period)  # type: ignore[misc]
        return np.where(period % 2 == 0, known, replayed.chip(index)).astype(np.float32)

    return Component(signal=E1B, chip=chip)


def sampled_prompts(
    attack: Scer | None, seed: int, *, svid: int = SVID, cn0_dbhz: float = CN0_DBHZ, bandwidth_hz: float | None = None
) -> tuple[PartialPrompts, Bool[np.ndarray, " n"]]:
    """Return 2.5 s of a channel that follows the spoofing signal, and a mask of the unpredictable symbols.

    Without an attack the channel follows the authentic signal.
    """
    travel = RangeModel(s0_m=2.41e7, v_mps=-350.0)
    data, pilot = open_component(E1B, svid, seed=seed), open_component(E1C, svid)
    if attack is not None:
        data = half_predictable(data, attack.replayed(data, svid, seed))
    satellite = ReceivedSatellite(
        svid=svid,
        components=(data, pilot),
        cn0_dbhz=cn0_dbhz,
        pseudorange=travel,
        propagation=lambda _: straight(),
    )
    (*batches,) = record_band(
        Band.E1,
        (satellite,),
        reference=START,
        front_end=front_end(bandwidth_hz),
        n_samples=int(2.5 * RATE_HZ),
        noise_key=noise_key(seed, 0, 1),
    )
    batch = replace(batches[0], samples=np.concatenate([one.samples for one in batches]))
    window = replace(batch, samples=batch.samples[: int(0.1 * RATE_HZ)])
    (found,) = acquire(window, (svid,))
    measured = measure_e1(window, found)
    assert measured is not None
    tracked = Channel(measured, window).run(batch.samples, 0)
    prompts = partial_prompts(batch, tracked, svid)
    start_s = tracked.periods["first_sample"][np.isin(tracked.periods["number"], prompts.numbers)] / RATE_HZ
    sent_s = start_s - travel.range_m(start_s) / SPEED_OF_LIGHT_MPS
    return prompts, np.round(sent_s / E1B.period_s) % 2 == 1


def front_end(bandwidth_hz: float | None) -> FrontEnd:
    return FrontEnd(sample_rate_hz=RATE_HZ, bandwidth_hz=bandwidth_hz, oversampling=1 if bandwidth_hz is None else 3)


def tests_of(prompts: PartialPrompts, unpredictable: Bool[np.ndarray, " n"], metric: Metric) -> list[SymbolReplayTest]:
    """Return the tests of 48 successive unpredictable symbols; all but the paired test also use 48 predictable ones."""
    found, n = [], 2 * SAMPLED_SYMBOLS
    for a in range(0, prompts.first.size - n + 1, n):
        first, later, chosen = (part[a : a + n] for part in (prompts.first, prompts.later, unpredictable))
        if metric == "paired":
            found.append(symbol_replay_test(first[chosen], later[chosen], p_fa=SAMPLED_P_FA))
        else:
            found.append(predictable_reference_test(first, later, chosen, metric=metric, p_fa=SAMPLED_P_FA))
    return found


def sampled_table(runs: int) -> None:
    print(f"\n| gain in dB | late by µs | decisions | {' | '.join(METRICS)} |\n|{'---|' * (len(METRICS) + 3)}")
    for gain_db, delay_us, decision in SAMPLED:
        attack = None
        if gain_db is not None:
            # the delay is the attacker's head start; the delay of the spoofing signal in the samples does not matter
            attack = Scer(
                delay_m=delay_us * 299.792458,
                power_db=0.0,
                symbols=decision,
                reception_gain_db=gain_db,
                victim_cn0_dbhz=CN0_DBHZ,
            )
        prompts = [sampled_prompts(attack, seed) for seed in range(runs)]
        cells = []
        for metric in METRICS:
            tests = [test.failed for one in prompts for test in tests_of(*one, metric)]
            theory = SAMPLED_P_FA
            if gain_db is not None:
                theory = replay_detection_probability(
                    CN0_DBHZ,
                    gain_db,
                    SAMPLED_SYMBOLS,
                    SAMPLED_P_FA,
                    metric=metric,
                    n_predictable=SAMPLED_SYMBOLS,
                    head_start_s=delay_us * 1e-6,
                    decision=decision,
                )
            share = proportion(sum(tests), len(tests))
            cells.append(f"{theory:.2f}, {share.value:.2f} ({share.low:.2f}–{share.high:.2f})")
        gain = "authentic" if gain_db is None else f"{gain_db:g}"
        print(
            f"| {gain} | {delay_us:g} | {decision if gain_db is not None else ''} | {' | '.join(cells)} |", flush=True
        )


def smear(svid: int, bandwidth_hz: float) -> float:
    """Return the relative loss of the first part of an authentic symbol against its later part.

    The symbols before and after have random signs, so they change the scatter and not the mean.
    """
    code, pulse = primary_code(E1B, svid), np.asarray(E1B.pulse.levels)
    sent = np.multiply.outer(code.astype(np.float64), pulse).reshape(-1)
    replica = np.multiply.outer(code.astype(np.float64), np.sign(np.add.reduceat(pulse, [0, 6]))).repeat(6)
    taps = FrontEnd(sample_rate_hz=E1B.chip_rate_hz * pulse.size, bandwidth_hz=bandwidth_hz).filter_taps()
    sent = np.convolve(sent, taps, "same")
    both, cut = sent * replica, FIRST_CHIPS * pulse.size
    return float(1 - np.mean(both[:cut]) / np.mean(both[cut:]))


def filter_table(runs: int) -> None:
    columns = (
        "bandwidth in MHz",
        "bias of 36 satellites: lowest, median, highest",
        "P_fa of `paired`, highest bias",
        "P_d of `paired` at 10 dB, lowest bias",
        "measured, highest: `paired`, `real`",
        "measured, lowest: `paired`, `real`",
    )
    print(f"\n| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    noise = E1B.chip_rate_hz / (2 * 10 ** (CN0_DBHZ / 10)) / FIRST_CHIPS
    student = -stdtrit(479, 1e-3)
    lost = brentq(lambda x: nctdtr(479, x, student) - 1 + replay_detection_probability(CN0_DBHZ, 10.0, 480, 1e-3), 0, 9)
    for bandwidth_hz in BANDWIDTHS_HZ:
        bias = np.array([smear(svid, bandwidth_hz) for svid in SVIDS])
        shift = np.sqrt(480 / noise) * bias
        cells = [
            f"{bandwidth_hz / 1e6:g}",
            f"{bias.min():.3f}, {np.median(bias):.3f}, {bias.max():.3f}",
            f"{1 - nctdtr(479, shift.max(), student):.1g}",
            f"{1 - nctdtr(479, lost + shift.min(), student):.2f}",
        ]
        for place in (np.argmax(bias), np.argmin(bias)) if runs else ():
            one = [
                sampled_prompts(None, seed, svid=SVIDS[int(place)], cn0_dbhz=65.0, bandwidth_hz=bandwidth_hz)
                for seed in range(min(runs, 4))
            ]
            cells.append(measured_bias(one))
        print(f"| {' | '.join(cells)} |", flush=True)


def measured_bias(runs: list[tuple[PartialPrompts, Bool[np.ndarray, " n"]]]) -> str:
    """Return the mean of the statistic of both tests, relative to the later part, with its standard error."""
    first, later = (np.concatenate([getattr(one, part) for one, _ in runs]).real for part in ("first", "later"))
    chosen = np.concatenate([one for _, one in runs])
    later, first = np.abs(later) / np.mean(np.abs(later)), np.sign(later) * first / np.mean(np.abs(later))
    u, p, d = first[chosen], first[~chosen], (later - first)[chosen]
    error = np.hypot(np.std(u) / np.sqrt(u.size), np.std(p) / np.sqrt(p.size))
    return f"{np.mean(d):.3f} ± {np.std(d) / np.sqrt(d.size):.3f}, {np.mean(p) - np.mean(u):.3f} ± {error:.3f}"


def draw(path: Path) -> None:
    p_fa = np.logspace(-8, np.log10(0.49), 50)
    figure, axes = plt.subplots(2, 3, figsize=(9, 5.8), sharex=True, sharey=True, layout="constrained")
    styles = {"paired": "-", "real": "--", "distance": "-", "magnitudes": "-.", "ratio": ":"}
    for row, decision in zip(axes, get_args(Decision), strict=True):
        for ax, gain_db in zip(row, (0.0, 10.0, 20.0), strict=True):
            for one in METRICS:
                found = [
                    replay_detection_probability(CN0_DBHZ, gain_db, 480, p, metric=one, decision=decision) for p in p_fa
                ]
                ax.semilogx(p_fa, found, styles[one], label=NAMES[one])
            ax.semilogx(p_fa, p_fa, color="0.6", linewidth=0.8, label="chance")
            ax.set(title=f"{decision} decisions, gain {gain_db:g} dB", ylim=(0, 1.02))
            ax.title.set_fontsize(10)
            ax.grid(alpha=0.3)
        row[0].set_ylabel("probability of detection")
    for ax in axes[1]:
        ax.set_xlabel("probability of a false alarm")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
    figure.suptitle(
        f"Replayed E1-B symbols: 480 unpredictable and 7020 predictable ones, {CN0_DBHZ:g} dBHz, "
        f"first part of {FIRST_CHIPS} chips",
        fontsize=10,
    )
    figure.savefig(path, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--samples", type=int, default=20, help="runs of 2.5 s of samples in each case")
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    chips_table()
    theory_table()
    metrics_table()
    if options.samples:
        sampled_table(options.samples)
    filter_table(options.samples)
    if options.figure:
        draw(options.figure)


if __name__ == "__main__":
    main()
