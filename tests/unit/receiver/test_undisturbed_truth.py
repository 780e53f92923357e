"""Scenes that differ in their attack alone share the truth that no attack changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vestige.receiver.simulation import Simulation
from vestige.receiver.truth import TruthBlock
from vestige.receiver.undisturbed_truth import KEPT_EPOCHS, UndisturbedProcess, kept_truth
from vestige.spoofer.spoofer import NO_SPOOFER
from vestige.threats.matrix import cases
from vestige.threats.scenes import read_threats

LIFT_OFF = next(one for one in cases(read_threats()) if one.threat == "A2")
SHARED = ("range_m", "clock_m", "iono_diff_m", "bias_m")


def first_satellite(seed: int, *, attacked: bool) -> Simulation:
    return LIFT_OFF.scenario(seed, attacked).simulations[0]


def in_pieces(simulation: Simulation, *counts: int) -> list[TruthBlock]:
    process = simulation.truth()
    first = np.concatenate([[0], np.cumsum(counts)])
    return [process.advance(int(low), count) for low, count in zip(first, counts, strict=False)]


def test_the_run_without_the_attack_has_the_same_arrays_and_another_seed_has_others() -> None:
    (attacked,), (honest,), (other,) = (
        in_pieces(first_satellite(seed, attacked=attacked), 400)
        for seed, attacked in ((0, True), (0, False), (1, False))
    )
    assert all(getattr(attacked, name) is getattr(honest, name) for name in SHARED)
    assert np.any(attacked.e1.error_m != honest.e1.error_m)
    assert not np.array_equal(other.clock_m, honest.clock_m)


def test_what_is_kept_goes_on_as_if_it_had_been_computed_at_once() -> None:
    simulation = first_satellite(0, attacked=True)
    long = KEPT_EPOCHS + 1  # not kept
    (whole,) = in_pieces(simulation, long)
    parts = in_pieces(simulation, 300, 1, long - 301)
    for name in (*SHARED, "e1_noise_m", "e1_phase_noise_m"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)


def test_a_simulation_that_cannot_be_hashed_is_computed_anew() -> None:
    simulation = replace(first_satellite(0, attacked=True), spoofer=NO_SPOOFER)
    unhashable = replace(simulation, osnma=[])  # type: ignore[arg-type]
    expected = UndisturbedProcess(simulation).advance(np.arange(20.0))
    np.testing.assert_array_equal(kept_truth(unhashable, 20).clock_m, expected.clock_m)
