"""The quasi-static model of a captured E1 loop (`receiver.correlators.e1_loop`) beside the tracking loops on samples.

One satellite and one counterfeit on E1-C, in noise; the counterfeit rises on top of the true signal and is pulled off
at 40 m/s. E1-B is left out: the loops do not use it.
"""

from __future__ import annotations

import numpy as np
import pytest

from builders import START, batch_of
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_loop import E1Loop, E1Tracking
from vestige.records import Band
from vestige.sample_processor.e1_snapshot import E1Snapshot
from vestige.sample_processor.tracking.channel import Channel
from vestige.sample_processor.tracking.channel_kernel import PERIOD
from vestige.sample_processor.tracking.settings import TrackingSettings
from vestige.signals.codes import primary_code, secondary_code
from vestige.signals.definitions import E1C
from vestige.spoofer.phase import Coherent, Locked, Phase
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import LiftOff
from vestige.spoofer.spoofer import Spoofer

RATE_HZ = 4.3e6
PERIOD_SAMPLES = 17_200
CHIP_M = SPEED_OF_LIGHT_MPS / 1.023e6
SVID, CODE_AT_0, CN0_DBHZ = 11, 17.3, 48.0
SECONDS = 27


def _attack(power_db: float, phase: Phase) -> Spoofer:
    pull = Ramp(first=0.0, last=700.0, start_s=6.0, stop_s=23.5)  # 40 m/s
    power = Ramp(first=-30.0, last=power_db, start_s=1.0, stop_s=5.0)
    return Spoofer(attacks=(LiftOff(delay_m=pull, power_db=power, phase=phase, bands=(Band.E1,)),))


def _sampled(chips: np.ndarray) -> np.ndarray:
    code = primary_code(E1C, SVID)[(chips % 4092).astype(int)]
    return (code * np.where((2 * chips).astype(int) % 2 == 0, 1, -1)).astype(np.float32)


def _tracked(spoofer: Spoofer, seed: int) -> np.ndarray:
    """Return the periods of a channel that starts on the true signal."""
    rng = np.random.default_rng(seed)
    n = SECONDS * 250
    secondary = secondary_code(E1C, SVID)
    chips = CODE_AT_0 + np.arange(PERIOD_SAMPLES) * 1.023e6 / RATE_HZ
    true = _sampled(chips)
    edge = int(np.ceil((4092 - CODE_AT_0) * RATE_HZ / 1.023e6))
    sign = np.ones(PERIOD_SAMPLES, np.float32)
    effects = spoofer.effects(Band.E1, SVID, np.arange(n) * 0.004)
    amplitude = np.sqrt(2 * 10 ** (CN0_DBHZ / 10) / RATE_HZ)
    within_s = np.arange(PERIOD_SAMPLES) / RATE_HZ
    found = E1Snapshot(
        svid=SVID, time=START, transmit_phase_s=CODE_AT_0 / 1.023e6, doppler_hz=0.0, cn0_dbhz=CN0_DBHZ,
        secondary_margin_db=9.0,
    )  # fmt: skip
    channel, rest, tracked = None, np.empty(0, np.complex64), [np.zeros(0, PERIOD)]
    for k in range(n):
        sign[:edge], sign[edge:] = secondary[k % 25], secondary[(k + 1) % 25]
        # the amplitude holds the phase at the beginning of the period, the Doppler turns it from there
        turn = effects.amplitude[k, 0] * np.exp(2j * np.pi * effects.doppler_hz[k, 0] * within_s)
        signal = true + turn * _sampled(chips + 4092 - effects.delay_m[k, 0] / CHIP_M)
        noise = rng.standard_normal((PERIOD_SAMPLES, 2), np.float32).view(np.complex64)[:, 0]
        block = (noise + amplitude * sign * signal).astype(np.complex64)
        batch = batch_of(np.concatenate((rest, block)), RATE_HZ, Band.E1)
        begin = k * PERIOD_SAMPLES - rest.size
        channel = channel or Channel(found, batch, TrackingSettings(pull_in_s=0.1), bandwidth_hz=400e6)
        tracked.append(channel.run(batch.samples, begin).periods)
        rest = batch.samples[channel.first_sample - begin :]
        if channel.lost:
            break
    return np.concatenate(tracked)


def _range_error_m(periods: np.ndarray) -> np.ndarray:
    sent = CODE_AT_0 + periods["first_sample"] * 1.023e6 / RATE_HZ
    return -((periods["code_phase"] - sent + 2046) % 4092 - 2046) * CHIP_M


def _model(spoofer: Spoofer) -> E1Tracking:
    return E1Loop(spoofer, SVID, interval_s=1.0, cn0_dbhz=CN0_DBHZ).advance(0, SECONDS)


@pytest.mark.parametrize(("power_db", "phase_rad"), [(-3.0, 0.0), (3.0, 0.0), (3.0, np.pi / 2)])
def test_who_captures_the_loop(power_db: float, phase_rad: float) -> None:
    """More power than the true signal takes the loop along, less does not, in the model and on samples."""
    spoofer = _attack(power_db, Locked(phase_rad=phase_rad))
    model, periods = _model(spoofer), _tracked(spoofer, seed=3)
    assert abs(model.error_m[-1] - (700.0 if power_db > 0 else 0.0)) < 0.1
    last = _range_error_m(periods[-500:])
    assert periods.size > 250 * (SECONDS - 1), "the channel was lost"
    # 48 dBHz: 0.3 m of noise; the loop has caught up
    assert np.median(last) == pytest.approx(model.error_m[-1], abs=3.0)
    doppler_hz = np.mean(periods["carrier_step"][-500:]) * RATE_HZ
    assert doppler_hz == pytest.approx(-model.rate_error_mps[-1] * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS, abs=1.0)


def test_a_carrier_that_steps_away_does_not_take_the_loop_along() -> None:
    """The limit of the model, which has no carrier loop: at 40 m/s a coherent counterfeit is 210 Hz off at once.

    The model says that 3 dB more power captures the code; the carrier loop, of 15 Hz, stays with the true signal, and
    4 ms of integration leave a quarter of the counterfeit's amplitude.
    """
    spoofer = _attack(3.0, Coherent(phase_rad=0.0))
    model, periods = _model(spoofer), _tracked(spoofer, seed=3)
    assert model.captured[-1]
    assert periods.size > 250 * (SECONDS - 1)
    assert abs(np.median(_range_error_m(periods[-500:]))) < 3.0
