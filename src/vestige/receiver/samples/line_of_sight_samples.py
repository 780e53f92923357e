"""Make the E6 samples around each RECS of a single line of sight, without any other satellite."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.sampled_attack import add_jammers, spoofing_signals, true_signal
from vestige.receiver.samples.sampled_epoch import Arrival, e6_samples, received_signal, window
from vestige.receiver.simulation import Simulation
from vestige.receiver.truth import TruthBlock
from vestige.records import FrontEndStatus, SampleBatch
from vestige.signal_generator.keystream import encryption_key, forged_key
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import amplitude

_E6_NOISE = 6  # stream number of the E6 noise


@dataclass(frozen=True, eq=False, kw_only=True)
class LineOfSightSamples:
    """E6 samples of one satellite around the RECS of a block; the samples are made on request."""

    simulation: Simulation
    truth: TruthBlock  # truth of the epochs with RECS
    arrived: Arrival  # arrival of the block's RECS
    first: int  # number of the first RECS of the block

    def around(self, row: int) -> tuple[SampleBatch, FrontEndStatus]:
        """Return the samples around RECS number `row` of the block, and the status of the front end.

        The time tags of the samples do not contain the time offset that an attacker causes.
        """
        of, truth, number = self.simulation, self.truth, self.first + row
        sent = of.transmit_time(number)
        strength = self._amplitude * float(truth.geometry.amplitude[row])
        signal = received_signal(of.chips(sent), self.arrived, truth, row, amplitude=strength)
        taken = window(signal.start_s + float(truth.e1.error_m[row]) / SPEED_OF_LIGHT_MPS, of.n_chips, of.front_end)
        where = (of.svid, sent, of.line_of_sight, truth, row, taken)
        secret, forged = encryption_key(of.seed), forged_key(of.seed)
        return e6_samples(
            (
                true_signal(secret, *where, amplitude=strength) or signal,
                *spoofing_signals((secret, forged), *where, amplitude=strength),
            ),
            sent,
            taken,
            front_end=of.front_end,
            noise_key=noise_key(of.seed, number, of.first_stream + _E6_NOISE),
            noise_power=1.0 + float(truth.e6.white[row]),
            jam=partial(
                add_jammers,
                jammers=truth.e6.jammers,
                row=row,
                rate_hz=of.front_end.input_rate_hz,
                seed=of.seed,
                epoch=number,
                first_stream=of.first_stream,
            ),
        )

    @cached_property
    def _amplitude(self) -> float:
        """Amplitude of the line of sight at the zenith gain of the antenna."""
        return amplitude(self.simulation.cn0_dbhz, self.simulation.front_end.input_rate_hz)
