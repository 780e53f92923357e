"""scenarios/vestigial.toml over seeds: the short version of `benchmarks/vestigial.py`, which has 100 and 1000."""

from __future__ import annotations

from types import ModuleType

import pytest

from script_loader import benchmark


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return benchmark("vestigial")


@pytest.mark.judged(
    by="truth of the simulation",
    what="vestigial searches under a meaconer",
    figure="both signals found, the earlier signal taken as the true one",
)
def test_both_searches_find_both_signals_and_take_the_earlier(script: ModuleType) -> None:
    for seed in (1001, 1002):
        assert script.spoofed(seed) == {"handover": True, "exhaustive": True}


def test_without_a_spoofer_there_is_no_alarm(script: ModuleType) -> None:
    """10 seeds at P_FA 1e-3 each: an alarm in 100 runs of this test, were the seeds not fixed."""
    for seed in range(1001, 1011):
        assert not any(script.clear(seed).values())


def test_the_interval_is_two_sided(script: ModuleType) -> None:
    """At 1000 trials and 1e-3: P(X ≥ 6) = 5.9e-4 is outside, P(X ≥ 5) = 3.7e-3 inside; 0 of 10,000 has 4.5e-5."""
    assert script.within(0, 1000, 1e-3)
    assert script.within(5, 1000, 1e-3)
    assert not script.within(7, 1000, 1e-3)
    assert not script.within(0, 10_000, 1e-3)
