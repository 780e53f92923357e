"""E1 correlators and received power: what comes out of the samples of a sky is what its signals make of it.

The signals are known, so they are taken off; what is left is the noise of the receiver and of the other codes.

Error budget: 140 comparisons at 5.5σ, 4e-8 each.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from jaxtyping import Complex128, Float

from sky_builder import CLEAN, sky_scenario, whole_block
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_taps import INTEGRATION_S, TAP_CHIPS, arriving, band_power_rise_db
from vestige.records import Band
from vestige.signals.definitions import E1B, E1C
from vestige.signals.pulse import BOC11, autocorrelation, band_limited_correlation, spectrum

EPOCHS = 24
RATE_HZ = 6.2e6
LIFT_OFF = (
    'attack=[{kind="lift-off", start_s=0, power_db=3, delay_m={kind="ramp", first=0, last=110, start_s=5, stop_s=23}}]'
)
FAR_AND_JAMMED = (
    'attack=[{kind="meaconing", delay_s=0.013, power_db=3}, '
    '{kind="jamming", bands=["E1"], j_over_n_db=3, waveform={kind="cw"}}]'
)
WIDEBAND = 'attack=[{kind="jamming", bands=["E1"], j_over_n_db=10, waveform={kind="wideband"}}]'


class Taken(NamedTuple):
    """What the samples gave, without gain control, and what the signals alone would have given."""

    taps: Complex128[np.ndarray, "n m k"]
    signals: Complex128[np.ndarray, "n m k"]
    power_db: Float[np.ndarray, " n"]
    model_power_db: Float[np.ndarray, " n"]
    strength: Float[np.ndarray, "n m"]  # C/N0 of each component, in Hz

    @property
    def noise(self) -> Complex128[np.ndarray, "n k"]:
        """What is left without the signals."""
        return (self.taps - self.signals).reshape(-1, len(TAP_CHIPS))


def on_air(chips: Float[np.ndarray, "*n"], bandwidth_hz: float | None) -> Float[np.ndarray, "*n"]:
    """Return the correlation of E1-C on air with BOC(1,1) behind a filter, or without one."""
    grid = np.linspace(-1.5, 1.5, 3001)
    passed = band_limited_correlation(
        E1C.pulse, BOC11, grid, chip_rate_hz=E1C.chip_rate_hz, bandwidth_hz=bandwidth_hz or 200 * E1C.chip_rate_hz
    )
    return np.interp(chips, grid, passed)


@cache
def taken(*settings: str) -> Taken:
    scenario = sky_scenario(
        'fidelity="samples"', f"epochs={EPOCHS}", f"recs.every={EPOCHS}", f"receiver.sample_rate_hz={RATE_HZ}",
        "constellation.svids=[6, 7, 12, 13]", *settings,
    )  # fmt: skip
    block, truth = whole_block(scenario)
    assert block.e1.taps is not None
    cn0_dbhz = np.stack(
        [
            one.cn0_e1_dbhz + 20 * np.log10(own.geometry.amplitude)
            for one, own in zip(scenario.simulations, truth, strict=True)
        ],
        axis=1,
    )
    signals = []
    for one, own in zip(scenario.simulations, truth, strict=True):
        arrived = arriving(own, one.e1_multipath_m(own), with_rays=one.models.e1_multipath)
        turns = (arrived.doppler_hz - arrived.followed_hz[:, None]) * INTEGRATION_S
        strength = arrived.amplitude * np.exp(1j * np.pi * turns) * np.sinc(turns)
        apart_m = arrived.settled_m[:, None, None] - arrived.delay_m[..., None]
        chips = apart_m / SPEED_OF_LIGHT_MPS * E1C.chip_rate_hz + np.array(TAP_CHIPS)
        signals.append(np.einsum("nr,nrt->nt", strength, on_air(chips, scenario.receiver.front_end.bandwidth_hz)))
    power_db = block.front_end[Band.E1].total_power_db
    return Taken(
        taps=block.e1.taps * 10 ** (power_db / 20)[:, None, None],
        signals=np.stack(signals, axis=1) * np.sqrt(2 * 10 ** (cn0_dbhz / 10) * INTEGRATION_S)[..., None],
        power_db=power_db,
        model_power_db=band_power_rise_db(truth, cn0_dbhz),
        strength=10 ** (cn0_dbhz / 10),
    )


def code_noise(found: Taken) -> float:
    """Return the mean density over N0 of all other components behind the correlator."""
    f, step_hz = np.linspace(-50e6, 50e6, 200_001, retstep=True)
    density = [spectrum(one.pulse, f, one.chip_rate_hz) for one in (E1B, E1C)]
    kappa_s = np.array([np.sum(one * spectrum(BOC11, f, E1C.chip_rate_hz)) * step_hz for one in density])
    total = found.strength.sum(axis=1, keepdims=True)
    return float(np.mean(total * kappa_s.sum() - found.strength * kappa_s[1]))


@pytest.mark.parametrize("attack", ["attack=[]", LIFT_OFF, FAR_AND_JAMMED])
def test_the_signals_are_where_and_as_strong_as_the_truth_says(attack: str) -> None:
    """Multipath, a signal that pulls the loop away, one that is 13 ms late beside a wave that jams."""
    found = taken(attack)
    jammed = attack == FAR_AND_JAMMED  # the wave is the same in the correlators of all satellites
    n = EPOCHS if jammed else found.noise.shape[0]
    assert np.abs(found.signals).mean() > 25
    assert found.power_db == pytest.approx(found.model_power_db, abs=0.5)  # which knows one of two components
    for part in (found.noise.real, found.noise.imag):
        spread = part.std(axis=0)
        assert np.all(np.abs(part.mean(axis=0)) < 5.5 * spread / np.sqrt(n)), part.mean(axis=0)
        assert np.all(spread < (6 if jammed else 1.35)), spread


def test_a_signal_of_another_strength_would_be_seen() -> None:
    found = taken("attack=[]")
    weaker = found.taps.reshape(-1, len(TAP_CHIPS)).real.mean(axis=0) * 0.98  # 0.18 dB
    expected = found.signals.reshape(-1, len(TAP_CHIPS)).real.mean(axis=0)
    assert np.all(np.abs(weaker - expected) > 5.5 / np.sqrt(found.noise.shape[0]))


@pytest.mark.parametrize("front_end", ["{}", "{bandwidth_hz=5.2e6, bits=3, oversampling=2}"])
def test_noise_has_the_power_1_and_that_of_the_other_codes(front_end: str) -> None:
    """In each dimension, and alike in two correlators as their replicas are; behind a filter and a quantiser, too."""
    found = taken(*CLEAN, "receiver.e1_tracking=none", f"receiver.front_end={front_end}")
    taps, signals = (values.reshape(-1, len(TAP_CHIPS)) for values in (found.taps, found.signals))
    passed = np.sum(taps * signals.conj(), axis=0) / np.sum(np.abs(signals) ** 2, axis=0)
    assert np.abs(passed - 1) == pytest.approx(np.zeros(len(TAP_CHIPS)), abs=0.03)  # three bits lose 0.2 dB, measured
    noise = taps - passed * signals
    expected = (1 + code_noise(found)) * autocorrelation(BOC11, np.subtract.outer(TAP_CHIPS, TAP_CHIPS).ravel())
    covariance = (noise.T @ noise.conj()).real / (2 * len(noise))
    assert covariance.ravel() == pytest.approx(expected, abs=5.5 / np.sqrt(len(noise)))


def test_wideband_jamming_raises_power_and_noise_alike() -> None:
    found = taken(*CLEAN, "receiver.e1_tracking=none", WIDEBAND)
    assert found.power_db.mean() == pytest.approx(found.model_power_db.mean(), abs=0.1)
    assert found.noise.real.var() == pytest.approx(11, rel=0.25)
