"""E1 correlators and received power of a sky: the model and samples have the same distribution.

Both fidelities have the same truth and noise of their own. Correlators are compared in units of a BOC(1,1) of the
C/N0 that each satellite has, which is no part of what is tested.

Error budget: 90 comparisons at 1e-6 each.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from jaxtyping import Complex128, Float
from scipy.special import kolmogorov

from sky_builder import CLEAN, sky_scenario, whole_block
from vestige.receiver.correlators.e1_taps import INTEGRATION_S, TAP_CHIPS
from vestige.receiver.correlators.sky_e1_model import strangers_covariance_s
from vestige.records import Band
from vestige.signals.definitions import E1C
from vestige.signals.pulse import BOC11, band_limited_correlation

EPOCHS = 12
RATE_HZ = 6.2e6
LIFT_OFF = (
    'attack=[{kind="lift-off", start_s=0, power_db=3, delay_m={kind="ramp", first=0, last=110, start_s=1, stop_s=11}}]'
)
FAR_AND_JAMMED = (
    'attack=[{kind="meaconing", delay_s=0.013, power_db=3}, '
    '{kind="jamming", bands=["E1"], j_over_n_db=3, waveform={kind="cw"}}]'
)
WIDEBAND = 'attack=[{kind="jamming", bands=["E1"], j_over_n_db=10, waveform={kind="wideband"}}]'
STILL = (*CLEAN, "receiver.e1_tracking=none")  # the loops stand at the line of sight
LOUD_DBHZ = 68.0  # where the other codes are several times the noise of the receiver
LOUD = (
    *STILL,
    f"receiver.cn0_e1_dbhz={LOUD_DBHZ}",
    "constellation.cn0_fall_db=0",
    "constellation.svids=[7, 13]",
    "epochs=16",
    "recs.every=16",
)
ALIGNED = (108, 120)  # correlation of the codes of E1-B and E1-C of these two at delay zero, in chips
FILTER = (*STILL, "receiver.front_end={bandwidth_hz=5.2e6, bits=3, oversampling=2}")
PARTS = {"magnitude": np.abs, "real": np.real, "imaginary": np.imag, "phase": np.angle}


class Taken(NamedTuple):
    """What one fidelity gave, without gain control."""

    taps: Complex128[np.ndarray, "n m k"]
    power_db: Float[np.ndarray, " n"]
    strength: Float[np.ndarray, "n m"]  # of the undisturbed correlator of a signal in BOC(1,1)

    @property
    def relative(self) -> Complex128[np.ndarray, "nm k"]:
        """Correlators in units of the undisturbed BOC(1,1)."""
        return (self.taps / self.strength[..., None]).reshape(-1, len(TAP_CHIPS))


@cache
def taken(fidelity: str, *settings: str) -> Taken:
    scenario = sky_scenario(
        f'fidelity="{fidelity}"', f"epochs={EPOCHS}", f"recs.every={EPOCHS}", f"receiver.sample_rate_hz={RATE_HZ}",
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
    power_db = block.front_end[Band.E1].total_power_db
    return Taken(
        taps=block.e1.taps * 10 ** (power_db / 20)[:, None, None],
        power_db=power_db,
        strength=np.sqrt(2 * 10 ** (cn0_dbhz / 10) * INTEGRATION_S),
    )


def both(*settings: str) -> tuple[Taken, Taken]:
    return taken("correlators", *settings), taken("samples", *settings)


def same(a: np.ndarray, b: np.ndarray) -> float:
    """Return the p-value of the two-sample test of Kolmogorov and Smirnov."""
    x = np.concatenate([a, b])
    steps = [np.searchsorted(np.sort(one), x, side="right") / one.size for one in (a, b)]
    return float(kolmogorov(np.max(np.abs(steps[0] - steps[1])) * np.sqrt(a.size * b.size / (a.size + b.size))))


@pytest.mark.judged(
    by="vestige at the other fidelity",
    what="E1 correlators and power",
    figure="power within 0.1 dB, each correlator p > 1e-6",
)
@pytest.mark.parametrize("settings", [LOUD, (LIFT_OFF,)])
def test_both_fidelities_have_one_distribution(settings: tuple[str, ...]) -> None:
    """Undisturbed and strong, and with multipath and a signal that pulls the loop away."""
    model, samples = both(*settings)
    for tap in range(len(TAP_CHIPS)):
        for name, part in PARTS.items():
            assert same(part(model.relative[:, tap]), part(samples.relative[:, tap])) > 1e-6, (tap, name)
    assert same(model.power_db, samples.power_db) > 1e-6
    assert model.power_db.mean() == pytest.approx(samples.power_db.mean(), abs=0.1)


def test_another_strength_would_be_seen() -> None:
    """0.4 dB, by which a CBOC in the correlators of a BOC(1,1) is weaker than a BOC(1,1)."""
    model = np.abs(both(*LOUD)[0].relative[:, TAP_CHIPS.index(0.0)])
    assert same(model, np.sqrt(11 / 10) * model) < 1e-6


@pytest.mark.parametrize("attack", [LIFT_OFF, FAR_AND_JAMMED])
def test_what_is_left_of_the_difference_is_noise(attack: str) -> None:
    """With one truth the signals cancel; a wave that jams is the same in the correlators of all satellites.

    The range of a replay that is 13 ms late agrees to 5 cm (`test_replayed_past`), which leaves its carrier phase open:
    it is taken off, one angle for each satellite.
    """
    model, samples = both(attack)
    jammed = attack == FAR_AND_JAMMED
    assert np.abs(model.taps).mean() > 25
    assert model.power_db == pytest.approx(samples.power_db, abs=0.4)  # of a beat at other instants
    assert model.power_db.mean() == pytest.approx(samples.power_db.mean(), abs=0.1)
    turned = np.sum(model.taps * np.conj(samples.taps), axis=(0, 2), keepdims=True) if jammed else np.ones(1)
    apart = (model.taps - samples.taps * turned / np.abs(turned)).reshape(-1, len(TAP_CHIPS))
    n = EPOCHS if jammed else len(apart)
    for part in (apart.real, apart.imag):
        spread = part.std(axis=0)
        assert np.all(np.abs(part.mean(axis=0)) < 5.5 * spread / np.sqrt(n)), part.mean(axis=0)
        assert np.all(spread < (8 if jammed else 2.1)), spread


@pytest.mark.parametrize("fidelity", ["correlators", "samples"])
def test_the_other_codes_are_noise(fidelity: str) -> None:
    """Those of the other satellite in each dimension; the own E1-B in phase with the signal, not in early − late."""
    found = taken(fidelity, *LOUD)
    noise = found.taps - found.taps.mean(axis=0)
    early_less_late = noise[..., 0] - noise[..., -1]
    prompt = noise[..., TAP_CHIPS.index(0.0)]
    measured = np.array([prompt.imag.var(), prompt.real.var(), early_less_late.imag.var(), early_less_late.real.var()])
    strength_hz = 10 ** (LOUD_DBHZ / 10)
    other = strength_hz * strangers_covariance_s(RATE_HZ)
    own = 2 * strength_hz / E1C.chip_rate_hz * 10 / 11 * np.mean(np.square(ALIGNED)) / E1C.code_length
    difference = 2 * (1 - 0.1 + other[0, 0] - other[0, -1])  # R(0.3) = 0.1
    expected = np.array([1 + other[0, 0], 1 + other[0, 0] + own, difference, difference])
    assert expected[0] > 4
    assert expected[1] > 6 * expected[0]
    assert np.abs(np.log(measured / expected)).max() < 5 * np.sqrt(2 / prompt.size), (measured, expected)


def test_a_filter_rounds_the_correlators_of_samples() -> None:
    """And a quantiser of three bits loses 0.2 dB; the model has neither."""
    found = taken("samples", *FILTER).relative.mean(axis=0)
    expected = band_limited_correlation(
        E1C.pulse, BOC11, np.array(TAP_CHIPS), chip_rate_hz=E1C.chip_rate_hz, bandwidth_hz=5.2e6
    )
    assert np.abs(found / expected - 1) == pytest.approx(np.zeros(len(TAP_CHIPS)), abs=0.04)


def test_wideband_jamming_raises_power_and_noise_alike() -> None:
    model, samples = both(*STILL, WIDEBAND)
    assert model.power_db.mean() == pytest.approx(samples.power_db.mean(), abs=0.1)
    for found in (model, samples):
        noise = (found.taps - found.taps.mean(axis=0))[..., TAP_CHIPS.index(0.0)]
        assert np.log(np.mean(np.abs(noise) ** 2) / 22) == pytest.approx(0.0, abs=5 / np.sqrt(noise.size))
