"""Search for vestigial signals, with thresholds from the size of the search, and decide which signal is true.

Theory of operation
-------------------
A meaconer must repeat the encrypted signal on E6, where the true signal remains unless the meaconer nulls this signal.
So a receiver that finds the chips of one RECS twice is being spoofed. Nobody can send chips before they are broadcast,
so the earliest signal is the true signal [WFO, Sec. III-D, III-E].

`line_stretches` measures a signal on E1, and makes lines from the measurements. A line is a set of candidate times at
equal intervals, at which the chips may arrive in E6 (`CandidateEpochs`). `handover_peaks` searches E6 at the candidate
times of all signals of the satellite. E1 is measured again every `REMEASURE_S`, because errors of the Doppler shift the
line. A Doppler error of 1 Hz on E1 shifts the line by 11 m in a minute. A Doppler rate of 0.5 Hz/s shifts the line by
5 m in ten seconds. The time uncertainty is smaller after the first authentic position, which shortens both searches.
The searched time is at most twice the time uncertainty plus 0.14 s, the spread of `TRAVEL_TIME_S`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, E6_CARRIER_HZ, SECONDARY_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.crypto.osnma.disclosure import ReceptionProof
from vestige.records import Assistance, ChipSequence, SampleSource
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S, MIN_SECONDARY_MARGIN_DB, E1Snapshot, measure_e1
from vestige.sample_processor.search.handover_search import CandidateEpochs, handover_positions, search_handover
from vestige.sample_processor.search.peak import Peak, separated
from vestige.signals.definitions import E6C
from vestige.theory.search_budget import SearchBudget, search_budget
from vestige.time import GalileoTime

REMEASURE_S = 2.0  # time between measurements of E1 in s
_CHIP_S = 1 / E6C.chip_rate_hz
TRAVEL_TIME_S = (0.02, 0.16)  # shortest and longest travel time in s, with a margin of at least 50 ms


@dataclass(frozen=True, slots=True, kw_only=True)
class VestigialDecision:
    """Decision from the peaks of one RECS: the true peak, and whether there is more than one signal."""

    svid: int
    peaks: tuple[Peak, ...]
    true: Peak | None  # earliest peak; None without a peak, for an open code, or if the chips may have been public
    spoofed: bool  # whether there is more than one signal; False for an open code
    open_code: bool = False  # whether the chips belong to the open code, whose peaks prove nothing


def decide_vestigial(
    svid: int,
    peaks: Iterable[Peak],
    proof: ReceptionProof | None = None,
    *,
    open_code: bool = False,
    repeated_after_s: float | None = None,
) -> VestigialDecision:
    """Return the decision on the peaks of a satellite: the earliest peak is the true signal, other peaks are spoofing.

    `proof` is None if all samples are known to be from before the key's disclosure. For an open code, the decision
    names no true peak and reports no spoofing. If the chips repeat after `repeated_after_s`, peaks that are whole
    multiples of this period apart count once.
    """
    own = tuple(sorted((peak for peak in peaks if peak.svid == svid), key=lambda peak: peak.start_time))
    if open_code:
        return VestigialDecision(svid=svid, peaks=own, true=None, spoofed=False, open_code=True)
    if repeated_after_s is not None:
        own = tuple(_without_repetitions(own, repeated_after_s))
    secret = bool(own) and (proof is None or proof.holds(own[0].start_time))
    return VestigialDecision(svid=svid, peaks=own, true=own[0] if secret else None, spoofed=len(own) > 1)


def _without_repetitions(peaks: Iterable[Peak], period_s: float) -> Iterator[Peak]:
    """Yield peaks in order of time, without peaks that follow another peak by whole periods of the signal."""
    kept: list[Peak] = []
    for peak in peaks:
        received_s = period_s / (1 + peak.doppler_hz / E6_CARRIER_HZ)
        behind_s = [peak.start_time - one.start_time for one in kept]
        if all(abs(one - round(one / received_s) * received_s) > _CHIP_S or one < received_s / 2 for one in behind_s):
            kept.append(peak)
            yield peak


def reception_proof(assistance: Assistance, chips: ChipSequence, uncertainty_s: float) -> ReceptionProof:
    """Return the `ReceptionProof` of a RECS, which says whether the RECS arrived before anybody could know its chips.

    The assistance contains the segment of the chips and its key. `uncertainty_s` is the upper limit of the error of the
    clock that measures the arrival, infinite if there is no limit.
    """
    times = {
        one.key_time
        for one in assistance.segments
        if one.svid == chips.svid and one.transmit_time == chips.transmit_time
    }
    disclosed_at = min(key.disclosed_at for key in assistance.keys if key.time in times)
    duration_s = chips.duration_s
    return ReceptionProof(disclosed_at=disclosed_at, duration_s=duration_s, time_uncertainty_s=uncertainty_s)


def arrival_window(
    sent: GalileoTime, uncertainty_s: float, samples: SampleSource
) -> tuple[GalileoTime, GalileoTime] | None:
    """Return the earliest and latest arrival of a chip within the samples; None if the chip cannot be in the samples.

    `uncertainty_s` is the upper limit of the error of the samples' time, infinite if there is no limit.
    """
    head = samples.read(samples.first_sample, 1)
    end_s = (samples.end_sample - samples.first_sample) / head.sample_rate_hz
    first_s = max(sent - head.start + TRAVEL_TIME_S[0] - uncertainty_s, 0.0)
    last_s = min(sent - head.start + TRAVEL_TIME_S[1] + uncertainty_s, end_s)
    return (head.start + first_s, head.start + last_s) if first_s <= last_s else None


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateInterval:
    """Line of candidate times, with the first and last arrival of the chips for which the line is valid."""

    line: CandidateEpochs
    first_start: GalileoTime
    last_start: GalileoTime


def handover_line(
    snapshot: E1Snapshot, chips: ChipSequence, *, delay_m: float = 0.0, secondary: bool = True
) -> CandidateEpochs:
    """Return the candidate times at which the chips may arrive in E6, from a signal on E1.

    `delay_m` is P6 − P1 from `predicted_delay_m`. With `secondary` the phase of the secondary code is used if its
    margin is at least `MIN_SECONDARY_MARGIN_DB`. In this case the candidates are 100 ms apart instead of 4 ms.
    """
    known = secondary and snapshot.secondary_margin_db >= MIN_SECONDARY_MARGIN_DB
    period_s = SECONDARY_PERIOD_S if known else E1_CODE_PERIOD_S
    ahead_s = (chips.transmit_time.fraction - snapshot.transmit_phase_s) % period_s
    return CandidateEpochs(
        svid=snapshot.svid,
        chips=chips,
        anchor=snapshot.time + (ahead_s / (1 + snapshot.doppler_hz / E1_CARRIER_HZ) + delay_m / SPEED_OF_LIGHT_MPS),
        period_s=period_s,
        doppler_hz=snapshot.doppler_hz * E6_CARRIER_HZ / E1_CARRIER_HZ,
    )


def line_stretches(
    e1: SampleSource,
    found: Acquisition,
    found_at: GalileoTime,
    chips: ChipSequence,
    first_start: GalileoTime,
    last_start: GalileoTime,
    *,
    delay_m: float = 0.0,
    secondary: bool = True,
) -> tuple[CandidateInterval, ...]:
    """Return the lines of candidate times of a signal on E1; () if the signal cannot be measured in its batch.

    The lines cover the arrivals from `first_start` to `last_start`. The signal was found in a batch whose first sample
    is at `found_at`. `e1` are the E1 samples, and `chips` are the chips whose arrival is sought. `handover_line`
    explains `delay_m` and `secondary`.
    """
    first = _measured(e1, found, found_at)
    if first is None:
        return ()
    snapshots = [first]
    for step_s, limit in ((REMEASURE_S, last_start), (-REMEASURE_S, first_start)):
        latest = first
        while (limit - latest.time) / step_s > 0.5:
            predicted = _predicted(latest, latest.time + step_s)
            latest = _measured(e1, *predicted) or _moved(latest, latest.time + step_s)
            snapshots.append(latest)
    snapshots.sort(key=lambda one: one.time)
    edges = [one.time + (other.time - one.time) / 2 for one, other in pairwise(snapshots)]
    return tuple(
        CandidateInterval(
            line=handover_line(one, chips, delay_m=delay_m, secondary=secondary),
            first_start=max(low, first_start),
            last_start=min(high, last_start),
        )
        for one, low, high in zip(snapshots, [first_start, *edges], [*edges, last_start], strict=True)
        if max(low, first_start) <= min(high, last_start)
    )


def handover_peaks(
    e6: SampleSource,
    stretches: Sequence[CandidateInterval],
    *,
    overall_pfa: float = 1e-3,
    taps: int = 5,
    trace: Callable[[GalileoTime, float], None] | None = None,
) -> tuple[tuple[Peak, ...], SearchBudget]:
    """Return the signals in E6 at the candidate times of all lines, in order of time, and the budget of the search.

    `overall_pfa` is the probability that noise alone gives any peak. Each candidate has an odd number of `taps`, half a
    chip apart.
    """
    if not stretches:
        return (), search_budget(0.0, E1_CODE_PERIOD_S, overall_pfa=overall_pfa, doppler_step_hz=0.0)
    places = sum(handover_positions(e6, one.line, one.first_start, one.last_start).size for one in stretches)
    chips = stretches[0].line.chips
    integration_s = chips.duration_s
    budget = search_budget(float(places * taps), integration_s, overall_pfa=overall_pfa, doppler_step_hz=0.0)
    peaks = [
        peak
        for one in stretches
        for peak in search_handover(
            e6, one.line, one.first_start, one.last_start, budget.threshold, taps=taps, trace=trace
        )
    ]
    return separated(peaks), budget


def _measured(e1: SampleSource, found: Acquisition, at: GalileoTime) -> E1Snapshot | None:
    """Return the measurement of a signal from a time on; None if the samples begin later, or end too soon."""
    head = e1.read(e1.first_sample, 1)
    low = e1.first_sample + round((at - head.start) * head.sample_rate_hz)
    count = min(round(E1_WINDOW_S * head.sample_rate_hz), e1.end_sample - low)
    if low < e1.first_sample or count <= 0:
        return None
    return measure_e1(e1.read(low, count), found)


def _moved(snapshot: E1Snapshot, time: GalileoTime) -> E1Snapshot:
    """Return the measurement of E1 extrapolated to another time with the measured Doppler."""
    elapsed_s = (time - snapshot.time) * (1 + snapshot.doppler_hz / E1_CARRIER_HZ)
    return E1Snapshot(
        svid=snapshot.svid,
        time=time,
        transmit_phase_s=(snapshot.transmit_phase_s + elapsed_s) % SECONDARY_PERIOD_S,
        doppler_hz=snapshot.doppler_hz,
        cn0_dbhz=snapshot.cn0_dbhz,
        secondary_margin_db=snapshot.secondary_margin_db,
    )


def _predicted(snapshot: E1Snapshot, time: GalileoTime) -> tuple[Acquisition, GalileoTime]:
    """Return the predicted signal for a window that begins at `time`, and `time` itself."""
    moved = _moved(snapshot, time)
    ahead_s = -moved.transmit_phase_s % E1_CODE_PERIOD_S
    found = Acquisition(
        svid=snapshot.svid,
        code_start_s=ahead_s / (1 + snapshot.doppler_hz / E1_CARRIER_HZ),
        doppler_hz=snapshot.doppler_hz,
        statistic=float("nan"),
        threshold=float("nan"),
        cn0_dbhz=snapshot.cn0_dbhz,
    )
    return found, time
