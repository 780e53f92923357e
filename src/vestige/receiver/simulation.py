"""The simulated receiver: correlator banks of a block of epochs, at either fidelity [WFO, Sec. V].

Every epoch is one RECS. With P the pseudorange that geometry and receiver clock make, common to both bands,

    P1 = P + e1_noise + e1_multipath                 what E1 tracking says
    P6 = P + iono_diff + bias                        where the line of sight is in E6

so the hand-over misses the line of sight by P6 − P1 = iono_diff + bias − e1_noise − e1_multipath, and every other ray
comes its excess delay later. Under attack e1_error, what the E1 loop followed, is in P1 as well, and counterfeits,
noise and jamming are in E6 (`sampled_attack`, `disturbance`).

When E1 is wrong by more than 0.1 s, all satellites were delayed alike: then it is the receiver's clock that follows,
and every time label with it. Only `received_at` is on the independent clock that is good to `time_uncertainty_s`.

* `samples`: the server encrypts the epoch's chips under the epoch's OSNMA key, the receiver samples them with rays and
  noise, and the real processor decrypts and correlates an ordinary `Snapshot`.
* `correlators`: the banks are drawn from the exact model (`correlator_model`), a block at a time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.acas_processor.measurement import Availability
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.sampled_snapshot import block_of
from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.crypto.chain_parameters import ALPHA_BYTES, ChainParameters
from vestige.crypto.disclosure import provably_before_disclosure
from vestige.crypto.recs import encrypt, key_time
from vestige.crypto.simulated_chain import SimulatedChain
from vestige.errors import VestigeError
from vestige.receiver.correlator_model import CorrelatorModel
from vestige.receiver.disturbance import drawn_disturbance
from vestige.receiver.e1_multipath import e1_multipath_error_m
from vestige.receiver.elevation import ElevationEffects
from vestige.receiver.front_end import FrontEnd
from vestige.receiver.sampled_attack import counterfeit_signals, jammer_samples, true_signal
from vestige.receiver.sampled_epoch import (
    arrival,
    e6_samples,
    observation,
    osnma_chain,
    osnma_keys,
    received_signal,
    recorded_until_s,
    window,
)
from vestige.receiver.truth import ErrorModels, TruthBlock, TruthProcess
from vestige.records import Assistance, Band, CorrelatorBank, FrontEndStatus, Snapshot
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.range_model import RangeHistory
from vestige.signal_generator.synthesis import amplitude
from vestige.spoofer.spoofer import NOBODY, Spoofer
from vestige.streams import stream, stream_key
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

Fidelity = Literal["samples", "correlators"]

SVID = 11  # the paper's single line of sight needs a name
DRAW_BLOCK = 500  # epochs that share a stream of draws, wherever a chunk is cut
_E6_NOISE = 6  # stream number of the E6 noise
_ON_AIR = ChainParameters(alpha=bytes(ALPHA_BYTES))  # when a key is sent is the same for every alpha
CLOCK_FOLLOWS_S = 0.1  # no travel time is longer by more than this: it must be the clock
_STREAMS_A_SATELLITE = 1 << 16


NOT_RECEIVED = FrontEndStatus(agc_gain_db=math.nan, total_power_db=math.nan, saturated=False)


class Banks(NamedTuple):
    """The correlator banks of a block of epochs; `front_end` is None at the fidelity that has no samples."""

    taps: Complex128[np.ndarray, "n n_taps"]
    noise_power: Float[np.ndarray, " n"]
    front_end: tuple[FrontEndStatus, ...] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """A receiver on one line of sight, by itself or as one of a sky.

    Attributes
    ----------
    seed
        Everything random follows from it.
    start
        Time of epoch 0, a whole second; epochs are times of transmission.
    n_epochs, interval_s
        Number of RECS and the time between them, a multiple of 0.1 s.
    line_of_sight, models
        Range against time, and the receiver's error models.
    cn0_dbhz, cn0_e1_dbhz
        C/N0 of E6-C and of E1-C, each alone; −∞ on E6 is no signal, neither line of sight nor rays.
    front_end
        Of E6, with the sampling rate; E1 tracking has its own, in `BetzTrackingNoise`.
    time_uncertainty_s
        What the receiver believes of its clock.
    n_chips, key_delay
        Length of a RECS and its KDI.
    processor
        The receiver's processing.
    spoofer
        Who attacks.
    svid
        The satellite.
    elevation
        What depends on its elevation, if it is one of a sky; then its random numbers are its own, by SVID.
    truth_interval_s
        Time between the epochs of `truth`, if there are some between the RECS; None for those of the RECS alone.
    """

    seed: int
    start: GalileoTime
    n_epochs: int
    interval_s: float
    line_of_sight: RangeHistory
    models: ErrorModels
    cn0_dbhz: float
    cn0_e1_dbhz: float
    front_end: FrontEnd
    time_uncertainty_s: float
    n_chips: int
    key_delay: int
    processor: AcasProcessor
    spoofer: Spoofer = NOBODY
    svid: int = SVID
    elevation: ElevationEffects | None = None
    truth_interval_s: float | None = None

    def truth(self) -> TruthProcess:
        """Return the truth at its beginning."""
        return TruthProcess(
            self.models,
            self.line_of_sight,
            cn0_e1_dbhz=self.cn0_e1_dbhz,
            interval_s=self.interval_s if self.truth_interval_s is None else self.truth_interval_s,
            seed=self.seed,
            svid=self.svid,
            spoofer=self.spoofer,
            elevation=self.elevation,
        )

    def transmit_time(self, epoch: int) -> GalileoTime:
        """Return the time of an epoch, exact in deciseconds."""
        deciseconds = epoch * round(10 * self.interval_s)
        return GalileoTime.normalized(self.start.week, self.start.second + deciseconds // 10, deciseconds % 10 / 10)

    def osnma_chain(self) -> SimulatedChain:
        """Return the OSNMA chain of the run, which holds the key of every RECS."""
        return osnma_chain(self.seed, self.start, self._subframes)

    @property
    def _labels(self) -> tuple[int, ...]:
        """Whose random numbers are used: the receiver's own on a single line of sight."""
        return () if self.elevation is None else (self.svid,)

    @property
    def _first_stream(self) -> int:
        """First stream number of the noise in samples."""
        return 0 if self.elevation is None else _STREAMS_A_SATELLITE * self.svid

    @property
    def _subframes(self) -> int:
        return int(self.n_epochs * self.interval_s / SUBFRAME_S) + 3

    def e1_multipath_m(self, truth: TruthBlock) -> Float[np.ndarray, " n"]:
        """Return the range error that the rays make on E1, in m."""
        if not self.models.e1_multipath:
            return np.zeros(truth.time_s.size)
        return e1_multipath_error_m(truth.rays.delay_m, truth.rays.amplitude_e1)

    def prediction_error_m(self, truth: TruthBlock) -> Float[np.ndarray, " n"]:
        """Return how much later than the hand-over predicts the line of sight arrives in E6, in m."""
        e1_m = truth.e1_noise_m + self.e1_multipath_m(truth) + truth.e1.error_m
        return truth.iono_diff_m + truth.bias_m - e1_m

    def banks(self, fidelity: Fidelity, first: int, truth: TruthBlock) -> Banks:
        """Return taps and noise power of the epochs from `first` on; pure, and independent of the cut.

        Parameters
        ----------
        first
            Number of the first epoch.
        truth
            What `truth()` gave for these epochs.
        """
        if fidelity == "correlators":
            return self._drawn_banks(first, truth)
        e1_multipath_m = self.e1_multipath_m(truth)
        epochs = [
            self._correlated(first + row, row, truth, float(e1_multipath_m[row]))
            if truth.view.in_view[row]
            else (None, NOT_RECEIVED)
            for row in range(truth.time_s.size)
        ]
        nothing = np.full(self.processor.n_taps, np.nan + 0j)
        return Banks(
            np.array([nothing if bank is None else bank.taps for bank, _ in epochs]),
            np.array([np.nan if bank is None else bank.noise_power for bank, _ in epochs]),
            tuple(status for _, status in epochs),
        )

    def _drawn_banks(self, first: int, truth: TruthBlock) -> Banks:
        model = CorrelatorModel(
            offsets_m=tuple(self.processor.offsets_m.tolist()), n_chips=self.n_chips, front_end=self.front_end
        )
        n = truth.time_s.size
        rate_error_mps = (truth.e1_rate_noise_mps + truth.e1.rate_error_mps)[:, None]
        los_doppler_hz = E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * rate_error_mps
        error_m, attack = self.prediction_error_m(truth)[:, None], truth.e6
        moved_m = attack.delay_rate_mps * model.integration_s / 2
        delay_m = np.concatenate([error_m, error_m + truth.rays.delay_m, error_m + attack.delay_m + moved_m], axis=1)
        strength = np.concatenate([np.ones_like(error_m), truth.rays.amplitude, attack.amplitude], axis=1)
        relative_hz = np.concatenate([np.zeros_like(error_m), truth.rays.doppler_hz, attack.doppler_hz], axis=1)
        doppler_hz = los_doppler_hz + relative_hz
        phasor = (truth.view.amplitude * arrival(self.line_of_sight, truth).carrier)[:, None]
        own_chips = np.concatenate([np.zeros(1 + truth.rays.delay_m.shape[1], bool), attack.own_chips])
        disturbance = self.spoofer.attacks and drawn_disturbance(
            attack,
            self.processor.offsets_m,
            own_chips,
            seed=self.seed,
            first=first,
            block_epochs=DRAW_BLOCK,
            labels=self._labels,
        )
        taps = np.empty((n, len(model.offsets_m)), np.complex128)
        noise_power = np.empty(n)
        for block in range(first // DRAW_BLOCK, (first + n - 1) // DRAW_BLOCK + 1):
            start = block * DRAW_BLOCK
            low, high = max(first, start), min(first + n, start + DRAW_BLOCK)
            part = slice(low - first, high - first)
            taps[part], noise_power[part] = model.banks(
                model.draws(stream(self.seed, "correlators", block, *self._labels), DRAW_BLOCK).part(
                    low - start, high - start
                ),
                cn0_dbhz=self.cn0_dbhz,
                delay_m=delay_m[part],
                amplitude=phasor[part] * strength[part],
                doppler_hz=doppler_hz[part],
                disturbance=disturbance.part(part.start, part.stop) if disturbance else None,
            )
        lost = self._undecryptable(truth) | ~truth.view.in_view
        taps[lost], noise_power[lost] = np.nan, np.nan
        return Banks(taps, noise_power, None)

    def _correlated(
        self, epoch: int, row: int, truth: TruthBlock, e1_multipath_m: float
    ) -> tuple[CorrelatorBank | None, FrontEndStatus]:
        """Return the bank that the real processor makes of one epoch's samples, and the state of the front end.

        The bank is None where the receiver must not or cannot decrypt: see `_undecryptable`.
        """
        snapshot, assistance = self.snapshot(epoch, row, truth, e1_multipath_m)
        measured = self.processor.measure(block_of(snapshot), assistance)
        if measured.availability[0, 0] == Availability.OUTSIDE:
            raise VestigeError(
                f"epoch {epoch}: the errors that the scenario asks for put the hand-over beyond the recorded samples "
                f"({measured.why_unavailable(0, 0)})"
            )
        bank = None
        if measured.availability[0, 0] == Availability.CORRELATED:
            bank = CorrelatorBank(
                offsets_m=measured.banks.offsets_m,
                taps=measured.banks.taps[0, 0],
                noise_power=float(measured.banks.noise_power[0, 0]),
                integration_s=float(measured.banks.integration_s[0, 0]),
            )
        return bank, snapshot.front_end[Band.E6]

    def snapshot(self, epoch: int, row: int, truth: TruthBlock, e1_multipath_m: float) -> tuple[Snapshot, Assistance]:
        """Return what the receiver hands to the processor for one epoch, and the assistance for it.

        Parameters
        ----------
        epoch
            Number of the epoch.
        row
            Its place in `truth`.
        e1_multipath_m
            Its E1 range error by multipath in m.
        """
        sent, secret = self.transmit_time(epoch), encryption_key(self.seed)
        chips = encrypted_chips(secret, self.svid, sent, self.n_chips)
        key = self.key(sent)
        strength = amplitude(self.cn0_dbhz, self.front_end.input_rate_hz) * float(truth.view.amplitude[row])
        signal = received_signal(chips, self.line_of_sight, truth, row, amplitude=strength)
        late_s = float(truth.e1.error_m[row]) / SPEED_OF_LIGHT_MPS
        taken = window(signal.start_s + late_s, self.n_chips, self.front_end)
        where = (self.svid, sent, self.line_of_sight, truth, row, taken)
        forged = stream_key(self.seed, "chips that an attacker makes up")
        batch, status = e6_samples(
            (
                true_signal(secret, *where, amplitude=strength) or signal,
                *counterfeit_signals((secret, forged), *where, amplitude=strength),
            ),
            sent,
            taken,
            front_end=self.front_end,
            noise_key=noise_key(self.seed, epoch, self._first_stream + _E6_NOISE),
            noise_power=1.0 + float(truth.e6.white[row]),
            jammers=jammer_samples(
                truth,
                row,
                seed=self.seed,
                epoch=epoch,
                input_rate_hz=self.front_end.input_rate_hz,
                first_stream=self._first_stream,
            ),
        )
        received_at = batch.end
        error_m = float(truth.e1_noise_m[row]) + e1_multipath_m + float(truth.e1.error_m[row])
        if abs(late_s) > CLOCK_FOLLOWS_S:
            batch = replace(batch, start=batch.start + -late_s)
            error_m -= float(truth.e1.error_m[row])
        snapshot = Snapshot(
            index=epoch,
            time=sent,
            received_at=max(received_at, batch.end),  # labels that are ahead of the clock count too
            time_uncertainty_s=self.time_uncertainty_s,
            observations={self.svid: observation(self.svid, truth, row, error_m=error_m, cn0_dbhz=self.cn0_e1_dbhz)},
            e6=CorrelatableSamples(batch),
            front_end={Band.E6: status},
        )
        segments = (encrypt(chips, key.data, key_delay=self.key_delay),)
        return snapshot, Assistance(segments=segments, keys=() if self.withheld(key) else (key,))

    def withheld(self, key: ValidatedKey) -> bool:
        """Return whether the attacker keeps a key from the receiver."""
        return self.spoofer.withholds_osnma(key.disclosed_at - self.start, key.complete_at - self.start)

    def _undecryptable(self, truth: TruthBlock) -> Bool[np.ndarray, " n"]:
        """Return whether the receiver has no key, or cannot know that it recorded before the key's disclosure."""
        deciseconds = np.round(10 * (self.start.second + truth.time_s))
        key_s = SUBFRAME_S * (deciseconds // (10 * SUBFRAME_S) + self.key_delay) - self.start.second
        disclosed_s, complete_s = key_s + _ON_AIR.disclosure_start_s, key_s + _ON_AIR.disclosure_end_s
        late_s = truth.e1.error_m / SPEED_OF_LIGHT_MPS
        expected_s = arrival(self.line_of_sight, truth).dt_s + late_s
        received_s = truth.time_s + recorded_until_s(expected_s, self.n_chips, self.front_end)
        labelled_s = received_s - np.where(np.abs(late_s) > CLOCK_FOLLOWS_S, late_s, 0.0)
        lead_s = disclosed_s - np.maximum(received_s, labelled_s)
        lost = ~provably_before_disclosure(lead_s, self.time_uncertainty_s)
        if self.spoofer.attacks:
            for low_s, high_s in set(zip(disclosed_s.tolist(), complete_s.tolist(), strict=True)):
                lost[disclosed_s == low_s] |= self.spoofer.withholds_osnma(low_s, high_s)
        return lost

    def key(self, sent: GalileoTime) -> ValidatedKey:
        """Return the OSNMA key of the RECS that is sent at a time."""
        return osnma_keys(self.seed, self.start, self._subframes)[key_time(sent, self.key_delay)]
