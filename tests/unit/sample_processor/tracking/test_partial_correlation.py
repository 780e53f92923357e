"""Partial correlations of tracked E1-B, from samples; the distributions are those of tests/statistical."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from builders import received_batch, satellite
from code_blocks import blocks_of
from vestige.navigation.inav.coding.channel_coding import page_symbols
from vestige.navigation.inav.page import encode_page
from vestige.records import Band, SampleBatch
from vestige.sample_processor.acquisition import acquire
from vestige.sample_processor.e1_snapshot import measure_e1
from vestige.sample_processor.tracking.channel import Channel, TrackedPeriods
from vestige.sample_processor.tracking.partial_correlation import (
    partial_prompts,
    predictable_reference_test,
    replay_threshold,
    symbol_replay_test,
    unpredictable_symbols,
)
from vestige.signals.definitions import E1B
from vestige.spoofer.scer import Scer
from vestige.theory.scer.code_estimation import replayed_covariance, replayed_mean
from vestige.theory.scer.partial_correlations import FIRST_CHIPS, ReferenceMetric, replay_detection_probability

SVID, CN0_DBHZ, RATE_HZ = 11, 45.0, 4.1e6


def tracking(
    attack: Scer | None = None, cn0_dbhz: float = CN0_DBHZ, bandwidth_hz: float | None = None
) -> tuple[SampleBatch, Channel]:
    """Return E1 samples of a satellite, or of the spoofing signal that has captured the channel, and the channel."""
    one = satellite(SVID, 2.41e7, -350.0, cn0_dbhz, 45.0, seed=2)[Band.E1]
    if attack is not None:
        one = replace(one, components=tuple(attack.replayed(true, SVID, 5) for true in one.components))
    batch = received_batch(
        Band.E1, [{Band.E1: one}], duration_s=1.2, rate_hz=RATE_HZ, seed=4, bandwidth_hz=bandwidth_hz
    )
    window = replace(batch, samples=batch.samples[: int(0.1 * RATE_HZ)])
    (found,) = acquire(window, (SVID,))
    measured = measure_e1(window, found)
    assert measured is not None
    return batch, Channel(measured, window)


def tracked(attack: Scer | None, cn0_dbhz: float = CN0_DBHZ) -> tuple[SampleBatch, TrackedPeriods]:
    """Return samples as `tracking` does, and the periods that the channel has tracked."""
    batch, channel = tracking(attack, cn0_dbhz)
    return batch, channel.run(batch.samples, batch.first_sample)


@pytest.fixture(scope="module")
def honest() -> tuple[SampleBatch, TrackedPeriods]:
    return tracked(None)


def test_the_two_parts_make_the_whole_prompt(honest: tuple[SampleBatch, TrackedPeriods]) -> None:
    batch, periods = honest
    locked = periods.periods[periods.periods["locked"]]
    for first_chips in (1, FIRST_CHIPS, 2000):
        parts = partial_prompts(batch, periods, SVID, first_chips=first_chips)
        assert parts.numbers.tolist() == locked["number"].tolist()
        n_all = np.ceil((E1B.code_length - locked["code_phase"]) / locked["code_rate"])
        n_first = np.ceil((first_chips - locked["code_phase"]) / locked["code_rate"])
        whole = n_first * parts.first + (n_all - n_first) * parts.later
        assert np.abs(whole - locked["data"]).max() < 1e-3 * np.abs(locked["data"]).max()


def test_an_authentic_signal_passes_and_a_replayed_one_fails(honest: tuple[SampleBatch, TrackedPeriods]) -> None:
    """The antenna of the victim, on time; statistics within four standard deviations of the theory."""
    parts = partial_prompts(*honest, SVID)
    authentic = symbol_replay_test(parts.first, parts.later, p_fa=1e-3)
    assert abs(authentic.statistic) < 3.5
    assert not authentic.failed

    attack = Scer(delay_m=0.0, power_db=0.0, symbols="hard", reception_gain_db=0.0)
    parts = partial_prompts(*tracked(attack), SVID)
    replayed = symbol_replay_test(parts.first, parts.later, p_fa=1e-3)
    assert replayed.n_symbols > 200
    assert replayed.failed
    n = replayed.n_symbols
    assert replay_detection_probability(CN0_DBHZ, 0.0, n, 1e-3) > 0.98
    # the P_fa at which half of the attacks are seen gives the mean of the statistic
    p_fa = next(p for p in np.logspace(-12, -1, 200) if replay_detection_probability(CN0_DBHZ, 0.0, n, p) > 0.5)
    assert replayed.statistic == pytest.approx(replay_threshold(n, float(p_fa)), abs=4.0)


def test_a_narrow_filter_misleads_only_the_test_without_predictable_symbols() -> None:
    """2.2 MHz of E1, an authentic signal of 65 dBHz: the filter makes the first four chips of SVID 11 stronger.

    They are stronger by 12 % than the later ones: a replay that loses as much at the beginning would not be seen. The
    beginnings of two halves of the symbols differ by chance.
    """
    batch, channel = tracking(None, 65.0, bandwidth_hz=2.2e6)
    parts = partial_prompts(batch, channel.run(batch.samples, batch.first_sample), SVID)
    paired = symbol_replay_test(parts.first, parts.later)
    assert paired.statistic < -4.5
    assert not paired.failed
    half = parts.numbers % 2 == 0
    for metric in get_args(ReferenceMetric):
        assert not predictable_reference_test(parts.first, parts.later, half, metric=metric, p_fa=1e-3).failed
    assert abs(predictable_reference_test(parts.first, parts.later, half).statistic) < 3.5


def test_beginnings_that_are_known_show_those_that_are_estimated(honest: tuple[SampleBatch, TrackedPeriods]) -> None:
    """Predictable symbols from an authentic signal, unpredictable ones from a replay, both from samples."""
    known = partial_prompts(*honest, SVID)
    estimated = partial_prompts(*tracked(Scer(delay_m=0.0, power_db=0.0, symbols="soft", reception_gain_db=0.0)), SVID)
    first, later = (np.concatenate([getattr(one, part) for one in (known, estimated)]) for part in ("first", "later"))
    unpredictable = np.arange(first.size) >= known.first.size
    for metric in get_args(ReferenceMetric):
        assert predictable_reference_test(first, later, unpredictable, metric=metric, p_fa=1e-3).failed
        assert not predictable_reference_test(first, later, ~unpredictable, metric=metric, p_fa=1e-12).failed or (
            metric == "distance"  # it does not know which of the two is weaker
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("attack", "cn0_dbhz", "head_s"),
    [
        (Scer(delay_m=0.0, power_db=0.0, symbols="hard", reception_gain_db=0.0), 45.0, 0.0),
        (Scer(delay_m=0.0, power_db=0.0, symbols="hard", reception_gain_db=10.0, latency_s=4e-6), 55.0, -4e-6),
        (Scer(delay_m=0.0, power_db=0.0, symbols="soft", reception_gain_db=0.0), 45.0, 0.0),
        (Scer(delay_m=0.0, power_db=0.0, symbols="soft", reception_gain_db=10.0, latency_s=4e-6), 55.0, -4e-6),
    ],
    ids=["hard, on time", "hard, with a latency", "soft, on time", "soft, with a latency"],
)
def test_estimated_symbols_in_samples_grow_as_the_theory_says(attack: Scer, cn0_dbhz: float, head_s: float) -> None:
    """The beginning of a symbol against its later part, behind acquisition and tracking.

    The victim has 65 dBHz, so that its own noise is a small part of the scatter. The mean over the symbols is that of
    the theory to within 3.5 standard deviations, which follow from the theory, too; an authentic signal has 1.
    """
    samples, decision = tracked(attack, 65.0), "soft" if attack.symbols == "soft" else "hard"
    for first_chips in (4, 16, 64):
        parts = partial_prompts(*samples, SVID, first_chips=first_chips)
        symbols = np.sign(parts.later.real)
        found = np.mean(parts.first.real * symbols) / np.mean(parts.later.real * symbols)
        expected = replayed_mean(cn0_dbhz, head_s, first_chips, decision).mean()
        variance = replayed_covariance(cn0_dbhz, head_s, first_chips, decision).sum() / first_chips**2
        variance += E1B.chip_rate_hz / (2 * 10**6.5 * first_chips)
        assert abs(found - expected) < 3.5 * np.sqrt(variance / symbols.size)
        assert found < 1 - 3.5 * np.sqrt(variance / symbols.size)


def test_the_code_of_the_page_runs(honest: tuple[SampleBatch, TrackedPeriods]) -> None:
    """An authentic signal passes both tests as docs/scer.md writes them, each second symbol taken as unpredictable."""
    (block,) = [block for block in blocks_of("python") if block.page == "docs/scer.md"]
    batch, channel = tracking()
    unpredictable = partial_prompts(*honest, SVID).numbers % 2 == 0
    names: dict[str, Any] = {"batch": batch, "channel": channel, "svid": SVID, "unpredictable": unpredictable}
    exec(compile(block.text, block.place, "exec"), names)  # noqa: S102
    for name in ("paired", "test"):
        assert not names[name].failed
        assert names[name].n_symbols > 100


def test_the_sign_of_all_symbols_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    symbols = rng.choice([-1.0, 1.0], 100)
    later = symbols + 0.05 * rng.standard_normal(100) + 0j
    first = 0.8 * symbols + 0.5 * rng.standard_normal(100) + 0j
    found = [symbol_replay_test(first, later, known).statistic for known in (symbols, -symbols, None)]
    assert found == pytest.approx([found[0]] * 3)


def test_unpredictable_symbols_tell_the_mack_bits() -> None:
    """Two pages that differ in MACK differ first in one of them; 32 of them make 2³² pages, so no fewer will do."""
    places = np.flatnonzero(unpredictable_symbols())
    assert places.size == 32
    rng = np.random.default_rng(2)
    plain = page_symbols(encode_page(5, osnma=b"\x01\0\0\0\0"))
    for _ in range(200):
        other = page_symbols(encode_page(5, osnma=b"\x01" + (1 << int(rng.integers(32))).to_bytes(4, "big")))
        assert np.flatnonzero(plain != other)[0] in places
        other = page_symbols(encode_page(5, osnma=b"\x01" + rng.bytes(4)))
        assert np.flatnonzero(plain != other)[0] in places


def test_too_little_is_refused(honest: tuple[SampleBatch, TrackedPeriods]) -> None:
    for first_chips in (0, 4092):
        with pytest.raises(ValueError, match=f"has 1 to 4091 chips, found {first_chips}"):
            partial_prompts(*honest, SVID, first_chips=first_chips)
    with pytest.raises(ValueError, match="of each kind, found 3 unpredictable and 17 predictable symbols"):
        predictable_reference_test(np.ones(20) + 0j, np.ones(20) + 0j, np.arange(20) < 3)
    with pytest.raises(ValueError, match="needs 10 symbols or more, found 9"):
        symbol_replay_test(np.ones(9) + 0j, np.ones(9) + 0j)
