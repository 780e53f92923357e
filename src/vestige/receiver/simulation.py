"""Simulate one satellite of a receiver: the truth, the keys, and the RECS on E6 at either fidelity [WFO, Sec. V].

P is the part of the pseudorange that both bands have in common: geometry, receiver clock, and the troposphere of a
sky. P1 and P6 are the ranges on E1 and E6:

    P1 = P + e1_noise + e1_multipath                 range that E1 tracking measures
    P6 = P + iono_diff + bias                        range of the line of sight in E6

The range error of the hand-over is thus P6 − P1 = iono_diff + bias − e1_noise − e1_multipath. Reflections arrive later
than the line of sight by their excess delay. All terms of P1 and P6 are delays of the code. The carrier has no bias,
and the ionosphere advances the carrier (`sampled_epoch`). Under attack, P1 also contains e1_error, the error of
the pseudorange that the attack causes in the E1 loop. Under attack, E6 also contains spoofing signals, noise and
jamming (`sampled_attack`, `disturbance`).

The two fidelities of E6 are:

* `samples`: the server encrypts the epoch's chips under the epoch's OSNMA key. The receiver samples the chips with
  reflections and noise, and the real processor decrypts and correlates them. Under a sky the samples come from one
  recording of all satellites (`snapshots.sky_samples`).
* `correlators`: the correlators of a block are drawn at random from their distribution (`correlator_model`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Complex128, Float

from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.crypto.osnma.messages.chain_parameters import ALPHA_BYTES, ChainParameters
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.crypto.osnma.operator.osnma_service import SERVICE_WITHOUT_EVENTS, OsnmaService
from vestige.crypto.recs.recs_segment import CipherMode, encrypt, key_time
from vestige.receiver.correlators.correlator_model import CorrelatorModel
from vestige.receiver.correlators.disturbance import drawn_disturbance
from vestige.receiver.correlators.e1_loop import REACQUISITION_S
from vestige.receiver.correlators.e1_multipath import e1_multipath_error_m
from vestige.receiver.draws import DRAW_BLOCK, rows_of
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.sampled_epoch import Arrival, arrival, osnma_keys, osnma_operator, recorded_until_s
from vestige.receiver.sky.elevation import ElevationEffects
from vestige.receiver.sky.replayed_past import SpooferUnderSky, replay_delay_m
from vestige.receiver.truth import TruthBlock, TruthProcess
from vestige.receiver.undisturbed_truth import ErrorModels
from vestige.records import ChipSequence, EncryptedSegment
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.signal_generator.range_model import RangeHistory
from vestige.signals.definitions import E6C
from vestige.spoofer.spoofer import NO_SPOOFER, Spoofer
from vestige.streams import stream
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

Fidelity = Literal["samples", "correlators"]

SVID = 11  # SVID of the single line of sight, chosen here because the paper gives no SVID
# parameters that give the time at which a key is sent, whatever the value of alpha
KEY_ON_AIR = ChainParameters(alpha=bytes(ALPHA_BYTES))
# Delay of an E1 signal in s above which different travel times cannot explain the delay. Travel times differ by less
# than 0.1 s.
CLOCK_FOLLOWS_S = 0.1
_STREAMS_A_SATELLITE = 1 << 16
# upper limit of the time in s that samples and message last after the last epoch if no attack delays the signals
_AFTER_LAST_EPOCH_S = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """A receiver on one line of sight, either single or part of a sky."""

    seed: int  # seed from which all random numbers follow
    start: GalileoTime  # time of transmission of the first RECS (epoch 0), a whole second
    n_epochs: int  # number of RECS
    interval_s: float  # time between RECS in s, a multiple of 0.1 s
    line_of_sight: RangeHistory
    models: ErrorModels
    cn0_dbhz: float  # C/N0 of the component E6-C; −∞ if E6 has neither line of sight nor reflections
    cn0_e1_dbhz: float  # C/N0 of the component E1-C
    # front end of E6 with the sampling rate; `BetzTrackingNoise` contains the front end of E1 tracking
    front_end: FrontEnd
    time_uncertainty_s: float  # upper limit in s that the receiver assumes for the error of its clock
    n_chips: int  # number of chips of a RECS
    key_delay: int  # KDI
    cipher_mode: CipherMode = CipherMode.CBC  # mode in which the service encrypts the RECS
    spoofer: Spoofer = NO_SPOOFER
    # constant error of the receiver's clock in addition to the oscillator's error, positive if the clock is ahead. The
    # receiver does not know this error. Only the fidelity `correlators` allows such an error.
    clock_offset_s: float = 0.0
    svid: int = SVID
    osnma: OsnmaService = SERVICE_WITHOUT_EVENTS  # events of the OSNMA operator and its keys
    # effects of the elevation on a satellite of a sky; None without a sky. Under a sky the satellite's random numbers
    # depend on the SVID.
    elevation: ElevationEffects | None = None
    # time in s between the epochs of `truth` if some epochs have no RECS; None if every epoch has a RECS
    truth_interval_s: float | None = None
    # time in s from the loss of E1, or from a restart of the receiver, to the next measurements
    reacquisition_s: float = REACQUISITION_S
    longest_delay_s: float = 0.0  # upper limit in s of the delays of spoofing signals under a sky

    def truth(self) -> TruthProcess:
        """Return a new process that gives the truth from epoch 0 on."""
        return TruthProcess(self)

    @property
    def epoch_interval_s(self) -> float:
        """Time in s between the epochs of `truth`."""
        return self.interval_s if self.truth_interval_s is None else self.truth_interval_s

    def transmit_time(self, epoch: int) -> GalileoTime:
        """Return the time of transmission of RECS number `epoch`, a whole multiple of 0.1 s."""
        deciseconds = epoch * round(10 * self.interval_s)
        return GalileoTime.normalized(self.start.week, self.start.second + deciseconds // 10, deciseconds % 10 / 10)

    def osnma_operator(self) -> OsnmaOperator:
        """Return the OSNMA operator of the run, in its state before the first broadcast.

        The operator has the key of every RECS of the run.
        """
        return osnma_operator(self.seed, self.start, self._subframes, self.osnma)

    @property
    def _labels(self) -> tuple[int, ...]:
        """Labels of the satellite's random numbers: the SVID under a sky, no label on a single line of sight."""
        return () if self.elevation is None else (self.svid,)

    @property
    def first_stream(self) -> int:
        """Number of the first random stream for the noise in samples."""
        return 0 if self.elevation is None else _STREAMS_A_SATELLITE * self.svid

    @property
    def _subframes(self) -> int:
        """Number of subframes that the OSNMA operator needs from the start on, for all keys and all messages."""
        duration_s = self.n_epochs * self.interval_s
        message_s = self.start - self.start.subframe + duration_s + self.longest_delay_s + _AFTER_LAST_EPOCH_S
        return max(int(duration_s / SUBFRAME_S) + 3, int(message_s / SUBFRAME_S) + 1)

    def e1_multipath_m(self, truth: TruthBlock) -> Float[np.ndarray, " n"]:
        """Return the range error that multipath causes on E1, in m."""
        if not self.models.e1_multipath:
            return np.zeros(truth.time_s.size)
        return e1_multipath_error_m(truth.rays.delay_m, truth.rays.amplitude_e1)

    def seconds_late_m(self, truth: TruthBlock) -> Float[np.ndarray, " n"]:
        """Return the delay of the E1 signal on the receiver's clock in m, or 0 for delays up to `CLOCK_FOLLOWS_S`."""
        error_m = truth.e1.error_m + self.clock_offset_m
        return np.where(np.abs(error_m) > CLOCK_FOLLOWS_S * SPEED_OF_LIGHT_MPS, error_m, 0.0)

    @property
    def spoofer_as_received(self) -> Spoofer:
        """Attacker that E1 tracking and drawn correlators use.

        Under a sky, delay and Doppler of this attacker's signals contain the effect of the satellite's earlier
        position. Samples do not need this attacker, because `samples.attacked_sky` computes the earlier positions.
        """
        if self.elevation is None or not self.spoofer.attacks:
            return self.spoofer
        return SpooferUnderSky(
            attacks=self.spoofer.attacks, path=self.elevation.path, clock_offset_s=self.clock_offset_s
        )

    def repeated_later_m(self, truth: TruthBlock) -> Float[np.ndarray, " n"]:
        """Return the delay in m of the RECS to which the E1 hand-over leads, relative to the true RECS.

        The delay equals the E1 error on a single line of sight, and for E1 errors up to `CLOCK_FOLLOWS_S`. Under a sky
        a larger E1 error also contains the change of the satellite's range during the delay. The returned delay does
        not contain the change of the range.
        """
        error_m = truth.e1.error_m
        rows = np.flatnonzero(np.abs(error_m) > CLOCK_FOLLOWS_S * SPEED_OF_LIGHT_MPS)
        if self.elevation is None or not rows.size:
            return error_m
        found_m = error_m.copy()
        system_s = truth.time_s[rows] - self.clock_offset_s
        found_m[rows] = replay_delay_m(self.elevation.path, system_s, error_m[rows])
        return found_m

    @property
    def clock_offset_m(self) -> float:
        """Constant error of the receiver's clock, times c, in m."""
        return self.clock_offset_s * SPEED_OF_LIGHT_MPS

    @property
    def integration_s(self) -> float:
        """Duration of a RECS in s."""
        return self.n_chips / E6C.chip_rate_hz

    def arrival(self, truth: TruthBlock) -> Arrival:
        """Return the arrival in E6 of the RECS that are sent at the epochs."""
        return arrival(self.line_of_sight, truth)

    def received_s(self, truth: TruthBlock, arrived: Arrival) -> Float[np.ndarray, " n"]:
        """Return the end of the samples of each RECS in s after the start, on a clock that no attacker can shift.

        The clock may have the constant error `clock_offset_s`. If the time tag of a RECS is later than the time on this
        clock, the time tag is returned.
        """
        expected_s = arrived.dt_s + (self.repeated_later_m(truth) + self.clock_offset_m) / SPEED_OF_LIGHT_MPS
        received_s = truth.time_s + recorded_until_s(expected_s, self.n_chips, self.front_end)
        return np.maximum(received_s, received_s - self.seconds_late_m(truth) / SPEED_OF_LIGHT_MPS)

    def drawn_banks(
        self,
        first: int,
        truth: TruthBlock,
        arrived: Arrival,
        prediction_error_m: Float[np.ndarray, " n"],
        offsets_m: Float[np.ndarray, " n_taps"],
        other_signals: Float[np.ndarray, " n"] | None = None,
    ) -> tuple[Complex128[np.ndarray, "n n_taps"], Float[np.ndarray, " n"]]:
        """Return drawn taps and noise powers of RECS, which do not depend on the division of the run into blocks.

        `other_signals` is the density of the noise that all other signals of a sky add to a correlator, divided by N0.
        On a single line of sight `other_signals` is None.
        """
        model = CorrelatorModel(offsets_m=tuple(offsets_m.tolist()), n_chips=self.n_chips, front_end=self.front_end)
        n = truth.time_s.size
        rate_error_mps = (truth.e1_rate_noise_mps + truth.e1.rate_error_mps)[:, None]
        los_doppler_hz = E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * rate_error_mps
        error_m, attack = prediction_error_m[:, None], truth.e6
        moved_m = attack.delay_rate_mps * model.integration_s / 2
        delay_m = np.concatenate([error_m, error_m + truth.rays.delay_m, error_m + attack.delay_m + moved_m], axis=1)
        strength = np.concatenate([np.ones_like(error_m), truth.rays.amplitude, attack.amplitude], axis=1)
        relative_hz = np.concatenate([np.zeros_like(error_m), truth.rays.doppler_hz, attack.doppler_hz], axis=1)
        doppler_hz = los_doppler_hz + relative_hz
        phasor = (truth.geometry.amplitude * arrived.carrier)[:, None]
        forged_chips = np.concatenate([np.zeros(1 + truth.rays.delay_m.shape[1], bool), attack.forged_chips])
        taps = np.empty((n, len(model.offsets_m)), np.complex128)
        noise_power = np.empty(n)
        for block in range(first // DRAW_BLOCK, (first + n - 1) // DRAW_BLOCK + 1):
            start = block * DRAW_BLOCK
            low, high = max(first, start), min(first + n, start + DRAW_BLOCK)
            part = slice(low - first, high - first)
            draws = model.draws(stream(self.seed, "correlators", block, *self._labels), DRAW_BLOCK)
            disturbance = self.spoofer.attacks and drawn_disturbance(
                attack.part(part), offsets_m, forged_chips, seed=self.seed, first=low, labels=self._labels
            )
            taps[part], noise_power[part] = model.banks(
                rows_of(draws, slice(low - start, high - start)),
                cn0_dbhz=self.cn0_dbhz,
                delay_m=delay_m[part],
                amplitude=phasor[part] * strength[part],
                doppler_hz=doppler_hz[part],
                disturbance=disturbance or None,
                other_signals=None if other_signals is None else other_signals[part],
            )
        return taps, noise_power

    def segment(self, number: int) -> tuple[EncryptedSegment, ValidatedKey]:
        """Return the RECS number `number`, and the OSNMA key that decrypts this RECS."""
        chips = self.chips(self.transmit_time(number))
        key = self.key(chips.transmit_time)
        return encrypt(chips, key.data, key_delay=self.key_delay, mode=self.cipher_mode), key

    def chips(self, sent: GalileoTime) -> ChipSequence:
        """Return the chips of the RECS that is sent at the time `sent`."""
        return _chips_sent(self.seed, self.svid, sent, self.n_chips)

    def withheld(self, subframe_s: float) -> bool:
        """Return whether an attacker withholds from the receiver the key of the subframe that begins at `subframe_s`.

        `subframe_s` is in s after the scenario's start.
        """
        on_air = subframe_s + KEY_ON_AIR.disclosure_start_s, subframe_s + KEY_ON_AIR.disclosure_end_s
        return self.spoofer.withholds_osnma(*on_air)

    def key(self, sent: GalileoTime) -> ValidatedKey:
        """Return the OSNMA key that decrypts the RECS that is sent at the time `sent`."""
        return osnma_keys(self.seed, self.start, self._subframes, self.osnma)[key_time(sent, self.key_delay)]


def e1_error_m(truth: TruthBlock, multipath_m: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the error of the E1 pseudorange that E6 does not share, in m."""
    return truth.e1_noise_m + multipath_m + truth.e1.error_m


@lru_cache(maxsize=128)
def _chips_sent(seed: int, svid: int, sent: GalileoTime, n_chips: int) -> ChipSequence:
    """Return `n_chips` encrypted chips that a satellite sends from the time `sent` on."""
    return encrypted_chips(encryption_key(seed), svid, sent, n_chips)
