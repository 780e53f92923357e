"""Vestigial signal search as a step of the processor: thresholds out of what is searched, and the decision.

Theory of operation
-------------------
A meaconer must bring the encrypted signal into E6, and without nulling the true one stays there, too. So whoever finds
the chips of one RECS twice is being spoofed, and because nobody can send chips before they are broadcast, the earliest
is the true one [WFO, Sec. III-D, III-E].

`handover_peaks` goes from all signals of the satellite on E1 to E6. Each is measured on E1 and handed over as a line of
places (`CandidateEpochs`); over seconds E1 is measured again every `REMEASURE_S`, because a Doppler that is 1 Hz wrong
has moved away by a tap after a minute, and one that changes by 0.5 Hz/s after ten seconds. After the first authentic
position the clock is known: a narrower time uncertainty makes both searches as much shorter.
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

REMEASURE_S = 2.0  # between measurements of E1
_CHIP_S = 1 / E6C.chip_rate_hz
TRAVEL_TIME_S = (0.02, 0.16)  # travel time from any satellite to any receiver, with 50 ms to spare on both sides


@dataclass(frozen=True, slots=True, kw_only=True)
class VestigialDecision:
    """Decision from the peaks of one RECS: the true peak, and whether there is more than one signal."""

    svid: int
    peaks: tuple[Peak, ...]
    true: Peak | None  # the earliest peak; None if there is none, or if its chips may have been known when it arrived
    spoofed: bool  # whether there is more than one
    open_code: bool = False  # whether the chips are those of the open code: then the peaks say nothing


def decide_vestigial(
    svid: int,
    peaks: Iterable[Peak],
    proof: ReceptionProof | None = None,
    *,
    open_code: bool = False,
    repeated_after_s: float | None = None,
) -> VestigialDecision:
    """Return the decision on the peaks of a satellite: the earliest is the true signal, a second one is spoofing.

    `proof` is None if all samples are known to be from before the key's disclosure. With an open code neither is said.
    If the chips repeat after `repeated_after_s`, peaks that are whole multiples of it apart count once.
    """
    own = tuple(sorted((peak for peak in peaks if peak.svid == svid), key=lambda peak: peak.start_time))
    if open_code:
        return VestigialDecision(svid=svid, peaks=own, true=None, spoofed=False, open_code=True)
    if repeated_after_s is not None:
        own = tuple(_without_repetitions(own, repeated_after_s))
    secret = bool(own) and (proof is None or proof.holds(own[0].start_time))
    return VestigialDecision(svid=svid, peaks=own, true=own[0] if secret else None, spoofed=len(own) > 1)


def _without_repetitions(peaks: Iterable[Peak], period_s: float) -> Iterator[Peak]:
    """Yield peaks in order of time, without those that lie whole periods of their signal behind another one."""
    kept: list[Peak] = []
    for peak in peaks:
        received_s = period_s / (1 + peak.doppler_hz / E6_CARRIER_HZ)
        behind_s = [peak.start_time - one.start_time for one in kept]
        if all(abs(one - round(one / received_s) * received_s) > _CHIP_S or one < received_s / 2 for one in behind_s):
            kept.append(peak)
            yield peak


def reception_proof(assistance: Assistance, chips: ChipSequence, uncertainty_s: float) -> ReceptionProof:
    """Return which arrivals of a RECS are provably from before anybody could know its chips.

    The assistance holds the segment of the chips and its key. `uncertainty_s` is the upper limit of the error of the
    clock that the start is measured with, infinite if there is none.
    """
    times = {
        one.key_time
        for one in assistance.segments
        if one.svid == chips.svid and one.transmit_time == chips.transmit_time
    }
    disclosed_at = min(key.disclosed_at for key in assistance.keys if key.time in times)
    duration_s = chips.chips.size / chips.chip_rate_hz
    return ReceptionProof(disclosed_at=disclosed_at, duration_s=duration_s, time_uncertainty_s=uncertainty_s)


def arrival_window(
    sent: GalileoTime, uncertainty_s: float, samples: SampleSource
) -> tuple[GalileoTime, GalileoTime] | None:
    """Return when a chip may arrive at the earliest and at the latest, as far as samples go; None if never in them.

    `uncertainty_s` is the upper limit of the error of the samples' time, infinite if there is none.
    """
    head = samples.read(samples.first_sample, 1)
    end_s = (samples.end_sample - samples.first_sample) / head.sample_rate_hz
    first_s = max(sent - head.start + TRAVEL_TIME_S[0] - uncertainty_s, 0.0)
    last_s = min(sent - head.start + TRAVEL_TIME_S[1] + uncertainty_s, end_s)
    return (head.start + first_s, head.start + last_s) if first_s <= last_s else None


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateInterval:
    """A line of candidate epochs, with the first and last start at which the line is valid."""

    line: CandidateEpochs
    first_start: GalileoTime
    last_start: GalileoTime


def handover_line(
    snapshot: E1Snapshot, chips: ChipSequence, *, delay_m: float = 0.0, secondary: bool = True
) -> CandidateEpochs:
    """Return where a signal on E1 says that the chips may arrive in E6.

    `delay_m` is P6 − P1 from `predicted_delay_m`. With `secondary` the phase of the secondary code is used, if it is
    clear: places are 100 ms apart, not 4.
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
    """Return the lines of one signal on E1 over a time uncertainty; () if it cannot be measured where it was found.

    The signal was found in a batch whose first sample is at `found_at`; other arguments as in `handover_line`.
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
    """Return the signals in E6 at the places of all lines, in order of time, and the budget of the search.

    `overall_pfa` is the probability that noise alone gives any peak. Each place has an odd number of `taps`, half a
    chip apart.
    """
    if not stretches:
        return (), search_budget(0.0, E1_CODE_PERIOD_S, overall_pfa=overall_pfa, doppler_step_hz=0.0)
    places = sum(handover_positions(e6, one.line, one.first_start, one.last_start).size for one in stretches)
    chips = stretches[0].line.chips
    integration_s = chips.chips.size / chips.chip_rate_hz
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
    """Return the measurement of a signal in the window that begins at a time, None if the samples do not hold it."""
    head = e1.read(e1.first_sample, 1)
    low = e1.first_sample + round((at - head.start) * head.sample_rate_hz)
    count = min(round(E1_WINDOW_S * head.sample_rate_hz), e1.end_sample - low)
    if low < e1.first_sample or count <= 0:
        return None
    return measure_e1(e1.read(low, count), found)


def _moved(snapshot: E1Snapshot, time: GalileoTime) -> E1Snapshot:
    """Return the snapshot carried to another time with its own Doppler."""
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
    """Return where the signal is in a window that begins at a time."""
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
