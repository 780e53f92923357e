"""Measure E1 in a short piece of samples, without a tracking loop.

Theory of operation
-------------------
[WFO, Sec. II-A] assumes continuous E1 tracking. A recording of 100 ms has no continuous tracking. So this module starts
from an `Acquisition`, and measures in one batch the values that a tracking loop would reach:

1. Correlators: every code period of 4 ms is correlated with BOC(1,1) replicas of E1-C and E1-B, at `TAPS_CHIPS` around
   the acquired code phase.
2. Secondary code of E1-C: all 25 phases of CS25_1 are tried on the prompts. The phase with the highest peak of the
   Doppler spectrum is chosen. This phase gives the time of transmission modulo 100 ms. The frequency of the peak gives
   the Doppler to a fraction of 10 Hz, the reciprocal of 100 ms.
3. Doppler: the secondary code is removed from the prompts. The slope of a straight line through the phases of
   the prompts, weighted by the power of the prompts, gives the residual Doppler.
4. Code phase: the symbols of E1-B are removed with the sign of the E1-B prompt relative to the pilot's phase. Then the
   periods of E1-B and of E1-C are added coherently over the batch, and the two magnitudes are added. The code phase is
   the delay at which early and late magnitude are equal.
5. C/N0 of E1-C: from the coherent prompt and the noise of wrong codes, or from the prompts alone (`cn0.py`). The
   prompts of 100 ms give 23 complex degrees of freedom for the noise, so estimates from prompts alone have a standard
   deviation of at least 0.9 dB. The noise of wrong codes is accurate to 0.01 dB.

All values refer to the middle of the measured code periods.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Complex128

from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S
from vestige.records import SampleBatch
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.cn0 import CN0_ESTIMATORS, Cn0Estimator, narrow_to_wide_dbhz
from vestige.sample_processor.period_taps import TAPS_CHIPS, peak_chips, period_taps
from vestige.signals.codes import secondary_code
from vestige.signals.definitions import E1B, E1C
from vestige.time import GalileoTime

E1_WINDOW_S = 0.1  # duration of samples in s for one measurement: a period of the secondary code
# Below this margin the phase of the secondary code is ambiguous. Without noise, the margin is 5.6 dB.
MIN_SECONDARY_MARGIN_DB = 1.0
MIN_PERIODS = 12  # number of periods of 4 ms that are needed to distinguish the 25 secondary phases at 33 dBHz
NOISE_FLOOR = "noise-floor"
# The narrow-to-wide ratio usually sums groups of 20 prompts. The 25 prompts of 100 ms contain only one group of 20
# prompts. With two groups of 12 prompts, the bias is smaller and the spread is no larger.
_PROMPT_ESTIMATORS: dict[str, Cn0Estimator] = {
    **CN0_ESTIMATORS,
    "narrow-to-wide": partial(narrow_to_wide_dbhz, together=MIN_PERIODS),
}
ESTIMATORS = (NOISE_FLOOR, *_PROMPT_ESTIMATORS)
# number of iterations that measure the code phase and centre the taps; the acquired code phase may be 0.17 chip off
_CODE_STEPS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Snapshot:
    """E1 measurements of one satellite in a batch of samples."""

    svid: int
    time: GalileoTime  # receiver-clock time to which all values refer
    # satellite time of transmission at `time`, modulo 100 ms (the period of the secondary code), in s
    transmit_phase_s: float
    doppler_hz: float
    cn0_dbhz: float  # C/N0 of E1-C alone; NaN if noise makes the formula undefined
    secondary_margin_db: float  # peak of the chosen secondary-code phase over the peak of the second-best phase


def measure_e1(batch: SampleBatch, acquisition: Acquisition, *, cn0_estimator: str = NOISE_FLOOR) -> E1Snapshot | None:
    """Return the E1 measurement of one acquired satellite, or None if the batch has too few code periods.

    A batch of `MIN_PERIODS` + 2 code periods is long enough.
    """
    start_s, doppler_hz = acquisition.code_start_s, acquisition.doppler_hz
    for _ in range(_CODE_STEPS):
        pilot, noise = period_taps(batch, E1C, acquisition.svid, start_s, doppler_hz)
        if pilot.shape[0] < MIN_PERIODS:
            return None
        phase, residual_hz, margin_db = _secondary_phase(pilot[:, TAPS_CHIPS.size // 2])
        doppler_hz += residual_hz
        data, _ = period_taps(batch, E1B, acquisition.svid, start_s, doppler_hz)
        pilot, noise = period_taps(batch, E1C, acquisition.svid, start_s, doppler_hz)
        pilot *= secondary_code(E1C, acquisition.svid)[(phase + np.arange(pilot.shape[0])) % 25][:, None]
        rate_hz, turn = _phase_line(pilot[:, TAPS_CHIPS.size // 2])
        doppler_hz += rate_hz
        start_s += _code_error_chips(pilot, data, rate_hz, turn) / E1C.chip_rate_hz

    periods = pilot.shape[0]
    middle_s = periods / 2 * E1_CODE_PERIOD_S / (1 + doppler_hz / E1_CARRIER_HZ)
    prompts = _unturn(pilot[:, TAPS_CHIPS.size // 2], rate_hz, turn)
    return E1Snapshot(
        svid=acquisition.svid,
        time=batch.start + (start_s + middle_s),
        transmit_phase_s=((phase + periods / 2) * E1_CODE_PERIOD_S) % 0.1,
        doppler_hz=doppler_hz,
        cn0_dbhz=_cn0_dbhz(prompts, noise, cn0_estimator),
        secondary_margin_db=margin_db,
    )


def _secondary_phase(prompts: Complex128[np.ndarray, " periods"]) -> tuple[int, float, float]:
    """Return the secondary-code index of the first period, the residual Doppler in Hz, and the margin in dB."""
    code = secondary_code(E1C, 1).astype(np.float64)
    phases = (np.arange(25)[:, None] + np.arange(prompts.size)[None, :]) % 25
    n_fft = 1024
    power = np.abs(np.fft.fft(code[phases] * prompts, n_fft, axis=1)) ** 2
    best = np.max(power, axis=1)
    order = np.argsort(best)
    peak = int(np.argmax(power[order[-1]]))
    frequency_hz = ((peak + n_fft // 2) % n_fft - n_fft // 2) / (n_fft * E1_CODE_PERIOD_S)
    return int(order[-1]), frequency_hz, float(10 * np.log10(best[order[-1]] / best[order[-2]]))


def _phase_line(prompts: Complex128[np.ndarray, " periods"]) -> tuple[float, float]:
    """Return the residual frequency of the prompts in Hz, and their phase in rad at the middle of the batch."""
    m = (np.arange(prompts.size) - (prompts.size - 1) / 2) * E1_CODE_PERIOD_S
    reference = np.angle(np.sum(prompts))
    angles = np.angle(prompts * np.exp(-1j * reference))  # small angles, as the Doppler error is below 1 Hz
    weights = np.abs(prompts) ** 2
    weights /= np.sum(weights)
    center = np.sum(weights * m)
    slope = np.sum(weights * (m - center) * angles) / np.sum(weights * (m - center) ** 2)
    return float(slope / (2 * np.pi)), float(reference + np.sum(weights * angles) - slope * center)


def _unturn(
    values: Complex128[np.ndarray, " periods"], rate_hz: float, turn: float
) -> Complex128[np.ndarray, " periods"]:
    """Return values without a linear phase, which is `turn` in rad at the middle and has the frequency `rate_hz`."""
    m = (np.arange(values.size) - (values.size - 1) / 2) * E1_CODE_PERIOD_S
    return values * np.exp(-1j * (turn + 2 * np.pi * rate_hz * m))


def _cn0_dbhz(prompts: Complex128[np.ndarray, " periods"], noise: float, estimator: str) -> float:
    if estimator != NOISE_FLOOR:
        return float(_PROMPT_ESTIMATORS[estimator](prompts[None], E1_CODE_PERIOD_S)[0])
    signal = abs(np.mean(prompts)) ** 2 - noise / prompts.size
    return float(10 * np.log10(max(signal, 1e-12) / noise / E1_CODE_PERIOD_S))


def _code_error_chips(
    pilot: Complex128[np.ndarray, "periods taps"],
    data: Complex128[np.ndarray, "periods taps"],
    rate_hz: float,
    turn: float,
) -> float:
    """Return the code's delay after the middle tap in chips, at which early and late magnitude are equal."""
    middle = TAPS_CHIPS.size // 2
    periods = min(pilot.shape[0], data.shape[0])
    line = _unturn(np.ones(pilot.shape[0], np.complex128), rate_hz, turn)[:periods, None]
    pilot, data = pilot[:periods] * line, data[:periods] * line
    symbols = np.sign(data[:, middle].real)[:, None]
    total = np.abs(np.sum(pilot, axis=0) + 0.0) + np.abs(np.sum(data * symbols, axis=0))
    return peak_chips(total)
