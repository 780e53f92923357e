"""False alarms and detections of simulated receivers, at both fidelities, through the real detection code.

Every count is compared with theory by the exact two-sided binomial test. Budget: 11 tests at 1e-6 each, fixed seeds.

**Independent decisions.** The noise of two taps has the correlation of their replicas, a triangle that ends at one
chip, 58.6 m. At 15 m apart an excess of false alarms on one tap drags its neighbours along, and a binomial test would
reject a correct receiver. So the taps here stand 60 m apart: their noise is independent, and so is every decision. The
noise power, which a bank shares, is estimated from 81,840 chips: its scatter of 0.35 % moves P_fa = 1e-4 by 0.05 % in
the mean, against 3 % of counting noise.

**One tap a decision.** A maximum detector on three taps has one candidate, the middle one, and compares it with the
threshold. So each tap with its two neighbours is a bank of three for `detect_block`. A bank holds 15 taps of 60 m, so
there are 13 decisions an epoch.
"""

from __future__ import annotations

import numpy as np
import pytest

from simulated_banks import banks as banks_of
from vestige.acas_processor.detectors import MaximumDetector
from vestige.acas_processor.measure import detect_block
from vestige.campaign.statistics import binomial_test
from vestige.receiver.simulation import Fidelity
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.toml.toml_file import overridden
from vestige.theory.thresholds import probability_of_detection, threshold

APART_M = 60.0  # more than a chip
ALPHA = 1e-6
BLOCK = 5000
# no error models, so that the middle tap is on the line of sight, which moves as in the paper
PLAIN = {
    "kind": "campaign",
    "seed": 6,
    "start": "2026-11-21T12:00:00 GST",
    "epochs": 1,
    "line_of_sight": {"v_mps": 51.023, "amplitude_m": 0.5012, "omega_radps": 3.149132472},
    "receiver": {"cn0_dbhz": 35.0, "cn0_e1_dbhz": 35.0},
    "processor": {"detector": "maximum", "tap_spacing_m": APART_M, "early_reach_m": 0.0},
}


def scenario(fidelity: Fidelity, epochs: int, *settings: str) -> CampaignScenario:
    own = (f'fidelity="{fidelity}"', f"epochs={epochs}")
    return CampaignScenario.model_validate(overridden(PLAIN, (*own, *settings)))


def decisions(campaign: CampaignScenario, p_fas: tuple[float, ...]) -> tuple[list[int], int]:
    """Return how many taps with two neighbours are detected on their own at each P_fa, and how many there are."""
    receiver, processor = campaign.simulation(), campaign.processor.processor()
    truth, detected, trials = receiver.truth(), np.zeros(len(p_fas), int), 0
    for first in range(0, receiver.n_epochs, BLOCK):
        count = min(BLOCK, receiver.n_epochs - first)
        taps, noise_power, _ = banks_of(receiver, campaign.fidelity, first, truth.advance(first, count), processor)
        triples = np.lib.stride_tricks.sliding_window_view(taps, 3, axis=1).reshape(-1, 3)
        for i, p_fa in enumerate(p_fas):
            found = detect_block(
                triples,
                np.repeat(noise_power, taps.shape[1] - 2),
                np.array([-APART_M, 0.0, APART_M]),
                detector=MaximumDetector(),
                threshold_sigma=float(threshold(p_fa)),
            )
            detected[i] += np.count_nonzero(found.tap == 1)
        trials += len(triples)
    return detected.tolist(), trials


@pytest.mark.judged(
    by="theory",
    what="false alarms of the detector",
    figure="10,000,000 decisions at P_fa 1e-4, binomial test at 1e-6",
)
def test_ten_million_decisions_on_noise() -> None:
    """1e7 at P_fa 1e-4: a count of 1000 ± 32; the test rejects outside of about 850 to 1160."""
    n_taps = 15
    epochs = 10_000_000 // (n_taps - 2) + 1
    campaign = scenario("correlators", epochs, "receiver.signal=false", f"processor.n_taps={n_taps}")
    (alarms,), trials = decisions(campaign, (1e-4,))
    assert trials >= 10_000_000
    assert binomial_test(alarms, trials, 1e-4) > ALPHA


def test_decisions_on_the_noise_of_samples() -> None:
    """26,000 at P_fa 1e-2, and the same at 1e-3."""
    p_fas = (1e-2, 1e-3)
    alarms, trials = decisions(scenario("samples", 2000, "receiver.signal=false", "processor.n_taps=15"), p_fas)
    assert trials == 26_000
    for count, p_fa in zip(alarms, p_fas, strict=True):
        assert binomial_test(count, trials, p_fa) > ALPHA


@pytest.mark.judged(by="theory", what="probability of detection", figure="Marcum Q, binomial test at 1e-6")
@pytest.mark.parametrize(
    ("fidelity", "epochs", "cn0_dbhz"),
    [
        *(("correlators", 100_000, cn0_dbhz) for cn0_dbhz in (24.0, 26.0, 28.0, 30.0, 31.5)),
        # Few, most and about half; that samples have the distribution of correlators at all: `test_simulation.py`.
        *(("samples", 600, cn0_dbhz) for cn0_dbhz in (24.0, 28.0, 31.5)),
    ],
)
def test_a_signal_on_a_tap_is_detected_as_often_as_marcum_q_says(
    fidelity: Fidelity, epochs: int, cn0_dbhz: float
) -> None:
    """P_d from 0.09 to 0.993 at P_fa 1e-4; the seeds differ, so that the points are independent."""
    settings = (f"receiver.cn0_dbhz={cn0_dbhz}", f"seed={int(10 * cn0_dbhz)}", "processor.n_taps=3")
    (detected,), trials = decisions(scenario(fidelity, epochs, *settings), (1e-4,))
    assert trials == epochs
    expected = float(probability_of_detection(cn0_dbhz, 81_840 / 5.115e6, 1e-4))
    assert 0.05 < expected < 0.995
    assert binomial_test(detected, trials, expected) > ALPHA
