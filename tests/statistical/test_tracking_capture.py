"""The quasi-static model of a captured E1 loop (`receiver.correlators.e1_loop`) beside the tracking loops on samples.

One satellite and one spoofing signal on E1-C, in noise; the spoofing signal rises on top of the true signal and is
pulled off at 40 m/s. E1-B is left out: the loops do not use it.
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
from vestige.spoofer.repeaters import LiftOff, Nulling
from vestige.spoofer.spoofer import Spoofer

RATE_HZ = 4.3e6
PERIOD_S = 0.004
CHIP_M = SPEED_OF_LIGHT_MPS / 1.023e6
SVID, CODE_AT_0, CN0_DBHZ = 11, 17.3, 48.0
SECONDS = 27


def _attack(power_db: float, phase: Phase) -> Spoofer:
    pull = Ramp(first=0.0, last=700.0, start_s=6.0, stop_s=23.5)  # 40 m/s
    power = Ramp(first=-30.0, last=power_db, start_s=1.0, stop_s=5.0)
    return Spoofer(attacks=(LiftOff(delay_m=pull, power_db=power, phase=phase, bands=(Band.E1,)),))


def _blocked(delay_m: float) -> Spoofer:
    """The line of sight is blocked after 0.6 s, but for -53 dB of it, and a reflection of -6 dB is left."""
    return Spoofer(
        attacks=(
            Nulling(start_s=0.6, gain_db=-0.02),
            LiftOff(start_s=0.6, delay_m=delay_m, power_db=-6.0, phase=Locked(), bands=(Band.E1,)),
        )
    )


def _sampled(chips: np.ndarray) -> np.ndarray:
    code = primary_code(E1C, SVID)[(chips % 4092).astype(int)]
    return (code * np.where((2 * chips).astype(int) % 2 == 0, 1, -1)).astype(np.float32)


def _tracked(spoofer: Spoofer, seed: int, *, seconds: float = SECONDS, rate_hz: float = RATE_HZ) -> np.ndarray:
    """Return the periods of a channel that starts on the true signal."""
    rng = np.random.default_rng(seed)
    n, period_samples = round(seconds / PERIOD_S), round(PERIOD_S * rate_hz)
    secondary = secondary_code(E1C, SVID)
    chips = CODE_AT_0 + np.arange(period_samples) * 1.023e6 / rate_hz
    true = _sampled(chips)
    edge = int(np.ceil((4092 - CODE_AT_0) * rate_hz / 1.023e6))
    sign = np.ones(period_samples, np.float32)
    effects = spoofer.effects(Band.E1, SVID, np.arange(n) * PERIOD_S)
    amplitude = np.sqrt(2 * 10 ** (CN0_DBHZ / 10) / rate_hz)
    within_s = np.arange(period_samples) / rate_hz
    found = E1Snapshot(
        svid=SVID, time=START, transmit_phase_s=CODE_AT_0 / 1.023e6, doppler_hz=0.0, cn0_dbhz=CN0_DBHZ,
        secondary_margin_db=9.0,
    )  # fmt: skip
    channel, rest, tracked = None, np.empty(0, np.complex64), [np.zeros(0, PERIOD)]
    for k in range(n):
        sign[:edge], sign[edge:] = secondary[k % 25], secondary[(k + 1) % 25]
        # the amplitude holds the phase at the beginning of the period, the Doppler turns it from there
        signal = true.astype(np.complex64)
        for one in np.flatnonzero(effects.amplitude[k]):
            turn = effects.amplitude[k, one] * np.exp(2j * np.pi * effects.doppler_hz[k, one] * within_s)
            signal = signal + turn * _sampled(chips + 4092 - effects.delay_m[k, one] / CHIP_M)
        noise = rng.standard_normal((period_samples, 2), np.float32).view(np.complex64)[:, 0]
        block = (noise + amplitude * sign * signal).astype(np.complex64)
        batch = batch_of(np.concatenate((rest, block)), rate_hz, Band.E1)
        begin = k * period_samples - rest.size
        channel = channel or Channel(found, batch, TrackingSettings(pull_in_s=0.1), bandwidth_hz=400e6)
        tracked.append(channel.run(batch.samples, begin).periods)
        rest = batch.samples[channel.first_sample - begin :]
        if channel.lost:
            break
    return np.concatenate(tracked)


def _range_error_m(periods: np.ndarray, rate_hz: float = RATE_HZ) -> np.ndarray:
    sent = CODE_AT_0 + periods["first_sample"] * 1.023e6 / rate_hz
    return -((periods["code_phase"] - sent + 2046) % 4092 - 2046) * CHIP_M


def _model(spoofer: Spoofer) -> E1Tracking:
    return E1Loop(spoofer, SVID, interval_s=1.0, cn0_dbhz=CN0_DBHZ).advance(0, SECONDS)


@pytest.mark.judged(
    by="tracking loops on samples",
    what="model of a captured E1 loop",
    figure="range error within 3.0 m, Doppler within 1.0 Hz",
)
@pytest.mark.parametrize(("power_db", "phase_rad"), [(-0.5, 0.0), (0.5, 0.0), (3.0, np.pi / 2)])
def test_who_captures_the_loop(power_db: float, phase_rad: float) -> None:
    """More power than the true signal takes the loop along, less does not, in the model and on samples.

    Half a decibel decides. At 0 dB it depends on the phase, and a signal that cancels the other one ends the tracking
    (docs/attacks.md has the table).
    """
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
    """The limit of the model, which has no carrier loop: at 40 m/s a coherent spoofing signal is 210 Hz off at once.

    The model says that 3 dB more power captures the code; the carrier loop, of 15 Hz, stays with the true signal, and
    4 ms of integration leave a quarter of the spoofing signal's amplitude.
    """
    spoofer = _attack(3.0, Coherent(phase_rad=0.0))
    model, periods = _model(spoofer), _tracked(spoofer, seed=3)
    assert model.captured[-1]
    assert periods.size > 250 * (SECONDS - 1)
    assert abs(np.median(_range_error_m(periods[-500:]))) < 3.0


def test_a_reflection_that_is_left_holds_the_loop_on_its_side_peak() -> None:
    """The true signal vanishes, a reflection 0.58 chip later stays: its side peak, half a chip earlier, is nearest.

    The flanks of a side peak have the slopes 3 and 1, so early equals late a quarter of their spacing before it.
    """
    delay_m, rate_hz, spacing_samples = 170.0, 12.3e6, 2
    model = E1Loop(_blocked(delay_m), SVID, interval_s=0.5, cn0_dbhz=CN0_DBHZ).advance(0, 5)
    spacing_chips = spacing_samples * 1.023e6 / rate_hz  # 0.166; the model's is 0.1
    assert model.error_m[-1] == pytest.approx(delay_m - (0.5 + 0.1 / 4) * CHIP_M, abs=0.3)
    assert 10 * np.log10(model.gain[-1]) == pytest.approx(-6.0 - 6.5, abs=0.1)
    periods = _tracked(_blocked(delay_m), seed=3, seconds=2.2, rate_hz=rate_hz)
    last = np.median(_range_error_m(periods, rate_hz)[-125:])
    assert last == pytest.approx(delay_m - (0.5 + spacing_chips / 4) * CHIP_M, abs=3.0)
