"""Correlate a snapshot's samples with a satellite's decrypted chips at many code offsets.

Theory of operation
-------------------
Sample n, taken t_n after the hand-over's start, has code phase and carrier phase

    u_n = R_c (1 + f_d/f_c) t_n + ½ R_c (ḟ_d/f_c) t_n²        chips
    φ_n = 2π (f_c − f_0 + f_d) t_n + π ḟ_d t_n²                 f_0: frequency at 0 Hz in the samples

R_c is the chip rate, f_c the carrier frequency, and x_n is sample n. f_d and ḟ_d are Doppler and Doppler rate of the
hand-over.

Tap k, delayed by d_k chips, is c_k = (1/M) Σ_n x_n e^{−jφ_n} chip[⌊u_n − d_k⌋]. The sum runs over the samples whose
delayed code phase u_n − d_k lies in the segment, the series of chips of the hand-over. M is the number of samples in
the duration of the segment. So without noise a path of amplitude a at delay d_k gives c_k = a.

**Noise floor.** The threshold must come from the noise after the correlation with a code that is not in the signal
[WFO, Sec. IV-A]. Let y_j be the carrier-free samples summed over chip j. A wrong code w of random signs gives Σ_j w_j
y_j. The mean power of this sum over *all* wrong codes is exactly Σ_j |y_j|², because the cross terms cancel. So one
pass over the chips gives the mean result of all wrong codes, and no reference cell is drawn at random. The estimate is
also right for coloured noise and interference. The true signal raises the floor, as with any wrong code. The relative
increase is the energy of a chip over the noise density (−32 dB at 35 dBHz). A floor that is estimated from J chips has
a relative error of 1/√J, which is 0.35 % for 16 ms. The loss of sensitivity by this error (CFAR loss) is 0.0005 dB.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import CorrelatorBank, Handover, SampleBatch, SampleSource
from vestige.sample_processor.correlator_kernel import REACH_CHIPS, bank_span, correlate_block
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.signals.definitions import CARRIER_HZ
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True)
class CorrelatableSamples:
    """E6 samples of a snapshot that the processor can correlate, from a recording or a simulation of samples."""

    batch: SampleBatch  # samples in which the RECS is expected
    surroundings: SampleSource | None = None  # samples in which a search may look for the RECS; None means `batch`

    @property
    def received_from(self) -> GalileoTime:
        """Time tag of the first sample of `batch`."""
        return self.batch.start

    @property
    def searched(self) -> SampleSource:
        """Samples in which a search looks for a RECS: `surroundings`, or `batch` if `surroundings` is None."""
        return self.surroundings or BatchSource(self.batch)

    @property
    def received_until(self) -> GalileoTime:
        """Time tag of the end of the last sample of `batch`."""
        return self.batch.end

    def correlate(self, handover: Handover, offsets_m: Float[np.ndarray, " n_taps"]) -> CorrelatorBank | None:
        """Return the bank of correlators at `offsets_m`, or None if a tap needs samples that `batch` does not have."""
        return correlate(self.batch, handover, offsets_m)


def correlate(batch: SampleBatch, handover: Handover, offsets_m: Float[np.ndarray, " n_taps"]) -> CorrelatorBank | None:
    """Return the correlators of `batch` with the chips of `handover`.

    Samples may have any sampling rate. `offsets_m` are relative to the expected start of the chips; positive is later.

    The function raises `ValueError` if a tap is more than 8 chips (470 m on E6) from the middle of the bank.

    Returns
    -------
    CorrelatorBank | None
        Bank of correlators; None if the samples do not contain the whole segment at the earliest tap, at the latest tap
        and at the expected start.
    """
    chips = handover.chips
    carrier_hz = CARRIER_HZ[batch.band]
    offsets_chips = offsets_m / SPEED_OF_LIGHT_MPS * chips.chip_rate_hz
    earliest, middle, latest = bank_span(offsets_chips)
    if max(middle - earliest, latest - middle) > REACH_CHIPS:
        raise ValueError(f"correlators reach farther than {REACH_CHIPS} chips from the middle of the bank")

    code_rate = chips.chip_rate_hz * (1.0 + handover.doppler_hz / carrier_hz)
    integration_s = chips.n_chips / code_rate
    start = (handover.start_time - batch.start) * batch.sample_rate_hz
    length = integration_s * batch.sample_rate_hz
    first = start + min(earliest / code_rate * batch.sample_rate_hz, 0.0)
    last = start + length + max(latest / code_rate * batch.sample_rate_hz, 0.0)
    if first < 0 or last > batch.samples.size:
        return None

    low, high = floor(first), ceil(last)
    t0 = (low - start) / batch.sample_rate_hz
    if_hz = carrier_hz - batch.center_frequency_hz + handover.doppler_hz
    taps, chip_power = correlate_block(
        np.ascontiguousarray(batch.samples[low:high]).view(np.float32),
        chips.packed,
        chips.n_chips,
        offsets_chips,
        t0,
        1.0 / batch.sample_rate_hz,
        code_rate,
        chips.chip_rate_hz * handover.doppler_rate_hz_per_s / carrier_hz,
        if_hz,
        handover.doppler_rate_hz_per_s,
    )
    return CorrelatorBank(
        offsets_m=offsets_m, taps=taps / length, noise_power=float(chip_power) / length**2, integration_s=integration_s
    )
